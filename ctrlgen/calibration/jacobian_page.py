"""The report of a calibrated Jacobian: jacobian.csv, jacobian.json, calibration.html, and a device that follows it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ctrlgen.calibration.device_file import NAME
from ctrlgen.calibration.jacobian_device import device_text
from ctrlgen.calibration.jacobian_record import PARTS, drives_of, jacobian_record, norms_of, sets_of, units_of
from ctrlgen.calibration.measured_jacobian import MeasuredJacobian
from ctrlgen.core.files import write_text
from ctrlgen.core.to_digits import to_digits
from ctrlgen.core.units import from_si
from ctrlgen.recordings.pose_errors import CHANNELS
from ctrlgen.reporting.html import render
from ctrlgen.reporting.numbers import with_deviation
from ctrlgen.reporting.page_figure import FirstScreen, PageFigure
from ctrlgen.reporting.plots import COLOURS, STYLE, legend_over, plt, svg
from ctrlgen.reporting.result_file import json_text


def write_jacobian(out: Path, found: MeasuredJacobian) -> None:
    """Writes jacobian.csv (entries in SI), jacobian.json, device.calibrated.toml, figures/errors.svg, calibration.html."""
    record = jacobian_record(found)
    with plt.rc_context(STYLE):
        figure = svg(draw_errors(found))
    names = drives_of(found)
    units = units_of(found)
    lines = ["component," + ",".join(names)]
    lines += [
        f"{c} [{u}]," + ",".join(f"{x:.9g}" for x in row)
        for c, u, row in zip(CHANNELS, units, found.jacobian, strict=True)
    ]
    write_text(out / "jacobian.csv", "\n".join(lines) + "\n")
    write_text(out / "jacobian.json", json_text(record))
    write_text(out / NAME, device_text(found))
    write_text(out / "figures" / "errors.svg", figure)
    page = render(
        Path(__file__).with_name("jacobian.html.j2"),
        r=record,
        drives=names,
        channels=CHANNELS,
        entries=[list(map(with_deviation, *rows)) for rows in zip(found.jacobian, found.sd, strict=True)],
        per_drive=units,
        first=_first_screen(found, PageFigure(figure, "Norm of the error of every pose", CAPTION)),
        title=found.device.title,
    )
    write_text(out / "calibration.html", page)


CAPTION = "Shaded: poses that were not fitted."


def _first_screen(found: MeasuredJacobian, figure: PageFigure) -> FirstScreen:
    which, before, after = sets_of(found)[-1]
    told = []
    for part, unit in (("translation", "um"), ("rotation", "deg")):
        b, a = (norms_of(e, part, unit)[0] for e in (before, after))
        told.append((f"mean {part} error, {which}", f"{to_digits(b)} -> {to_digits(a)} {unit}"))
    better = all(norms_of(after, p, u)[0] < norms_of(before, p, u)[0] for p, u in PARTS)
    answer = f"{found.numbers} numbers fitted to {int((~found.held_out).sum())} poses: {told[0][0]} {told[0][1]}."
    numbers = (*told, ("condition of the drives", f"{to_digits(found.condition, 3)}"))
    steps = (
        f"Use `{NAME}` in place of the device file: its controller in C follows this Jacobian.",
        "Is one channel's error a function of the drives? `ctrlgen diagnose` says what the device file leaves out.",
    )
    return FirstScreen((answer,), "ok" if better else "bad", figure, numbers, steps)


def draw_errors(found: MeasuredJacobian) -> Figure:
    """Norm of the error of every pose, as described and calibrated; the axis is logarithmic."""
    figure, panels = plt.subplots(1, 2, figsize=(8.2, 3.4))
    pose = 1 + np.arange(len(found.held_out))
    for axes, (part, unit) in zip(panels, PARTS, strict=True):
        for errors, colour, line, label in (
            (found.before, COLOURS[2], "s--", "as described"),
            (found.after, COLOURS[0], "o-", "calibrated"),
        ):
            size = np.asarray(from_si(getattr(errors, part), unit))
            axes.semilogy(pose, size, line, ms=3, lw=0.8, color=colour, label=label)
        for at in pose[found.held_out]:
            axes.axvspan(at - 0.5, at + 0.5, color="#000000", alpha=0.05, lw=0)
        axes.set_xlabel("pose")
        axes.set_ylabel(f"norm of the {part} error [{unit}]")
    legend_over(figure, panels[0])
    return figure
