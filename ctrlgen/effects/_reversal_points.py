"""The displacement at which a motion reverses between two samples, which laws with memory need and samples miss."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ctrlgen.effects._law_inputs import LawInputs


def reversal_point(s: LawInputs, before: ca.SX, velocity_before: ca.SX) -> ca.SX:
    """The displacement at which the motion reversed since the last sample; the present displacement where it did not.

    For a velocity that changes linearly from v_0 to v_1 within h: d* = d_0 + h v_0^2/(2 (v_0 - v_1)), the mean of this from
    either end. Without a velocity or a sample time, it is the present displacement.
    """
    if s.velocity is None or not s.sample_time or not np.isfinite(s.sample_time):
        return s.displacement
    v_0, v_1, h = velocity_before, s.velocity, s.sample_time
    turns = v_0 * v_1 < 0
    slowing = ca.if_else(turns, v_0 - v_1, 1.0)
    between = (before + s.displacement + h * (v_0**2 + v_1**2) / (2 * slowing)) / 2
    return ca.if_else(turns, between, s.displacement)
