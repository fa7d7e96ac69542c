"""The report of a calibration: constants.json, a figure, one self-contained calibration.html."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from ctrlgen.calibration.calibrate import Calibration
from ctrlgen.calibration.calibration_record import Budgets, calibration_record
from ctrlgen.calibration.constants_files import write_constants
from ctrlgen.core.files import write_text
from ctrlgen.reporting.html import render
from ctrlgen.reporting.plots import COLOURS, STYLE, plt, svg
from ctrlgen.reporting.result_file import json_text


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
            Path(__file__).with_name("calibration.html.j2"), c=record, figure=figure, title=calibration.device.title
        ),
    )


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
        text = c.shown(row.value) if row.determined else "not determined"
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
