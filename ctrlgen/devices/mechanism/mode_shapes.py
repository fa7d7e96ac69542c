"""Modes of a mechanism as lines that can be drawn: bodies between the points at which something holds them, flexures bent between their
ends as a beam without a load between them is, by the cubic of its end's places and slopes."""

from __future__ import annotations

import numpy as np

from ctrlgen.core.mode_lines import Line, ModeShape
from ctrlgen.devices.mechanism.condensed import nominal
from ctrlgen.devices.mechanism.drawing import Drawing
from ctrlgen.devices.mechanism.element_ends import element_ends
from ctrlgen.devices.mechanism.internal_modes import highest_told
from ctrlgen.devices.mechanism.modes import as_displacements, free_modes
from ctrlgen.physics.rigid_bodies import GROUND
from ctrlgen.physics.screw import numbers

MOST = 12
"""Modes of a page; as many as a reader compares."""
WITHOUT = 6
"""Modes where a file says nothing of inertia: those that `ctrlgen check` prints."""
STATIONS = np.linspace(0.0, 1.0, 9)  # of a bent flexure, smooth to the eye


def mode_shapes(device: Drawing) -> tuple[ModeShape, ...]:
    """The modes with the drives held, at home, up to the frequency to which its response is told (`modes_below`), the first one always;
    none where no body has a mass."""
    modes = free_modes(device)
    if not len(modes.frequencies):
        return ()
    below = highest_told(device)
    count = WITHOUT if below is None else max(1, int((modes.frequencies <= below).sum()))
    twists = modes.motions * as_displacements(device)[:, None]
    of_elements = element_ends(device)
    starts, ends = of_elements.starts, of_elements.ends
    held: dict[int, list[np.ndarray]] = {i: [] for i in (GROUND, *range(len(device.bodies)))}
    for e, start, end in zip(device.placed_elements, starts, ends, strict=True):
        held[e.first].append(start)
        held[e.second].append(end)
    for s in device.placed_super_elements:
        for body, place in zip(s.bodies, s.places, strict=True):
            held[body].append(place)
    held[device.bodies.index(device.output.body)].append(numbers(nominal(device).output_point).ravel())
    grounds = np.array(held.pop(GROUND)).reshape(-1, 3)

    def shape(k: int) -> ModeShape:
        def twist(body: int) -> np.ndarray:
            return np.zeros(6) if body == GROUND else twists[6 * body : 6 * body + 6, k]

        lines = [
            bent(start, end, twist(e.first), twist(e.second))
            for e, start, end in zip(device.placed_elements, starts, ends, strict=True)
        ]
        for s in device.placed_super_elements:
            moved = np.array([_at(place, twist(b)) for b, place in zip(s.bodies, s.places, strict=True)])
            middle, its = s.places.mean(axis=0), moved.mean(axis=0)
            lines += [
                Line(np.array([middle, p]), np.array([its, m]), "part") for p, m in zip(s.places, moved, strict=True)
            ]
        for body, places in held.items():
            middle = np.mean(places, axis=0)
            for place in places:
                rest = np.array([middle, place])
                lines.append(Line(rest, np.array([_at(p, twist(body)) for p in rest]), "body"))
        return ModeShape(float(modes.frequencies[k]), tuple(lines), grounds)

    return tuple(shape(k) for k in range(min(count, MOST, len(modes.frequencies))))


def _at(place: np.ndarray, twist: np.ndarray) -> np.ndarray:
    """(3,) displacement of a place by a twist at the origin."""
    return np.asarray(twist[3:] + np.cross(twist[:3], place))


def bent(start: np.ndarray, end: np.ndarray, first: np.ndarray, second: np.ndarray) -> Line:
    """A flexure whose ends move by the twists of its bodies: the cubic through their displacements with their slopes."""
    s, span = STATIONS[:, None], end - start
    u, v = _at(start, first), _at(end, second)
    slopes = np.cross(first[:3], span), np.cross(second[:3], span)
    moved = (1 - 3 * s**2 + 2 * s**3) * u + (3 * s**2 - 2 * s**3) * v
    moved = moved + (s - 2 * s**2 + s**3) * slopes[0] + (s**3 - s**2) * slopes[1]
    return Line(start + s * span, moved, "flexure")
