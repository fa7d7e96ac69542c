"""Figures of a workspace: slices with the largest ball, or the range of one channel."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse

from ctrlgen.core.to_digits import to_digits
from ctrlgen.core.units import from_si
from ctrlgen.reporting.line_patterns import dashes, mark
from ctrlgen.reporting.plots import COLOURS
from ctrlgen.trajectory.workspace import ROUNDING, Ball, Workspace


def draw_workspace(workspace: Workspace, bases: list[np.ndarray], ball: Ball) -> Figure:
    """Slices of the workspace, one outline per base pose, with the side view through the ball and the ball itself."""
    signal = workspace.model.signals["pose"]
    if len(workspace.drawn) == 1:
        return _draw_range(workspace, bases[len(bases) // 2])
    x, y, *third = workspace.drawn
    figure, panels = plt.subplots(1, 1 + len(third), figsize=(8.6, 4.2) if third else (4.8, 4.2), squeeze=False)
    for j, (base, colour) in enumerate(zip(bases, COLOURS[::2], strict=False)):
        k = third[0] if third else x  # the channel that tells the slices apart
        at = base[k] if abs(base[k]) > ROUNDING * signal.scale[k] else 0.0
        label = f"{signal.channels[k]} = {to_digits(from_si(at, signal.units[k]))} {signal.units[k]}"
        _fill(panels[0][0], workspace, base, x, y, label, colour, j)
    for up in third:
        _fill(panels[0][1], workspace, ball.centre, x, up, "through the ball's centre", COLOURS[0], 0)
    for panel, up in reversed(list(zip(panels[0], (y, *third), strict=True))):
        if x in ball.channels and up in ball.channels:
            _outline_ball(panel, workspace, ball, x, up)
            break
    for panel, vertical in zip(panels[0], (y, *third), strict=True):
        if signal.units[x] == signal.units[vertical]:
            panel.set_aspect("equal", adjustable="datalim")
        panel.set_xlabel(f"{signal.channels[x]} [{signal.units[x]}]")
        panel.set_ylabel(f"{signal.channels[vertical]} [{signal.units[vertical]}]")
        panel.legend(fontsize=8, ncols=2, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return figure


def _outline_ball(panel: Axes, workspace: Workspace, ball: Ball, x: int, y: int) -> None:
    """The ball in two of its channels: an ellipse, as each radius is in the typical size of its channel."""
    signal = workspace.model.signals["pose"]
    centre = [from_si(ball.centre[i], signal.units[i]) for i in (x, y)]
    radius = [from_si(ball.radius * signal.scale[i], signal.units[i]) for i in (x, y)]
    panel.add_patch(Ellipse((centre[0], centre[1]), 2 * radius[0], 2 * radius[1], fill=False, color=COLOURS[2], lw=1.5))
    panel.plot([], [], color=COLOURS[2], label=f"largest ball, radius {to_digits(radius[0], 3)} {signal.units[x]}")


def _draw_range(workspace: Workspace, base: np.ndarray) -> Figure:
    """How much of the nearest limit's range is left along the one channel, to both ends."""
    signal, ends = workspace.model.signals["pose"], workspace.ranges(base)[0]
    figure, panel = plt.subplots(figsize=(4.8, 3.6))
    along = np.linspace(ends[0], ends[1], 201)
    panel.plot(from_si(along, signal.units[0]), -100 * workspace.excess(along[:, None]), color=COLOURS[0])
    for k, (end, name) in enumerate(zip(ends, workspace.bound_by(base)[0], strict=True)):
        panel.plot([from_si(end, signal.units[0])], [0], mark(k), color=COLOURS[2], label=name)
    panel.set_xlabel(f"{signal.channels[0]} [{signal.units[0]}]")
    panel.set_ylabel("left of the nearest limit's range [%]")
    panel.legend(fontsize=8, ncols=2, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return figure


def _fill(panel: Axes, workspace: Workspace, base: np.ndarray, x: int, y: int, label: str, colour: str, k: int) -> None:
    """The slice through `base` in channels `x` and `y`, the `k`-th of its panel: outlined so that no colour is needed."""
    units = workspace.model.signals["pose"].units
    edge = workspace.outline(base, x, y)
    shown = from_si(edge[:, 0], units[x]), from_si(edge[:, 1], units[y])
    panel.fill(*shown, facecolor=to_rgba(colour, 0.25), edgecolor=colour, ls=dashes(k), lw=1.3, label=label)
