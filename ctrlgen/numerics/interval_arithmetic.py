"""Bounds of every operation of a CasADi function over ranges of its arguments, by interval arithmetic.

They are rigorous up to rounding, and as wide as naive interval arithmetic makes them; an operation without a rule and a
division by an interval that contains zero give (-inf, inf). Source: R. E. Moore, Interval Analysis (1966).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import product

import casadi as ca
import numpy as np

Interval = tuple[float, float]
UNBOUNDED: Interval = (-np.inf, np.inf)
LARGEST_EXPONENT = 700.0  # exp of more overflows in double precision


def _hull(values: list[float]) -> Interval:
    """The smallest interval that holds `values`; 0 * inf counts as 0, for an infinite bound is never attained."""
    numbers = [0.0 if np.isnan(v) else v for v in values]
    return min(numbers), max(numbers)


def product_of(a: Interval, b: Interval) -> Interval:
    """The interval of x y for x in a, y in b."""
    return _hull([x * y for x, y in product(a, b)])


def _square(a: Interval) -> Interval:
    low, high = sorted(abs(v) for v in a)
    return (0.0 if a[0] <= 0.0 <= a[1] else low * low), high * high


def quotient_of(a: Interval, b: Interval) -> Interval:
    """The interval of x / y for x in a, y in b; unbounded where b contains zero."""
    return UNBOUNDED if b[0] <= 0.0 <= b[1] else product_of(a, (1.0 / b[1], 1.0 / b[0]))


def _magnitude(a: Interval) -> Interval:
    low, high = sorted(abs(v) for v in a)
    return (0.0 if a[0] <= 0.0 <= a[1] else low), high


_RULES: dict[int, Callable[..., Interval]] = {
    ca.OP_ASSIGN: lambda a: a,
    ca.OP_ADD: lambda a, b: (a[0] + b[0], a[1] + b[1]),
    ca.OP_SUB: lambda a, b: (a[0] - b[1], a[1] - b[0]),
    ca.OP_MUL: product_of,
    ca.OP_DIV: quotient_of,
    ca.OP_NEG: lambda a: (-a[1], -a[0]),
    ca.OP_SQ: _square,
    ca.OP_TWICE: lambda a: (2 * a[0], 2 * a[1]),
    ca.OP_INV: lambda a: quotient_of((1.0, 1.0), a),
    ca.OP_SQRT: lambda a: (float(np.sqrt(max(a[0], 0.0))), float(np.sqrt(max(a[1], 0.0)))),
    ca.OP_FABS: _magnitude,
    ca.OP_FMIN: lambda a, b: (min(a[0], b[0]), min(a[1], b[1])),
    ca.OP_FMAX: lambda a, b: (max(a[0], b[0]), max(a[1], b[1])),
    ca.OP_EXP: lambda a: (float(np.exp(min(a[0], LARGEST_EXPONENT))), float(np.exp(min(a[1], LARGEST_EXPONENT)))),
    ca.OP_TANH: lambda a: (float(np.tanh(a[0])), float(np.tanh(a[1]))),
    ca.OP_SIN: lambda a: (-1.0, 1.0),
    ca.OP_COS: lambda a: (-1.0, 1.0),
    ca.OP_SIGN: lambda a: (-1.0, 1.0),
    ca.OP_IF_ELSE_ZERO: lambda a, b: (min(b[0], 0.0), max(b[1], 0.0)),
    **dict.fromkeys((ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_AND, ca.OP_OR), lambda a, b: (0.0, 1.0)),
    ca.OP_NOT: lambda a: (0.0, 1.0),
}


def interval_of(operation: int, operands: Sequence[Interval]) -> Interval:
    """The interval of one CasADi `operation` (such as `ca.OP_ADD`) on operands that lie in those given."""
    rule: Callable[..., Interval] = _RULES.get(operation, lambda *_: UNBOUNDED)
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        value = rule(*operands)
    return UNBOUNDED if np.isnan(value).any() else value


def intervals(function: ca.Function, ranges: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> list[Interval]:
    """The interval of every instruction of an SX `function`, in their order.

    `ranges`: argument (a dense column) by its name -> lower and upper bounds; arguments that are not named are unbounded.
    """
    at: dict[int, Interval] = {}  # by slot of CasADi's work vector
    values = []
    for k in range(function.n_instructions()):
        op, inputs, outputs = function.instruction_id(k), function.instruction_input(k), function.instruction_output(k)
        if op == ca.OP_INPUT:
            given = ranges.get(function.name_in(inputs[0]))
            row = function.sparsity_in(inputs[0]).row()[inputs[1]]
            value = UNBOUNDED if given is None else (float(given[0][row]), float(given[1][row]))
        elif op == ca.OP_OUTPUT:
            value = at[inputs[0]]
        elif op == ca.OP_CONST:
            value = (function.instruction_constant(k),) * 2
        else:
            value = interval_of(op, [at[i] for i in inputs])
        values.append(value)
        if op != ca.OP_OUTPUT:
            at[outputs[0]] = value
    return values


def bounds(function: ca.Function, ranges: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper bounds (n,) of the only result of `function`; `ranges` as for `intervals`."""
    low = high = np.zeros(function.size1_out(0))
    low, high = low.copy(), high.copy()
    for k, value in enumerate(intervals(function, ranges)):
        if function.instruction_id(k) == ca.OP_OUTPUT:
            row = function.sparsity_out(0).row()[function.instruction_output(k)[1]]
            low[row], high[row] = value
    return low, high
