"""An SX function at very many points: each of its operations by NumPy, for a block of points at a time.

CasADi's virtual machine takes one point after the other and some nanoseconds for each operation; NumPy's loops take a block of points
through an operation with the processor's vector instructions, several times as fast, and nothing is compiled before. Results are those of
CasADi to the rounding of elementary functions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import casadi as ca
import numpy as np
from scipy import special

MEMORY = 2**26  # bytes of a block's intermediate results, at most
# Points of a block: with fewer the calls take longer than what they compute, and more gain nothing
FEWEST, MOST = (
    64,
    2048,
)


def _assign(a: Any, out: np.ndarray) -> None:
    np.copyto(out, a)


def _if_else_zero(condition: Any, value: Any, out: np.ndarray) -> None:
    np.copyto(out, np.where(condition, value, 0.0))


# Each takes its operands and where the result is to stand
OPERATIONS: Mapping[int, Callable[..., Any]] = {
    ca.OP_ASSIGN: _assign,
    ca.OP_ADD: np.add,
    ca.OP_SUB: np.subtract,
    ca.OP_MUL: np.multiply,
    ca.OP_DIV: np.divide,
    ca.OP_NEG: np.negative,
    ca.OP_SQ: np.square,
    ca.OP_TWICE: lambda a, out: np.add(a, a, out),
    ca.OP_INV: np.reciprocal,
    ca.OP_SQRT: np.sqrt,
    ca.OP_EXP: np.exp,
    ca.OP_LOG: np.log,
    ca.OP_LOG1P: np.log1p,
    ca.OP_EXPM1: np.expm1,
    ca.OP_POW: np.power,
    ca.OP_CONSTPOW: np.power,
    ca.OP_HYPOT: np.hypot,
    ca.OP_SIN: np.sin,
    ca.OP_COS: np.cos,
    ca.OP_TAN: np.tan,
    ca.OP_ASIN: np.arcsin,
    ca.OP_ACOS: np.arccos,
    ca.OP_ATAN: np.arctan,
    ca.OP_ATAN2: np.arctan2,
    ca.OP_SINH: np.sinh,
    ca.OP_COSH: np.cosh,
    ca.OP_TANH: np.tanh,
    ca.OP_ASINH: np.arcsinh,
    ca.OP_ACOSH: np.arccosh,
    ca.OP_ATANH: np.arctanh,
    ca.OP_ERF: special.erf,
    ca.OP_ERFINV: special.erfinv,
    ca.OP_FMIN: np.fmin,
    ca.OP_FMAX: np.fmax,
    ca.OP_FABS: np.abs,
    ca.OP_SIGN: np.sign,
    ca.OP_COPYSIGN: np.copysign,
    ca.OP_FMOD: np.fmod,
    ca.OP_REMAINDER: lambda a, b, out: np.subtract(a, b * np.rint(a / b), out),
    ca.OP_FLOOR: np.floor,
    ca.OP_CEIL: np.ceil,
    ca.OP_LT: np.less,
    ca.OP_LE: np.less_equal,
    ca.OP_EQ: np.equal,
    ca.OP_NE: np.not_equal,
    ca.OP_NOT: np.logical_not,
    ca.OP_AND: np.logical_and,
    ca.OP_OR: np.logical_or,
    ca.OP_IF_ELSE_ZERO: _if_else_zero,
}


class ColumnWise:
    """`function`, of dense columns and with one dense column as its result, at the columns of its arguments."""

    def __init__(self, function: ca.Function) -> None:
        self.rows = function.size1_out(0)
        self.block = int(np.clip(MEMORY / (8 * max(function.sz_w(), 1)), FEWEST, MOST))
        self._given = [np.zeros((function.size1_in(i), self.block)) for i in range(function.n_in())]
        self._result = np.zeros((self.rows, self.block))
        self._steps = list(self._instructions(function))

    def _instructions(self, function: ca.Function) -> list[tuple[Callable[..., Any], tuple[Any, ...]]]:
        """NumPy's functions in their order, with the arrays that each reads and writes."""
        at: dict[int, Any] = {}  # by slot of CasADi's work vector: an array, or a number
        buffers: dict[int, np.ndarray] = {}
        steps = list[tuple[Callable[..., Any], tuple[Any, ...]]]()
        for k in range(function.n_instructions()):
            op, inputs, outputs = (
                function.instruction_id(k),
                function.instruction_input(k),
                function.instruction_output(k),
            )
            if op == ca.OP_CONST:
                at[outputs[0]] = function.instruction_constant(k)
            elif op == ca.OP_INPUT:
                at[outputs[0]] = self._given[inputs[0]][inputs[1]]
            elif op == ca.OP_OUTPUT:
                steps.append((_assign, (at[inputs[0]], self._result[outputs[1]])))
            else:
                out = buffers.setdefault(outputs[0], np.zeros(self.block))
                steps.append((OPERATIONS[op], (*(at[i] for i in inputs), out)))
                at[outputs[0]] = out
        return steps

    def __call__(self, *given: np.ndarray) -> np.ndarray:
        """(rows, n) from arguments (rows of each, n)."""
        n = given[0].shape[1]
        result = np.empty((self.rows, n))
        with np.errstate(all="ignore"):  # what is no number is found in the result
            for a in range(0, n, self.block):
                b = min(a + self.block, n)
                for values, argument in zip(self._given, given, strict=True):
                    values[:, : b - a] = argument[:, a:b]
                for operation, arrays in self._steps:
                    operation(*arrays)
                result[:, a:b] = self._result[:, : b - a]
        return result
