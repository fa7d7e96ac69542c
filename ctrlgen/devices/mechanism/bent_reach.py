"""How far a drive takes its axis alone where the force that pulls it home is not linear: flexures stretch, bodies have turned.

On the way of axis i its own displacement is x, those of the others are where nothing pushes them, F_j(d) = 0, and its drive pushes with
F_i(d), F the force of second order of the mechanism (`second_order`) with that of flexures that stretch (`stretching`), and of loads.
"""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np

from ctrlgen.devices.mechanism.condensed import Condensed
from ctrlgen.devices.mechanism.loads import Loads
from ctrlgen.devices.mechanism.stretching import Stretching

POINTS = 40  # of a way: between them a stress is that of a parabola to a thousandth
FARTHEST = 10.0  # times the largest travel: farther the force is not that of a drawing
CORRECTIONS = 20  # of Newton's method at a point
SETTLED = 1e-9  # of the force at the end, or of a displacement
NUDGE = 1e-6  # of a displacement, for the slope

Force = Callable[[np.ndarray], np.ndarray]


def pulled_home(c: Condensed, loads: Loads, stretching: Stretching | None) -> Force:
    """F(d) (n,) [N] of a mechanism of numbers without cubic springs."""
    d = ca.SX.sym("d", len(c.directions))
    force = c.restoring_force(d) + loads.s.restoring_force(d, None if stretching is None else stretching.energy)
    force += loads.restoring_force(d) if loads.there else 0
    function = ca.Function("pulled_home", [d], [force])
    return lambda at: np.asarray(function(at)).ravel()


def bent_way(
    force: Force, home: np.ndarray, own: int, straight: np.ndarray, push: float, travel: float
) -> np.ndarray | None:
    """(points, n) displacements from `home` on, where no drive pushes, to where that of axis `own` pushes with `push` [N]; it begins along
    `straight` (n,), its slope per x. None where that is not within `FARTHEST` times the `travel` [m]."""
    others = [j for j in range(len(home)) if j != own]
    step = (
        float(np.sign(push))
        * min(FARTHEST * travel, abs(push / _stiffness(force, home, straight, own, travel)))
        / POINTS
    )
    way, pushes = [home], [0.0]
    while abs(way[-1][own] - home[own]) < FARTHEST * travel:
        start = way[-1] + step * (straight if len(way) == 1 else (way[-1] - way[-2]) / step)
        there = _balanced(force, start, others, abs(push))
        if there is None:
            return None
        way.append(there)
        pushes.append(float(force(there)[own]))
        if abs(pushes[-1]) >= abs(push) and pushes[-1] * push > 0:
            return _shortened(force, np.array(way), own, others, push)
    return None


def home_of(force: Force, start: np.ndarray, scale: float) -> np.ndarray | None:
    """(n,) where nothing pushes, near `start`; `scale` [N] is a force that counts."""
    return _balanced(force, start, list(range(len(start))), scale)


def _stiffness(force: Force, home: np.ndarray, straight: np.ndarray, own: int, travel: float) -> float:
    nudge = NUDGE * travel
    return float((force(home + nudge * straight)[own] - force(home - nudge * straight)[own]) / (2 * nudge))


def _balanced(force: Force, start: np.ndarray, free: list[int], scale: float) -> np.ndarray | None:
    """From `start` on with the axes `free` moved until nothing pushes them; None where they do not settle."""
    d = start.copy()
    for _ in range(CORRECTIONS if free else 0):
        r = force(d)[free]
        if np.abs(r).max() <= SETTLED * scale:
            return d
        nudge = NUDGE * max(float(np.abs(d).max()), 1e-9)
        slopes = [(force(d + nudge * e)[free] - force(d - nudge * e)[free]) / (2 * nudge) for e in np.eye(len(d))[free]]
        try:
            d[free] -= np.linalg.solve(np.array(slopes).T, r)
        except np.linalg.LinAlgError:  # it buckles there
            return None
    return None if free else d


def _shortened(force: Force, way: np.ndarray, own: int, others: list[int], push: float) -> np.ndarray | None:
    """The way with its last point where the push is the one asked for, by halving the last step."""
    low, high = 0.0, 1.0
    end: np.ndarray = way[-1]
    while high - low > SETTLED:
        middle = (low + high) / 2
        there = _balanced(force, way[-2] + middle * (way[-1] - way[-2]), others, abs(push))
        if there is None:
            return None
        end = there
        low, high = (low, middle) if abs(force(end)[own]) >= abs(push) else (middle, high)
    return np.vstack([way[:-1], end])
