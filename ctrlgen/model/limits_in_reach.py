"""Which limits a displacement in range can meet, by interval arithmetic over the kernels of a controller."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ctrlgen.model.inverse import Inverse
from ctrlgen.model.model import Model
from ctrlgen.numerics.interval_arithmetic import bounds


def state_in_reach(m: Model, kernels: Iterable[Inverse], slack: np.ndarray) -> bool:
    """Whether a displacement in range can need an actuator state more than `slack` (n_states,) beyond its limits."""
    n = m.n_states
    ranges = {"wanted": m.z_bounds, "z": m.z_bounds, "x": m.x_bounds}
    for k in kernels if n else ():
        low, high = bounds(k.state, ranges)
        if np.any(low < m.x_bounds[0][:n] - slack) or np.any(high > m.x_bounds[1][:n] + slack):
            return True
    return False


def drive_in_reach(m: Model, k: Inverse, slack: np.ndarray) -> bool:
    """Whether a displacement in range can need a drive more than `slack` (n_u,) beyond its limits, over every state."""
    n, (low, high) = m.n_states, m.u_bounds
    ranges = {"wanted": m.z_bounds, "z": m.z_bounds, "x": m.x_bounds}
    if n:
        state = bounds(k.state, ranges)
        ranges["state"] = (np.maximum(state[0], m.x_bounds[0][:n]), np.minimum(state[1], m.x_bounds[1][:n]))
    least, most = bounds(k.drive, ranges)
    return not (np.all(least >= low - slack) and np.all(most <= high + slack))
