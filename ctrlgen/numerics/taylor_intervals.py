"""Taylor coefficients of a function of one variable, enclosed by intervals over cells of its range: automatic differentiation in interval
arithmetic. Rigorous up to rounding. Source: R. E. Moore, Interval Analysis (1966), ch. 11; W. Tucker, Validated Numerics (2011), ch. 4."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np


@dataclass(frozen=True)
class Jet:
    """Low and high (order + 1, cells) of the coefficients f^(k) r^k / k! on cells of half width r."""

    low: np.ndarray
    high: np.ndarray

    def __getitem__(self, k: int) -> Jet:
        return Jet(self.low[k], self.high[k])

    def __add__(self, other: Jet) -> Jet:
        return Jet(self.low + other.low, self.high + other.high)

    def __neg__(self) -> Jet:
        return Jet(-self.high, -self.low)

    def __mul__(self, other: Jet) -> Jet:
        """The product of two numbers, not of two series."""
        products = [a * b for a in (self.low, self.high) for b in (other.low, other.high)]
        return Jet(np.minimum.reduce(products), np.maximum.reduce(products))

    def over(self, other: Jet) -> Jet:
        """The quotient of two numbers; unbounded where the divisor may be zero."""
        zero = (other.low <= 0.0) & (other.high >= 0.0)
        low, high = (np.where(zero, np.nan, bound) for bound in (other.low, other.high))
        return self * Jet(1.0 / high, 1.0 / low)


def _stacked(parts: list[Jet]) -> Jet:
    return Jet(np.stack([part.low for part in parts]), np.stack([part.high for part in parts]))


def _times(a: Jet, b: Jet) -> Jet:
    return _stacked([_convolved(a, b, k, 0, k) for k in range(len(a.low))])


def _convolved(a: Jet, b: Jet, k: int, first: int, last: int) -> Jet:
    """sum_j a_j b_{k-j}, j = first ... last."""
    products = Jet(a.low[first : last + 1], a.high[first : last + 1]) * Jet(
        b.low[k - last : k - first + 1][::-1], b.high[k - last : k - first + 1][::-1]
    )
    return Jet(products.low.sum(axis=0), products.high.sum(axis=0))


def _divided(a: Jet, b: Jet) -> Jet:
    found: list[Jet] = []
    for k in range(len(a.low)):
        known = _stacked(found) if found else a
        found.append((a[k] + -_convolved(b, known, k, 1, k)).over(b[0]))
    return _stacked(found)


def _root(a: Jet) -> Jet:
    with np.errstate(invalid="ignore"):
        found = [Jet(np.sqrt(a.low[0]), np.sqrt(a.high[0]))]
    for k in range(1, len(a.low)):
        known = _stacked(found)
        found.append((a[k] + -_convolved(known, known, k, 1, k - 1)).over(found[0] + found[0]))
    return _stacked(found)


def _exponential(a: Jet) -> Jet:
    found = [Jet(np.exp(a.low[0]), np.exp(a.high[0]))]
    weights = np.arange(len(a.low))[:, None]
    slope = Jet(weights * a.low, weights * a.high)
    for k in range(1, len(a.low)):
        total = _convolved(slope, _stacked(found), k, 1, k)
        found.append(Jet(total.low / k, total.high / k))
    return _stacked(found)


def _larger(a: Jet, b: Jet) -> Jet:
    """The larger of two series where one is it on the whole cell, else NaN."""
    first, second = a.low[0] >= b.high[0], b.low[0] >= a.high[0]
    low, high = (np.where(first, p, np.where(second, q, np.nan)) for p, q in ((a.low, b.low), (a.high, b.high)))
    return Jet(low, high)


RULES: dict[int, Callable[..., Jet]] = {
    ca.OP_ASSIGN: lambda a: a,
    ca.OP_ADD: lambda a, b: a + b,
    ca.OP_SUB: lambda a, b: a + -b,
    ca.OP_NEG: lambda a: -a,
    ca.OP_MUL: _times,
    ca.OP_SQ: lambda a: _times(a, a),
    ca.OP_TWICE: lambda a: a + a,
    ca.OP_DIV: _divided,
    ca.OP_INV: lambda a: _divided(_constant(1.0, a), a),
    ca.OP_SQRT: _root,
    ca.OP_EXP: _exponential,
    ca.OP_FMAX: _larger,
    ca.OP_FMIN: lambda a, b: -_larger(-a, -b),
}


def _constant(value: float, like: Jet) -> Jet:
    series = np.zeros_like(like.low)
    series[0] = value
    return Jet(series, series)


def taylor_intervals(function: ca.Function, low: np.ndarray, high: np.ndarray, radius: float, order: int) -> Jet:
    """The coefficients up to `order` of an SX `function` of one number on cells low ... high (cells,): k-th derivatives anywhere in the
    cell times r^k / k!, with r the `radius`. NaN where an operation has no rule or is not smooth."""
    ends = np.zeros((order + 1, len(low))), np.zeros((order + 1, len(low)))
    ends[0][0], ends[1][0] = low, high
    if order:
        ends[0][1] = ends[1][1] = radius
    at: dict[int, Jet] = {}
    result = argument = Jet(*ends)
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        for k in range(function.n_instructions()):
            op, inputs, outputs = (
                function.instruction_id(k),
                function.instruction_input(k),
                function.instruction_output(k),
            )
            if op == ca.OP_INPUT:
                at[outputs[0]] = argument
            elif op == ca.OP_OUTPUT:
                result = at[inputs[0]]
            elif op == ca.OP_CONST:
                at[outputs[0]] = _constant(function.instruction_constant(k), argument)
            elif op in RULES:
                at[outputs[0]] = RULES[op](*(at[i] for i in inputs))
            else:
                at[outputs[0]] = _constant(np.nan, argument)
    return result
