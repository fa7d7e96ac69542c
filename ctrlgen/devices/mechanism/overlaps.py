"""Flexures of a drawing that lie in one another: two pieces of material cannot be in one place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ctrlgen.core.errors import Fault
from ctrlgen.core.units import show
from ctrlgen.devices.mechanism.copies import Placed
from ctrlgen.devices.mechanism.flexures import Flexible

SAME = 1e-6  # of the size of a mechanism: two places are one
SLIGHT = 0.01  # of a length or a section: less is rounding of a drawing, or a fillet
SKEW = 1e-3  # sine of the angle between two that are parallel; those that cross, as in a pivot, are drawn in one plane often


@dataclass(frozen=True, eq=False)
class Box:
    """The room of a flexure: its ends [m], `free` and `fixed` (one where it states no length), its frame and its section along y and z."""

    name: str
    bodies: frozenset[int]
    free: np.ndarray
    fixed: np.ndarray
    frame: np.ndarray
    section: tuple[float, float]

    @property
    def length(self) -> float:
        """[m]."""
        return float(np.linalg.norm(self.free - self.fixed))


def boxes(placed: Sequence[Placed]) -> list[Box]:
    """Of every flexure of a material."""
    found = []
    for e in placed:
        if isinstance(e.section, Flexible):
            turn = ca.DM(e.turn).full()
            at, frame = turn @ [x.si for x in e.section.at], turn @ ca.DM(e.section.frame).full()
            long, *section = e.section.room()
            found.append(
                Box(
                    e.name, frozenset({e.first, e.second}), at, at - long * frame[:, 0], frame, (section[0], section[1])
                )
            )
    return found


def _near(found: list[Box]) -> list[tuple[Box, Box]]:
    """The pairs that are parallel and not farther apart than their lengths and sections reach."""
    if not found:
        return []
    axes, middles = (np.array(x) for x in zip(*((e.frame[:, 0], (e.free + e.fixed) / 2) for e in found), strict=True))
    reach = np.array([e.length / 2 + sum(e.section) for e in found])
    parallel = np.abs(axes @ axes.T) > 1 - SKEW**2
    near = np.linalg.norm(middles[:, None] - middles, axis=2) <= reach[:, None] + reach
    return [(found[i], found[j]) for i, j in np.argwhere(np.triu(parallel & near, 1))]


def flexures_in_one_place(placed: Sequence[Placed], size: float) -> list[Fault]:
    """Those of which two join the same bodies and have both ends in one place of a mechanism of a `size` [m], drawn from whichever end."""
    return [
        Fault("element", f"{b.name} lies where {a.name} lies; move one, or give its width to the other")
        for a, b in _near(boxes(placed))
        if a.bodies == b.bodies and _coincide(a, b, size)
    ]


def _coincide(a: Box, b: Box, size: float) -> bool:
    if abs(a.frame[:, 0] @ b.frame[:, 0]) < 1 - SKEW**2:
        return False
    first, second = np.array([a.free, a.fixed]), np.array([b.free, b.fixed])
    ways = (second,) if a.frame[:, 0] @ b.frame[:, 0] > 0 else (second[::-1],)
    return any(bool(np.abs(first - way).max() < SAME * size) for way in ways)


def overlap_remarks(placed: Sequence[Placed]) -> list[str]:
    """Parallel flexures that run in one another over some length."""
    remarks = []
    for a, b in _near(boxes(placed)):
        if (shared := _shared(a, b)) > SLIGHT * max(min(a.length, b.length), 1e-12):
            remarks.append(
                f"{b.name} runs inside {a.name} over {show(shared, 'mm')} of their length: two pieces of material cannot be in one place; "
                "move one of them, or make it thinner"
            )
    return remarks


def _shared(a: Box, b: Box) -> float:
    """Over which length [m] two parallel ones do, by the separating axes of their sections."""
    x = a.frame[:, 0]
    if np.linalg.norm(np.cross(x, b.frame[:, 0])) > SKEW:
        return 0.0
    apart = b.free - a.free
    for axis in (*a.frame[:, 1:].T, *b.frame[:, 1:].T):
        across = axis - (axis @ x) * x
        half = sum(s / 2 * abs(box.frame[:, 1 + k] @ across) for box in (a, b) for k, s in enumerate(box.section))
        if abs(apart @ across) > half * (1 - SLIGHT):
            return 0.0
    one, other = (sorted((float(box.free @ x), float(box.fixed @ x))) for box in (a, b))
    return max(min(one[1], other[1]) - max(one[0], other[0]), 0.0)
