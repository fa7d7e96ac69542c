"""A mechanism drawn in space: bodies, flexures with their names, actuators, the ground and the output point."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from ctrlgen.core.files import write_bytes
from ctrlgen.devices.mechanism.condensed import nominal
from ctrlgen.devices.mechanism.element_ends import element_ends
from ctrlgen.devices.mechanism.mechanism import Mechanism
from ctrlgen.physics.rigid_bodies import GROUND
from ctrlgen.reporting.plots import COLOURS, legend_over

MM = 1e3  # per metre
ARROW = 0.12  # of the mechanism's extent: an actuator's


def draw_mechanism(device: Mechanism, path: Path) -> None:
    """Writes the figure of a mechanism, .svg or .png."""
    figure, buffer = mechanism_figure(device), io.BytesIO()
    with rc_context({"svg.hashsalt": "ctrlgen", "text.parse_math": False}):
        metadata = {"Date": None, "Creator": "ctrlgen"} if path.suffix == ".svg" else None
        figure.savefig(buffer, format=path.suffix[1:], dpi=150, metadata=metadata, bbox_inches="tight")
    write_bytes(path, buffer.getvalue())


def mechanism_figure(device: Mechanism) -> Figure:
    """The mechanism as it is described, in mm."""
    c = nominal(device)
    of_elements = element_ends(device)
    fixed, free = ([place * MM for place in places] for places in (of_elements.starts, of_elements.ends))
    ports = [place * MM for s in device.placed_super_elements for place in s.places]
    output = np.array([x.si for x in device.output.at]) * MM

    figure = Figure(figsize=(8, 7), layout="constrained")
    ax = figure.add_subplot(projection="3d")
    joints: list[list[np.ndarray]] = [[] for _ in device.bodies]
    for e, a, b in zip(device.placed_elements, fixed, free, strict=True):
        ax.plot(*np.array([a, b]).T, color=COLOURS[0], lw=2.5)
        ax.text(*((a + b) / 2), e.name, fontsize=6, color=COLOURS[0])
        for number, point in ((e.first, a), (e.second, b)):
            if number == GROUND:
                ax.scatter(*point, marker="s", color="black", s=22)
            else:
                joints[number].append(point)
    joints[device.bodies.index(device.output.body)].append(output)
    for s in device.placed_super_elements:
        places = s.places * MM
        for number, point in zip(s.bodies, places, strict=True):
            ax.plot(*np.array([places.mean(axis=0), point]).T, color=COLOURS[0], lw=2.5, ls=":")
            if number == GROUND:
                ax.scatter(*point, marker="s", color="black", s=22)
            else:
                joints[number].append(point)
        ax.text(*places.mean(axis=0), s.name, fontsize=6, color=COLOURS[0])
    for pushed, direction in zip(device.placed_actuators, c.directions, strict=True):
        tip = np.array(ca.DM(ca.evalf(ca.SX(c.point(pushed))))).ravel() * MM if c.pushes else free[c.element_of(pushed)]
        arrow = ARROW * of_elements.extent * MM * np.array(ca.DM(ca.evalf(ca.SX(direction)))).ravel()
        ax.quiver(*(tip - arrow), *arrow, color=COLOURS[2], lw=2, arrow_length_ratio=0.35)
        ax.text(*(tip - arrow), pushed.name, fontsize=8, color=COLOURS[2], fontweight="bold")
        if c.pushes and pushed.second != GROUND:
            joints[pushed.second].append(tip)
    for r in device.placed_readings:
        if r.section.at is not None:  # a rotation is read anywhere on its body
            seen = np.array(ca.DM(ca.mtimes(r.turn, ca.DM([x.si for x in r.section.at])))).ravel() * MM
            ax.scatter(*seen, marker="o", facecolors="none", edgecolors=COLOURS[3], s=40)
            ax.text(*seen, f" {r.name}", fontsize=7, color=COLOURS[3])
            if r.second != GROUND:
                joints[r.second].append(seen)
    for name, points in zip(device.bodies, joints, strict=True):
        middle = np.mean(points, axis=0)
        for point in points:
            ax.plot(*np.array([middle, point]).T, color="#999999", lw=1)
        ax.text(*middle, name, fontsize=8, color="#555555")
    ax.scatter(*output, marker="*", s=120, color=COLOURS[4], label="output point")
    ax.scatter([], [], [], marker="s", color="black", s=22, label="ground")
    _equal(ax, [*free, *fixed, *ports, output])
    ax.set_xlabel("x [mm]")
    ax.set_ylabel("y [mm]")
    ax.set_zlabel("z [mm]")
    ax.set_title(device.title, fontsize=10)
    legend_over(figure, ax)
    return figure


def _equal(ax: Any, points: Sequence[np.ndarray]) -> None:
    """One scale for the three axes; a flat mechanism is shown in a flat box."""
    low, high = np.min(points, axis=0), np.max(points, axis=0)
    span = np.maximum(high - low, 0.25 * (high - low).max())
    for set_limits, middle, width in zip((ax.set_xlim, ax.set_ylim, ax.set_zlim), (low + high) / 2, span, strict=True):
        set_limits(middle - 0.55 * width, middle + 0.55 * width)
    ax.set_box_aspect(span, zoom=1.15)
