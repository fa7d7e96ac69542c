"""Newton's method, written out and iterated."""

from __future__ import annotations

from itertools import pairwise

import casadi as ca
import numpy as np
import pytest

from ctrlgen.numerics.newton import ImplicitRoots, newton_root, newton_solver

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


def test_roots_of_equations_are_differentiated_where_they_are_and_not_on_the_way_there():
    """Of two roots, the second of which follows from the first: x'(k) = -A^-1 (1, 1) at k = 1, where the squares vanish. After one step
    from (1.3, 2.2) the root is 5 % off, and so would a derivative be that is taken through the step."""
    k, roots = ca.SX.sym("k"), ImplicitRoots()
    x, y = ca.SX.sym("x", 2), ca.SX.sym("y")
    first = roots(coupled(x, k), x, ca.SX([1.3, 2.2]), 5)
    second = roots(y**3 + y - first[0] * k - 1, y, ca.SX(1.5), 6)
    value, slope = roots.inserted([ca.vertcat(first, second), ca.jacobian(ca.vertcat(first, second), k)])
    found, by_k = (v.full().ravel() for v in ca.Function("f", [k], [value, slope])(1.0))
    by_k_of_x = -np.linalg.solve(A, [1.0, 1.0])
    assert found == pytest.approx([1.0, 2.0, 1.0], rel=1e-13)
    assert by_k == pytest.approx([*by_k_of_x, (by_k_of_x[0] + 1.0) / 4], rel=1e-12)


def test_derivatives_of_a_root_take_no_more_operations_for_more_steps_than_the_steps_do():
    k, x = ca.SX.sym("k", 2), ca.SX.sym("x", 2)

    def operations(steps: int) -> int:
        roots = ImplicitRoots()
        z = roots(coupled(x, k) * ca.exp(x), x, ca.SX([1.3, 2.2]), steps)
        return ca.Function("J", [k], roots.inserted([ca.jacobian(z, k)])).n_instructions()

    def of_steps(steps: int) -> int:
        return ca.Function(
            "z", [k], [newton_root(coupled(x, k) * ca.exp(x), x, ca.SX([1.3, 2.2]), steps)]
        ).n_instructions()

    assert operations(8) - operations(4) == pytest.approx(of_steps(8) - of_steps(4), rel=0.05)
