"""The paper's laws and error measure, written from S1 alone, to hold the models of this folder against."""

from __future__ import annotations

from typing import Any

import numpy as np

from plants.frame import Array


def linear_force(d: Array, s: Any, K_t14: float) -> Array:
    """F^l = (K^t(1,4)/r + r N/(c e_4^2)) d [N], r = e_4/e_3, N notches of c = theta_z/M_z. S1 eq. (9)."""
    r = s.lever_long / s.lever_short
    return (K_t14 / r + r * s.notches / (s.notch.theta_z_per_M_z * s.lever_long**2)) * np.asarray(d)


def nonlinear_force(d: Array, s: Any, K_t14: float) -> Array:
    """F = F^l + 2 r k_a sin(phi) cos(phi) (e_4 - sqrt(e_4^2 - d^2)) [N], sin(phi) = d/e_4. S1 eq. (10)-(12)."""
    d = np.asarray(d)
    r, long = s.lever_long / s.lever_short, s.lever_long
    root = np.sqrt(long**2 - d**2)
    return linear_force(d, s, K_t14) + 2 * r * s.half_stage_stiffness * d * root / long**2 * (long - root)


def error(analytical: Array, truth: Array) -> Array:
    """|analytical - truth| / |truth| x 100 % [%]. S1 eq. (20)."""
    return np.abs((np.asarray(analytical) - truth) / truth) * 100
