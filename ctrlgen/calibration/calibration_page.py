"""The report of a calibration: constants.json, a figure, one self-contained calibration.html."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from ctrlgen.calibration.calibrate import Calibration
from ctrlgen.calibration.calibration_record import Budgets, CalibrationRecord, calibration_record
from ctrlgen.calibration.constants_files import write_constants
from ctrlgen.core.counts import number_of
from ctrlgen.core.files import write_text
from ctrlgen.core.to_digits import to_digits
from ctrlgen.reporting.html import render
from ctrlgen.reporting.numbers import with_interval
from ctrlgen.reporting.page_figure import FirstScreen, PageFigure
from ctrlgen.reporting.plots import COLOURS, STYLE, plt, svg
from ctrlgen.reporting.result_file import json_text

# numbers beside the figure; every one is in the tables
SHOWN = 10


def write_calibration(out: Path, calibration: Calibration, budgets: Budgets = None) -> None:
    """Writes constants.h, constants.bin, constants.json, figures/constants.svg and calibration.html into the folder `out`."""
    record = calibration_record(calibration, budgets)
    with plt.rc_context(STYLE):
        figure = svg(draw_constants(calibration))
    write_constants(out, calibration)
    write_text(out / "constants.json", json_text(record))
    write_text(out / "figures" / "constants.svg", figure)
    write_text(
        out / "calibration.html",
        render(
            Path(__file__).with_name("calibration.html.j2"),
            c=record,
            first=first_screen(record, PageFigure(figure, "Constants within their bounds", CAPTION)),
            title=calibration.device.title,
        ),
    )


CAPTION = "Bar: the value of the device file; point: that of this specimen with its 95 % interval."


def first_screen(c: CalibrationRecord, figure: PageFigure) -> FirstScreen:
    """How many constants are determined, how much better the model is with them, how the firmware gets them."""
    known = sum(k.determined for k in c.constants)
    worst = max(c.channels, key=lambda e: e.before / (e.noise or 1.0), default=None)
    better = (
        ""
        if worst is None
        else f"; error of {worst.channel} {to_digits(worst.before)} -> {to_digits(worst.after)} {worst.unit}"
    )
    numbers = [
        (k.path, f"{with_interval(k.value, k.interval95)[0]} {k.unit}" if k.determined else "not determined")
        for k in c.constants
    ]
    numbers += [
        (
            f"error of {e.channel}, noise {to_digits(e.noise, 3)} {e.unit}",
            f"{to_digits(e.before)} -> {to_digits(e.after)} {e.unit}",
        )
        for e in c.channels
    ]
    numbers += [(f"budget, {g.group}", f"{to_digits(g.before)} -> {to_digits(g.after)} {g.unit}") for g in c.budget]
    steps = ["Give the controller `constants.h` or `constants.bin` when it starts; both belong to this device alone."]
    if missing := [k.path for k in c.constants if not k.determined]:
        told = ", ".join(f"`{path}`" for path in missing)
        steps.append(f"Record what shows {told}, and calibrate again: the default is kept until then.")
    steps.append("Use `device.calibrated.toml` for `ctrlgen budget`, `fastest` and `learn`.")
    state = "ok" if known == len(c.constants) else "bad"
    answer = f"{known} of {number_of(len(c.constants), 'constant')} {'is' if known == 1 else 'are'} determined by the recording{better}."
    return FirstScreen((answer,), state, figure, tuple(numbers[:SHOWN]), tuple(steps))


def draw_constants(calibration: Calibration) -> Figure:
    """Each constant between its bounds, scaled to 0 ... 1: the file's value, and that of the specimen with its 95 % interval."""
    rows = calibration.constants
    figure, ax = plt.subplots(figsize=(7.2, 0.9 + 0.42 * len(rows)))
    for k, row in enumerate(rows):
        c = row.constant
        span = c.high - c.low
        low, value, high, default = (
            (v - c.low) / span for v in (row.interval[0], row.value, row.interval[1], c.default)
        )
        ax.plot([0, 1], [k, k], color="#cccccc", linewidth=1, zorder=0)
        ax.plot(default, k, "|", color="black", markersize=14, label="device file" if k == 0 else None)
        if row.determined:
            ax.errorbar(
                value, k, xerr=[[value - low], [high - value]], fmt="o", color=COLOURS[0], markersize=4, capsize=4
            )
        text = row.texts[0] if row.determined else "not determined"
        ax.text(1.03, k, text, va="center", fontsize=8)
    ax.plot([], [], "o", color=COLOURS[0], markersize=4, label="specimen, 95 %")
    ax.set_yticks(range(len(rows)), [row.constant.name for row in rows])
    ax.set_xlim(-0.02, 1.3)
    ax.set_ylim(len(rows) - 0.5, -0.7)
    ax.set_xticks([0, 1], ["low", "high"])
    ax.set_xlabel("within the bounds")
    ax.spines[["top", "right"]].set_visible(False)
    ax.legend(
        loc="upper center", bbox_to_anchor=(0.4, 1.3 if len(rows) < 5 else 1.12), ncols=2, frameon=False, fontsize=8
    )
    return figure
