"""Mode shapes as small drawings: at rest, displaced, and on a screen moving between both sides. SVG alone, without a script."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ctrlgen.core.mode_lines import Line, ModeShape
from ctrlgen.reporting.plots import COLOURS

# An axonometric view: x to the right and toward the reader, y away, z up; (2, 3) from space to the picture
VIEW = np.array([[0.87, 0.5, 0.0], [0.28, -0.42, -0.86]])
WIDTH, HEIGHT, MARGIN = 300, 220, 34  # of a picture
MOVED = 0.12  # of the size of what is drawn: the largest displacement in a picture
PERIOD = 2.0  # s of a cycle, the same for every mode: the eye follows it
EASED = ".36 0 .64 1"  # half a cycle of a sine, as a cubic
STYLES = {
    "body": (COLOURS[5], 3.0),
    "flexure": (COLOURS[0], 1.6),
    "part": (COLOURS[0], 1.0),
}


def mode_svg(shape: ModeShape) -> str:
    """The drawing: the lines at rest in grey, and at one side of the motion; on a screen they also move, in print they do not."""
    rest = np.vstack([line.rest for line in shape.lines])
    moved = np.vstack([line.moved for line in shape.lines])
    size = max(float(np.linalg.norm(np.ptp(rest, axis=0))), 1e-9)
    amplitude = MOVED * size / max(float(np.linalg.norm(moved, axis=1).max()), 1e-300)
    flat = (rest @ VIEW.T, amplitude * moved @ VIEW.T)
    every = np.vstack([flat[0], flat[0] + flat[1], flat[0] - flat[1]])
    low, high = every.min(axis=0), every.max(axis=0)
    inner = np.array([WIDTH, HEIGHT]) - 2 * MARGIN
    scale = float((inner / np.maximum(high - low, 1e-3 * size)).min())
    offset = np.array([WIDTH, HEIGHT]) / 2 - scale * (low + high) / 2

    def points(line: Line, side: float) -> str:
        at = (line.rest + side * amplitude * line.moved) @ VIEW.T * scale + offset
        return " ".join(f"{x:.1f},{y:.1f}" for x, y in at)

    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" class="mode" fill="none" stroke-linecap="round">'
    ]
    for x, y in shape.grounds @ VIEW.T * scale + offset:
        parts.append(f'<rect x="{x - 2.5:.1f}" y="{y - 2.5:.1f}" width="5" height="5" fill="currentColor"/>')
    for line in shape.lines:
        width = STYLES[line.of][1]
        parts.append(
            f'<polyline points="{points(line, 0)}" stroke="#999999" stroke-width="{width / 2:g}" stroke-dasharray="3 2"/>'
        )
    parts.append('<g class="side">')
    for line in shape.lines:
        colour, width = STYLES[line.of]
        parts.append(f'<polyline points="{points(line, 1)}" stroke="{colour}" stroke-width="{width:g}"/>')
    parts.append('</g><g class="moving">')
    for line in shape.lines:
        colour, width = STYLES[line.of]
        values = ";".join(points(line, side) for side in (1, -1, 1))
        parts += [
            f'<polyline points="{points(line, 1)}" stroke="{colour}" stroke-width="{width:g}">',
            f'<animate attributeName="points" values="{values}" dur="{PERIOD:g}s" calcMode="spline" keySplines="{EASED};{EASED}" ',
            'repeatCount="indefinite"/></polyline>',
        ]
    return "".join([*parts, "</g>", *_axes(), "</svg>"])


def _axes() -> Sequence[str]:
    """The directions x, y and z in a corner."""
    corner, length = np.array([22.0, HEIGHT - 16.0]), 14.0
    parts = []
    for name, direction in zip("xyz", VIEW.T, strict=True):
        tip = corner + length * direction
        label = corner + 1.5 * length * direction
        parts.append(f'<path d="M{corner[0]:.1f} {corner[1]:.1f}L{tip[0]:.1f} {tip[1]:.1f}" stroke="currentColor"/>')
        at = f'x="{label[0]:.1f}" y="{label[1] + 3:.1f}"'
        parts.append(f'<text {at} font-size="9" text-anchor="middle" fill="currentColor">{name}</text>')
    return parts
