"""Newton's method, written out and iterated."""

from __future__ import annotations

from itertools import pairwise

import casadi as ca
import numpy as np
import pytest

from ctrlgen.numerics.newton import newton_root, newton_solver

A = np.array([[2.0, 0.3], [-0.5, 1.5]])


def coupled(x: ca.SX, k: ca.SX | float) -> ca.SX:
    """Two equations with the root (1, 2) for k = 1."""
    root = ca.DM([1.0, 2.0])
    return ca.mtimes(ca.DM(A), x - root) + (x - root) ** 2 + (k - 1.0)


def errors(equations, start, root) -> list[float]:
    x = ca.SX.sym("x", len(start))
    return [
        float(ca.norm_inf(ca.evalf(newton_root(equations(x), x, ca.SX(start), steps)) - root)) for steps in range(5)
    ]


@pytest.mark.parametrize(
    ("equations", "start", "root"),
    [
        (lambda x: x**2 - ca.vertcat(2.0, 9.0), [1.6, 3.5], [2**0.5, 3.0]),  # a diagonal slope
        (lambda x: coupled(x, 1.0), [1.3, 2.2], [1.0, 2.0]),
    ],
    ids=["alone", "coupled"],
)
def test_each_step_squares_the_error(equations, start, root):
    found = errors(equations, start, root)
    assert found[0] == pytest.approx(np.abs(np.subtract(start, root)).max())
    for before, after in pairwise(found):
        assert after < max(before**2, 1e-15)  # half the second derivative over the slope is below 1 in both


def test_one_step_solves_what_is_linear_to_rounding():
    x = ca.SX.sym("x", 2)
    root = ca.evalf(newton_root(ca.mtimes(ca.DM(A), x) - ca.DM([1.0, 2.0]), x, ca.SX([7.0, -5.0]), 1)).full().ravel()
    assert root == pytest.approx(np.linalg.solve(A, [1.0, 2.0]), rel=1e-14)


def test_states_that_do_not_act_on_one_another_are_divided_and_not_eliminated():
    """A generated firmware has n divisions then."""
    a, x = ca.SX.sym("a", 3), ca.SX.sym("x", 3)
    root = ca.Function("root", [a, x], [newton_root(a * x - 1, x, x, 1)])
    operations = [root.instruction_id(i) for i in range(root.n_instructions())]
    assert operations.count(ca.OP_DIV) == 3
    assert root([2, 4, 5], [7, 7, 7]).full().ravel() == pytest.approx([0.5, 0.25, 0.2], rel=1e-14)


def test_the_iterated_solver_finds_the_root_of_each_parameter_and_refuses_where_there_is_none():
    x, k = ca.SX.sym("x", 2), ca.SX.sym("k")
    solver = newton_solver("coupled", coupled(x, k), x, k, most_steps=20)
    for number in (0.7, 1.0, 1.2):
        found = solver([1.3, 2.2], number)
        assert float(ca.norm_inf(ca.evalf(coupled(found, number)))) < 1e-13
    with pytest.raises(RuntimeError):
        solver([1.3, 2.2], 5.0)  # a parabola that stays above zero
