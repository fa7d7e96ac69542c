"""A polynomial in place of a smooth function of one number over a range, with a proven bound of its error.

It interpolates at the extrema of a Chebyshev polynomial, the ends of the range among them, where it is exact. On each of `CELLS` cells with
centre c and half width r the error e = f - p is enclosed by its Taylor series: with order n = degree + 1, where p has no n-th derivative,

    |e(c + r s)| <= sum_{k<n} |e^(k)(c)| r^k / k! + max_cell |f^(n)| r^n / n!,      |s| <= 1,

the last maximum by interval arithmetic. Source: L. N. Trefethen, Approximation Theory and Approximation Practice (2013), ch. 2 to 4;
W. Tucker, Validated Numerics (2011).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import comb

import casadi as ca
import numpy as np
from numpy.polynomial import chebyshev, polynomial

from ctrlgen.numerics.batched_evaluation import QuickCall, evaluate
from ctrlgen.numerics.taylor_intervals import taylor_intervals

CELLS = 64  # of the range: the error of degree 12 turns 13 times, five cells a turn
HIGHEST = 12  # degree: beyond it a root and a quotient cost no more
HIGHEST_INVERSE = 16  # degree of an inverse, in place of Newton steps with a root and quotients each
HALVINGS = 54  # of the range, to a root: less than a rounding of its ends is left
REFUTED = 1.01  # of the error asked for: one seen that is larger than so, and than roundings, needs no enclosure
# Between which magnitudes the numbers of Horner's rule are: in single precision (1.2e-38 to 3.4e38) none overflows, and a product with a
# difference that is but a rounding is a normal number
SMALLEST, LARGEST = 1e-30, 1e37
# Of the range of values: terms of powers about zero may add up to this much, or three binary digits are lost
CANCELLED = 8.0


@dataclass(frozen=True)
class ProvenPolynomial:
    """f(v) ~ sum_k coefficients_k ((v - centre) / half)^k on low ... high: off by no more than a change of v by `off` changes f; it
    rises or falls as f does. `flattest` and `steepest`: between which magnitudes the slopes of f are."""

    coefficients: np.ndarray
    centre: float
    half: float
    off: float
    flattest: float
    steepest: float

    def of(self, v: ca.SX) -> ca.SX:
        """The polynomial as an expression of v, by Horner's rule: of v - centre, or where its numbers would be too small or too large for
        single precision, of that in units of half the range, for one more product."""
        s = v - self.centre if self.centre else v
        powers = self.half ** np.arange(len(self.coefficients))
        coefficients, sizes = self.coefficients / powers, np.abs(self.coefficients)
        sums = np.cumsum(sizes[::-1])[::-1] / powers  # no sum of Horner's rule is larger
        if sums.max() > LARGEST or np.any((sizes > 0) & (sizes / powers < SMALLEST)):
            # so and not (v - centre) / half, from whose products with it CasADi would take the factor out, each time anew
            s, coefficients = v * (1 / self.half) - self.centre / self.half, self.coefficients
        value = ca.SX(float(coefficients[-1]))
        for c in coefficients[-2::-1]:
            value = value * s + float(c)
        return value


def proven_polynomial(f: ca.Function, low: float, high: float, share: float) -> ProvenPolynomial | None:
    """The polynomial of lowest degree whose error is at most what a change of v by `share` of the range changes of f at least. None where
    f is not smooth, not monotonic, or needs more than degree `HIGHEST`."""
    half, middle = (high - low) / 2, (high + low) / 2
    radius = half / CELLS
    centres = low + radius * (2 * np.arange(CELLS) + 1)
    over = taylor_intervals(f, centres - radius, centres + radius, radius, HIGHEST + 1)
    at = taylor_intervals(f, centres, centres, radius, HIGHEST)
    slopes = np.stack([over.low[1], over.high[1]])
    if not np.all(np.isfinite(over.low)) or not (np.all(slopes > 0) or np.all(slopes < 0)):
        return None
    steepness, steepest = float(np.abs(slopes).min()) / radius, float(np.abs(slopes).max()) / radius
    for degree in range(1, HIGHEST + 1):
        nodes = -np.cos(np.pi * np.arange(degree + 1) / degree)
        values = np.array([float(f(middle + half * s)) for s in nodes])
        series = chebyshev.cheb2poly(chebyshev.chebfit(nodes, values, degree))
        last = np.maximum(np.abs(over.low[degree + 1]), np.abs(over.high[degree + 1]))
        off = np.abs((at.low + at.high)[: degree + 1] / 2 - _about(series, (centres - middle) / half, radius / half))
        error = float(np.max(off.sum(axis=0) + last))
        turn = (np.arange(degree + 1)[:, None] * off).sum(axis=0) + (degree + 1) * last
        if error <= share * (high - low) * steepness and np.all(turn < np.abs(slopes).min(axis=0)):
            found = ProvenPolynomial(series, middle, half, error / steepness, steepness, steepest)
            return _conditioned(found, low, high, abs(values[-1] - values[0]))
    return None


def is_monotonic(f: ca.Function, low: float, high: float) -> bool:
    """Whether f rises on all of low ... high, or falls, with a slope that is not zero, by interval arithmetic on each of the cells."""
    radius = (high - low) / 2 / CELLS
    centres = low + radius * (2 * np.arange(CELLS) + 1)
    over = taylor_intervals(f, centres - radius, centres + radius, radius, 1)
    return bool(np.all(np.isfinite(over.low)) and (np.all(over.low[1] > 0) or np.all(over.high[1] < 0)))


def proven_inverse(f: ca.Function, low: float, high: float, share: float) -> ProvenPolynomial | None:
    """The polynomial q of lowest degree for which |q(f(v)) - v| <= `share` (high - low) on low ... high, enclosed as above; its `flattest`
    and `steepest` are those of the inverse. None where f is not smooth, not monotonic, or q needs more than degree `HIGHEST_INVERSE`."""
    forward = proven_polynomial(f, low, high, share)
    if forward is None:
        return None
    radius = (high - low) / 2 / CELLS
    centres = low + radius * (2 * np.arange(CELLS) + 1)
    ends = float(f(low)), float(f(high))
    half, middle, v = abs(ends[1] - ends[0]) / 2, sum(ends) / 2, ca.SX.sym("v")
    called, at_centres = QuickCall(f), evaluate(f.map(CELLS), centres)[0].ravel()
    for degree in range(1, HIGHEST_INVERSE + 1):
        nodes = -np.cos(np.pi * np.arange(degree + 1) / degree)
        values = [_root(called, middle + half * s, low, high) for s in nodes]
        series = chebyshev.cheb2poly(chebyshev.chebfit(nodes, values, degree))
        seen = np.abs(polynomial.polyval((at_centres - middle) / half, series) - centres).max()
        if not seen <= REFUTED * share * (high - low):
            continue
        found = ProvenPolynomial(series, middle, half, 0.0, 1 / forward.steepest, 1 / forward.flattest)
        error = ca.Function("e", [v], [found.of(f(v)) - v], {"cse": True})
        over = taylor_intervals(error, centres - radius, centres + radius, radius, degree + 1)
        at = taylor_intervals(error, centres, centres, radius, degree)
        terms = np.maximum(np.abs(at.low), np.abs(at.high)).sum(axis=0)
        off = float(np.max(terms + np.maximum(np.abs(over.low[-1]), np.abs(over.high[-1]))))
        if off <= share * (high - low):  # not where it is no number
            return replace(found, off=off)
    return None


def _root(f: QuickCall, value: float, low: float, high: float) -> float:
    """v in low ... high with f(v) = `value`; an end where rounding leaves none."""
    sides = [f(v)[0] - value for v in (low, high)]
    if sides[0] * sides[1] >= 0:
        return (low, high)[int(abs(sides[1]) < abs(sides[0]))]
    for _ in range(HALVINGS):  # scipy.optimize takes half a second to import
        middle = (low + high) / 2
        low, high = (low, middle) if (f(middle)[0] > value) == (sides[1] > 0) else (middle, high)
    return (low + high) / 2


def _about(series: np.ndarray, centres: np.ndarray, radius: float) -> np.ndarray:
    """(degree + 1, cells) Taylor coefficients of a polynomial about each centre, times the radius to the power."""
    degree = len(series) - 1
    return np.array(
        [
            sum(series[j] * comb(j, k) * centres ** (j - k) for j in range(k, degree + 1)) * radius**k
            for k in range(degree + 1)
        ]
    )


def _conditioned(found: ProvenPolynomial, low: float, high: float, range_of_values: float) -> ProvenPolynomial:
    """The polynomial in powers about zero, which saves a subtraction, where these do not cancel; else about the middle."""
    if low <= 0.0 <= high:
        size = max(-low, high)
        about_middle = np.polynomial.Polynomial(found.coefficients)
        about_zero = about_middle(np.polynomial.Polynomial([-found.centre / found.half, size / found.half])).coef
        if np.abs(about_zero[1:]).sum() <= CANCELLED * range_of_values:
            return replace(found, coefficients=about_zero, centre=0.0, half=size)
    return found
