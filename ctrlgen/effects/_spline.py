"""Smooth functions of one signal with free values: the empirical laws share them."""

from __future__ import annotations

import casadi as ca

from ctrlgen.effects._law_inputs import LawNumbers
from ctrlgen.effects._parameter import Param

KNOTS = 17  # bends as short as a tenth of the range
WEIGHTS = tuple(f"c{j}" for j in range(1, KNOTS + 1))


def weight_params(doc: str) -> tuple[Param, ...]:
    """c_1 ... c_17, of the order of one."""
    return tuple(Param(name, "1", (-100.0, 100.0), doc) for name in WEIGHTS)


def cubic_spline(share: ca.SX, p: LawNumbers) -> ca.SX:
    """sum_j c_j B(14 t - j + 2), j = 1..17, t = `share` of the way through a range, held beyond its ends; B the uniform cubic B-spline.

    B(x) = (max(2 - |x|, 0)^3 - 4 max(1 - |x|, 0)^3)/6. Source: C. de Boor, A Practical Guide to Splines (1978).
    """
    place = (KNOTS - 3) * ca.fmin(ca.fmax(share, 0.0), 1.0)
    return sum(getattr(p, name) * _basis(place - j) for j, name in enumerate(WEIGHTS, start=-1))


def _basis(x: ca.SX) -> ca.SX:
    near = ca.fabs(x)
    return (ca.fmax(2 - near, 0.0) ** 3 - 4 * ca.fmax(1 - near, 0.0) ** 3) / 6
