"""Where a motion turns between two samples: what a law of play or friction remembers, and the samples miss."""

from __future__ import annotations

from types import SimpleNamespace

import casadi as ca
import numpy as np


def turned_at(s: SimpleNamespace, before: ca.SX, velocity_before: ca.SX) -> ca.SX:
    """The displacement at which the motion turned since the sample before; the present one where it did not turn.

    With the velocity straight from v_0 to v_1 over h: d* = d_0 + h v_0^2/(2 (v_0 - v_1)), and the same from the end; the
    mean of both. Where the velocity or the time between samples is not known, the samples are all there is.
    """
    if s.velocity is None or not s.sample_time or not np.isfinite(s.sample_time):
        return s.displacement
    v_0, v_1, h = velocity_before, s.velocity, s.sample_time
    turns = v_0 * v_1 < 0
    slowing = ca.if_else(turns, v_0 - v_1, 1.0)
    between = (before + s.displacement + h * (v_0**2 + v_1**2) / (2 * slowing)) / 2
    return ca.if_else(turns, between, s.displacement)
