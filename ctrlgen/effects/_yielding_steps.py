"""Steps of dy/dw = 1 - (b sgn(y) + 1 - b) |y|^n, the law of Bouc and Wen, w > 0 the way since a reversal: no step is too long for them."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np

PARTS = (0.5, 1.0, 2.0)
"""Lengths of the first parts of a step upwards; the last takes what is left, where y is within e^-3.5 of its end."""
LEAST = 1e-9  # below it |y|^n has no slope of n to speak of
FARTHEST = 18.0  # x beyond which 1 - y is rounding, and dx/dw is n
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(6)


def let_go(a: ca.SX, way: ca.SX, c: ca.SX, power: ca.SX) -> tuple[ca.SX, ca.SX]:
    """The way to y = 0 from y = -a, 0 <= a <= 1, and by how much y grows over `way`, no farther: dy/dw = 1 + c |y|^n, c = 2 b - 1.

    The way is the integral of dy/(1 + c |y|^n), by six points of Gauss; the growth by two steps of Runge and Kutta.
    """

    def slope(a: ca.SX) -> ca.SX:
        return -1 - c * ca.fmax(a, LEAST) ** power

    to_zero = -a * sum(float(w) / 2 / slope(a * (1 + float(x)) / 2) for x, w in zip(_NODES, _WEIGHTS, strict=True))
    half, left = ca.fmin(way, to_zero) / 2, a
    for _ in range(2):
        left = _runge_kutta(slope, left, half)
    return to_zero, a - ca.fmax(left, 0)


def taken_up(y: ca.SX, way: ca.SX, power: ca.SX) -> ca.SX:
    """By how much y >= 0 grows over `way`: dy/dw = 1 - y^n, never to 1.

    In x = -ln(1 - y): dx/dw = (1 - y^n)/(1 - y), which goes from 1 to n, and is n for all longer ways.
    """

    def slope(x: ca.SX) -> ca.SX:
        left = ca.exp(-ca.fmin(x, FARTHEST))
        return (1 - ca.fmax(1 - left, LEAST) ** power) / left

    below = ca.fmin(y, 1 - LEAST)
    x, rest = -ca.log(1 - below), way
    for part in PARTS:
        step = ca.fmin(rest, part)
        x, rest = _runge_kutta(slope, x, step), rest - step
    return 1 - ca.exp(-_runge_kutta(slope, x, rest)) - below


def _runge_kutta(slope: Callable[[ca.SX], ca.SX], x: ca.SX, h: ca.SX) -> ca.SX:
    k1 = slope(x)
    k2 = slope(x + h / 2 * k1)
    k3 = slope(x + h / 2 * k2)
    k4 = slope(x + h * k3)
    return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
