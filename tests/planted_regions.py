"""Laws in a region of the flexure axis's motion, by their definition: friction and damping beyond a place, a speed, a moment, a spring
that touches or lets go, a scratch on a scale, another gain of large drives.

Forces in steps of a hundredth of a sample, with edges that are ramps where the laws' are smooth. Friction is Dahl's, without a speed
below which it creeps.
"""

from __future__ import annotations

from collections.abc import Callable
from math import copysign
from typing import Any

import numpy as np
from axis_records import move
from recovery import Planted

FRICTION, REACH, DAMPER = 0.2, 3e-6, 60.0  # N, m, N s/m
ABOVE, BELOW, WIDTH, SPEED, MOMENT, RISE = 2e-5, -1.5e-5, 4e-6, 2e-3, 1.2, 0.02  # m, m, m, m/s, s, s
SPRING, SCRATCH, HALF, GAIN, LEVEL, GAP = 2e4, 3e-7, 6e-6, 0.1, 0.6, 2e-6  # N/m, m, m, 1, V, m
TIGHT, LONG, BUFFER = 1e-5, 2e-5, 1e5  # m, m, N/m
Where = Callable[[float, float, float], float]


def beyond(x: float, edge: float, width: float) -> float:
    """A ramp from 0 to 1 about the edge."""
    return min(max((x - edge) / width + 0.5, 0.0), 1.0)


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


def tight(q: float) -> float:
    """On the stretch, with a ramp at either end."""
    return beyond(q, TIGHT - LONG / 2, WIDTH) * beyond(-q, -TIGHT - LONG / 2, WIDTH)


def coulomb_on_stretch(u, t):
    return _friction(u, lambda time, q, v: tight(q))


def viscous_on_stretch(u, t):
    return move(u, lambda time, q, v, memory: (-5 * DAMPER * v * tight(q), memory), fine=100)


def viscous_above(u, t):
    return move(u, lambda time, q, v, memory: (-DAMPER * v * beyond(q, ABOVE, WIDTH), memory), fine=100)


def viscous_below(u, t):
    return move(u, lambda time, q, v, memory: (-DAMPER * v * beyond(-q, -BELOW, WIDTH), memory), fine=100)


def viscous_at_speed(u, t):
    return move(u, lambda time, q, v, memory: (-DAMPER * copysign(max(abs(v) - SPEED, 0.0), v), memory), fine=100)


def _spring(u: np.ndarray, x: Callable[[float], float]) -> np.ndarray:
    return move(u, lambda time, q, v, memory: (SPRING * x(q), memory), fine=20)


def stiffness_above(u, t):
    """A spring that lets go."""
    return _spring(u, lambda q: max(q - ABOVE, 0.0))


def stiffness_below(u, t):
    return _spring(u, lambda q: -max(BELOW - q, 0.0))


def stiffness_beyond(u, t):
    """A spring that touches on either side."""
    return _spring(u, lambda q: -copysign(max(abs(q) - ABOVE, 0.0), q))


def end_stop(u, t):
    """A spring as soft as a tenth of the stage's own."""
    return _spring(u, lambda q: max(BELOW - q, 0.0))


def damped_stop(u, t):
    """A buffer as soft as half the stage, which a speed of 2 mm/s toward it makes twice as strong."""
    return move(u, lambda now, q, v, _: (max(BELOW - q, 0.0) * BUFFER * max(1 - v / SPEED, 0.0), 0.0), fine=100)


def local_error(u, t):
    y = move(u)
    return y + SCRATCH * np.where(np.abs(y - ABOVE) < HALF, (1 + np.cos(np.pi * (y - ABOVE) / HALF)) / 2, 0.0)


def drive_gain_beyond(u, t):
    return move(u + GAIN * np.sign(u) * np.maximum(np.abs(u) - LEVEL, 0.0))


def _worn(u: np.ndarray, side: int, edge: float) -> np.ndarray:
    """A driven side that a gap lets stand still, which opens over a way of 20 um."""
    x, out = 0.0, []
    for place in move(u, fine=1):
        half = GAP / 2 * beyond(side * place, side * edge, 2e-5)
        x = min(max(x, place - half), place + half)
        out.append(x)
    return np.array(out)


def backlash_above(u, t):
    return _worn(u, 1, 0.0)


def backlash_below(u, t):
    return _worn(u, -1, 0.0)


_FRICTION = {"force": FRICTION}
_PLAY = Planted("stage:axis", {"gap": 2e-6, "edge": 0.0}, within={"gap": 0.03})
IN_A_REGION = {
    coulomb_above: Planted("stage:axis", _FRICTION | {"edge": ABOVE}, within={"force": 0.02, "edge": 0.01}),
    coulomb_below: Planted("stage:axis", _FRICTION | {"edge": BELOW}, within={"force": 0.02, "edge": 0.01}),
    coulomb_after: Planted("stage:axis", _FRICTION | {"moment": MOMENT}, within={"force": 0.02, "moment": 0.01}),
    coulomb_on_stretch: Planted(
        "stage:axis",
        _FRICTION | {"position": TIGHT, "length": LONG},
        within={"force": 0.03, "position": 0.02, "length": 0.03},
    ),
    viscous_on_stretch: Planted(
        "stage:axis",
        {"damping": 5 * DAMPER, "position": TIGHT, "length": LONG},
        within={"damping": 0.03, "position": 0.02, "length": 0.03},
    ),
    viscous_above: Planted("stage:axis", {"damping": DAMPER, "edge": ABOVE}, within={"damping": 0.03, "edge": 0.02}),
    viscous_below: Planted("stage:axis", {"damping": DAMPER, "edge": BELOW}, within={"damping": 0.03, "edge": 0.02}),
    backlash_above: _PLAY,
    backlash_below: _PLAY,
    stiffness_above: Planted("stage:axis", {"stiffness": -SPRING, "edge": ABOVE}),
    stiffness_below: Planted("stage:axis", {"stiffness": -SPRING, "edge": BELOW}),
    stiffness_beyond: Planted("stage:axis", {"stiffness": SPRING, "edge": ABOVE}),
    end_stop: Planted("stage:axis", {"stiffness": SPRING, "gap": BELOW}, within={"stiffness": 0.02}),
    damped_stop: Planted(
        "stage:axis", {"stiffness": BUFFER, "gap": BELOW, "speed": SPEED}, within={"stiffness": 0.02, "speed": 0.03}
    ),
    local_error: Planted(
        "sensor:axis", {"error": SCRATCH, "position": ABOVE, "length": HALF}, within={"error": 0.05, "length": 0.1}
    ),
    drive_gain_beyond: Planted("actuator:axis", {"gain": GAIN, "level": LEVEL}),
    viscous_at_speed: Planted(
        "stage:axis", {"damping": DAMPER, "speed": SPEED}, within={"damping": 0.03, "speed": 0.02}
    ),
}
