"""workspace.html: what poses a device can hold, as one self-contained page."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ctrlgen.app.workspace_summary import WorkspaceSummary
from ctrlgen.core.counts import listed
from ctrlgen.core.to_digits import to_digits
from ctrlgen.core.units import from_si
from ctrlgen.reporting.html import render
from ctrlgen.reporting.page_figure import FirstScreen, PageFigure
from ctrlgen.reporting.result_file import origin
from ctrlgen.trajectory.workspace import ROUNDING

NOTHING = 1e-3  # of a channel's typical size: a coordinate that is not told
CAPTION = (
    "Left slices at the poses that are named, right, where a third channel is drawn, the side view through the middle of the largest "
    "ball; its outline in orange, where both channels of a view are its own. Every pose inside a slice keeps all limits."
)


def workspace_page(summary: WorkspaceSummary, drawn: str) -> str:
    """The page as HTML text; `drawn`: the figure of the slices as SVG text."""
    signal = summary.workspace.model.signals["pose"]
    rows = []
    for i, (channel, unit) in enumerate(zip(signal.channels, signal.units, strict=True)):
        ends = [_ends(summary, r, i) for r in (*summary.ranges, summary.extent)]
        size = f"{to_digits(from_si(signal.scale[i], unit))}"
        rows.append((f"{channel} [{unit}]", ends, size, " … ".join(dict.fromkeys(summary.bound_by[i]))))
    balls = [(what, summary.radius_of(ball), _place(summary, ball.centre)) for what, ball in summary.balls]
    device = summary.workspace.model.device
    return render(
        Path(__file__).with_name("workspace.html.j2"),
        title=device.title,
        device=device.name,
        first=_first_screen(summary, PageFigure(drawn, "Slices of the workspace", CAPTION)),
        bases=[_place(summary, base) for base in summary.bases],
        rows=rows,
        balls=balls,
        source=device.source,
        origin=origin({}),
    )


def _first_screen(summary: WorkspaceSummary, figure: PageFigure) -> FirstScreen:
    signal, ball = summary.workspace.model.signals["pose"], summary.leading
    i = ball.channels[0]
    radius = f"{to_digits(from_si(ball.radius * signal.scale[i], signal.units[i]), 3)} {signal.units[i]}"
    named = listed([signal.channels[k] for k in ball.channels])
    answer = (
        f"Every pose within {radius} of {_place(summary, ball.centre)} in {named} can be held under all limits."
        if len(ball.channels) > 1
        else f"{named} can be held {radius} to either side of {_place(summary, ball.centre)}, under all limits."
    )
    numbers = [
        (f"{channel}, anywhere", f"{_ends(summary, summary.extent, k)} {unit}")
        for k, (channel, unit) in enumerate(zip(signal.channels, signal.units, strict=True))
    ]
    if summary.area is not None:
        what, area = summary.shown_area.split(": ")
        numbers.append((what, area))
    steps = (
        "Lay a path inside and solve it: `ctrlgen new scenario`, then `ctrlgen run`.",
        "Slices at other poses: `--at channel=value`, repeated.",
        "Limits hold for the device as described: `ctrlgen budget` tells what of them is left for what is uncertain.",
    )
    return FirstScreen((answer,), "ok", figure, tuple(numbers), steps)


def _ends(summary: WorkspaceSummary, ends: np.ndarray, i: int) -> str:
    """'-12.3 … 14' in the unit of channel i."""
    signal = summary.workspace.model.signals["pose"]
    shown = [v if abs(v) > ROUNDING * signal.scale[i] else 0.0 for v in ends[i]]
    return " … ".join(f"{to_digits(from_si(v, signal.units[i]))}" for v in shown)


def _place(summary: WorkspaceSummary, pose: np.ndarray) -> str:
    signal = summary.workspace.model.signals["pose"]
    named = zip(signal.channels, signal.units, signal.scale, pose, strict=True)
    told = [f"{c} = {to_digits(from_si(v, u))} {u}" for c, u, size, v in named if abs(v) > NOTHING * size]
    return ", ".join(told) or "home"
