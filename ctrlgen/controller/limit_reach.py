"""Which limits of actuator states and drives a displacement in its range can meet at all, by interval arithmetic over every state.

What cannot be met is not looked for in the C. A rate of a drive lets a device pass limits of displacements and states, from where nothing
is shown.
"""

from __future__ import annotations

import numpy as np

from ctrlgen.model.inverse import Inverse
from ctrlgen.model.model import Model
from ctrlgen.numerics.interval_arithmetic import bounds

Slacks = tuple[np.ndarray, np.ndarray, np.ndarray]  # of displacement, actuator state and drive


def state_beyond(m: Model, static: Inverse, moving: Inverse, slacks: Slacks) -> bool:
    """Whether a displacement in range can need an actuator state beyond its limits by more than the slack."""
    n = m.n_states
    for k in (static, moving) if n else ():
        low, high = bounds(k.state, _ranges(m))
        if np.any(low < m.x_bounds[0][:n] - slacks[1]) or np.any(high > m.x_bounds[1][:n] + slacks[1]):
            return True
    return False


def drive_beyond(m: Model, static: Inverse, moving: Inverse, slacks: Slacks) -> tuple[bool, bool]:
    """Whether a displacement in range can need a drive beyond its limits by more than the slack, to settle there and to step there."""
    n, (low, high) = m.n_states, m.u_bounds
    beyond = []
    for k in (static, moving):
        ranges = _ranges(m)
        if n:
            state = bounds(k.state, ranges)
            ranges["state"] = (np.maximum(state[0], m.x_bounds[0][:n]), np.minimum(state[1], m.x_bounds[1][:n]))
        least, most = bounds(k.drive, ranges)
        beyond.append(not (np.all(least >= low - slacks[2]) and np.all(most <= high + slacks[2])))
    return beyond[0], beyond[1]


def _ranges(m: Model) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    return {"wanted": m.z_bounds, "z": m.z_bounds, "x": m.x_bounds}
