"""Functions at very many points by NumPy: CasADi's own virtual machine gives the same."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from ctrlgen.numerics import columnwise
from ctrlgen.numerics.columnwise import MOST, OPERATIONS, ColumnWise

ROUNDING = 4e-16  # relative: elementary functions of two libraries
UNARY = (
    ca.OP_ASSIGN,
    ca.OP_NEG,
    ca.OP_SQ,
    ca.OP_TWICE,
    ca.OP_INV,
    ca.OP_SQRT,
    ca.OP_EXP,
    ca.OP_LOG,
    ca.OP_LOG1P,
    ca.OP_EXPM1,
    ca.OP_SIN,
    ca.OP_COS,
    ca.OP_TAN,
    ca.OP_ASIN,
    ca.OP_ACOS,
    ca.OP_ATAN,
    ca.OP_SINH,
    ca.OP_COSH,
    ca.OP_TANH,
    ca.OP_ASINH,
    ca.OP_ACOSH,
    ca.OP_ATANH,
    ca.OP_ERF,
    ca.OP_ERFINV,
    ca.OP_FABS,
    ca.OP_SIGN,
    ca.OP_FLOOR,
    ca.OP_CEIL,
    ca.OP_NOT,
)


def applied(op: int, a: ca.SX, b: ca.SX) -> ca.SX:
    """One operation; what CasADi's constructors simplify is avoided by symbols."""
    return ca.SX.unary(op, a) if op in UNARY else ca.SX.binary(op, a, b)


@pytest.mark.parametrize("op", sorted(OPERATIONS))
def test_every_operation_gives_what_casadi_gives_for_numbers_zeros_and_what_is_none(op):
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    function = ca.Function("f", [ca.vertcat(a, b)], [applied(op, a, b)])
    rng = np.random.default_rng(op)
    odd = [0.0, 1.0, -1.0, 2.5, -2.5, np.nan]
    given = np.hstack(
        [np.array(np.meshgrid(odd, odd)).reshape(2, -1), rng.uniform(-2, 2, (2, 40)), rng.uniform(0, 1, (2, 40))]
    )
    wanted = function.map(given.shape[1])(given).full()
    found = ColumnWise(function)(given)
    assert np.array_equal(np.isnan(found), np.isnan(wanted))
    # erfinv of CasADi is an approximation to six digits
    np.testing.assert_allclose(found, wanted, rtol=1e-5 if op == ca.OP_ERFINV else 2 * ROUNDING, atol=0, equal_nan=True)


def test_several_blocks_with_a_part_at_the_end_are_one_result(monkeypatch):
    x, y = ca.SX.sym("x", 3), ca.SX.sym("y", 2)
    function = ca.Function(
        "f", [x, y], [ca.vertcat(ca.mtimes(x.T, x) * y[0], ca.sin(x) / y[1], 7.0, ca.if_else(x[0] > y[0], x[1], y[1]))]
    )
    rng = np.random.default_rng(2)
    given = rng.normal(size=(3, 2 * MOST + 5)), rng.normal(size=(2, 2 * MOST + 5))
    wanted = function.map(given[0].shape[1])(*given).full()
    np.testing.assert_allclose(ColumnWise(function)(*given), wanted, rtol=1e-15)
    monkeypatch.setattr(columnwise, "MEMORY", 0)  # as of a function of very many operations
    assert ColumnWise(function).block == columnwise.FEWEST
    np.testing.assert_allclose(ColumnWise(function)(*given), wanted, rtol=1e-15)


def test_a_function_without_rows_gives_none():
    x = ca.SX.sym("x", 3)
    assert ColumnWise(ca.Function("f", [x], [ca.SX(0, 1)]))(np.zeros((3, 9))).shape == (0, 9)
