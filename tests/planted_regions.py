"""Laws in a region of the flexure axis's motion, by their definition: dry friction and damping beyond a place, a speed, a moment.

Forces in steps of a hundredth of a sample, with edges that are ramps where the laws' are smooth. Friction is Dahl's, without a speed
below which it creeps.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from axis_records import move
from recovery import Planted

FRICTION, REACH, DAMPER = 0.2, 3e-6, 60.0  # N, m, N s/m
ABOVE, BELOW, WIDTH, SPEED, MOMENT, RISE = 2e-5, -1.5e-5, 4e-6, 2e-3, 1.2, 0.02  # m, m, m, m/s, s, s
Where = Callable[[float, float, float], float]


def beyond(x: float, edge: float, width: float) -> float:
    """A ramp from 0 to 1 about the edge."""
    return float(np.clip((x - edge) / width + 0.5, 0.0, 1.0))


def _friction(u: np.ndarray, where: Where) -> np.ndarray:
    def force(time: float, q: float, v: float, memory: Any) -> tuple[float, Any]:
        z, before = memory or (0.0, 0.0)
        step = q - before
        z += (step - abs(step) * z) / REACH
        return -FRICTION * z * where(time, q, v), (z, q)

    return move(u, force, fine=100)


def coulomb_above(u, t):
    return _friction(u, lambda time, q, v: beyond(q, ABOVE, WIDTH))


def coulomb_below(u, t):
    return _friction(u, lambda time, q, v: beyond(-q, -BELOW, WIDTH))


def coulomb_after(u, t):
    return _friction(u, lambda time, q, v: beyond(time, MOMENT, RISE))


def viscous_above(u, t):
    return move(u, lambda time, q, v, memory: (-DAMPER * v * beyond(q, ABOVE, WIDTH), memory), fine=100)


def viscous_below(u, t):
    return move(u, lambda time, q, v, memory: (-DAMPER * v * beyond(-q, -BELOW, WIDTH), memory), fine=100)


def viscous_at_speed(u, t):
    return move(u, lambda time, q, v, memory: (-DAMPER * np.sign(v) * max(abs(v) - SPEED, 0.0), memory), fine=100)


_FRICTION = {"force": FRICTION}
IN_A_REGION = {
    coulomb_above: Planted("stage:axis", _FRICTION | {"edge": ABOVE}, within={"force": 0.02, "edge": 0.01}),
    coulomb_below: Planted("stage:axis", _FRICTION | {"edge": BELOW}, within={"force": 0.02, "edge": 0.01}),
    coulomb_after: Planted("stage:axis", _FRICTION | {"moment": MOMENT}, within={"force": 0.02, "moment": 0.01}),
    viscous_above: Planted("stage:axis", {"damping": DAMPER, "edge": ABOVE}, within={"damping": 0.03, "edge": 0.02}),
    viscous_below: Planted("stage:axis", {"damping": DAMPER, "edge": BELOW}, within={"damping": 0.03, "edge": 0.02}),
    viscous_at_speed: Planted(
        "stage:axis", {"damping": DAMPER, "speed": SPEED}, within={"damping": 0.03, "speed": 0.02}
    ),
}
