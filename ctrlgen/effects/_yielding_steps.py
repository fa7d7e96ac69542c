"""Steps of dy/dw = 1 - (b sgn(y) + 1 - b) |y|^n, the law of Bouc and Wen, w > 0 the way since a reversal: no step is too long for them."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np

SHARES = (1 / 6, 1 / 3, 1 / 2)  # of the way to zero: the slope changes most at first, where y is large
PARTS = (
    0.35,
    0.3,
    0.5,
)  # lengths of the first parts of a step upwards; the last takes what is left, where the slope is nearly n
LEAST = 1e-9  # below it |y|^n has no slope of n to speak of, and 1 - y is counted no smaller
FARTHEST = 18.0  # x beyond which 1 - y is rounding, and dx/dw is n
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(6)


def let_go(a: ca.SX, way: ca.SX, c: ca.SX, power: ca.SX) -> tuple[ca.SX, ca.SX]:
    """The way to y = 0 from y = -a, 0 <= a <= 1, and by how much y grows over `way`, no farther: dy/dw = 1 + c |y|^n, c = 2 b - 1.

    The way is the integral of dy/(1 + c |y|^n), by six points of Gauss; the growth by three steps of Runge and Kutta, to
    0.1 % for n up to 5.
    """

    def slope(a: ca.SX) -> ca.SX:
        return -1 - c * ca.fmax(a, LEAST) ** power

    to_zero = -a * sum(float(w) / 2 / slope(a * (1 + float(x)) / 2) for x, w in zip(_NODES, _WEIGHTS, strict=True))
    back, left = ca.fmin(way, to_zero), a
    for share in SHARES:
        left = _runge_kutta(slope, left, share * back)
    return to_zero, a - ca.fmax(left, 0)


def taken_up(y: ca.SX, way: ca.SX, power: ca.SX) -> ca.SX:
    """By how much y >= 0 grows over `way`: dy/dw = 1 - y^n, toward 1, from where a record may begin beyond it too.

    In x = -ln(1 - y): dx/dw = (1 - y^n)/(1 - y), which goes from 1 to n, and is n for all longer ways and beyond 1. To 0.1 % for n up to 5.
    """

    def slope(x: ca.SX) -> ca.SX:
        left = ca.exp(-ca.fmin(x, FARTHEST))
        return (1 - ca.fmax(1 - left, LEAST) ** power) / left

    begun = -ca.log(ca.fmax(1 - y, LEAST))
    x, rest = begun, way
    for part in PARTS:
        step = ca.fmin(rest, part)
        x, rest = _runge_kutta(slope, x, step), rest - step
    return (1 - y) * (1 - ca.exp(begun - _runge_kutta(slope, x, rest)))


def _runge_kutta(slope: Callable[[ca.SX], ca.SX], x: ca.SX, h: ca.SX) -> ca.SX:
    k1 = slope(x)
    k2 = slope(x + h / 2 * k1)
    k3 = slope(x + h / 2 * k2)
    k4 = slope(x + h * k3)
    return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
