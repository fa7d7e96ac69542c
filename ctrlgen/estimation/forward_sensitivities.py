"""Forward sensitivities of one sample: the state and its derivatives by m parameters, one sample on.

D+ = F_S D + F_c dc/dp,  dy/dp = H_S D + H_c dc/dp,  D = dS/dp. They are kept transposed, T = D' (m, n_s), a row a parameter,
because CasADi multiplies by a sparse matrix along columns.

A model in balance is differentiated as a whole. A model with inertia takes one or more integrator steps a sample, and T is
propagated from point to point of each: a step is linear but for the nonlinear rates N, so it needs only constant matrices and the
derivatives of N at the points where the step evaluates it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import casadi as ca
import numpy as np

from ctrlgen.estimation.sample_equations import SampleEquations
from ctrlgen.model.integrators import ExponentialRungeKutta, ImplicitRadau
from ctrlgen.numerics.right_division import over

# at which a step of ETD-RK4 evaluates N
POINTS = 4
# Operations up to which a step is written out number by number: 7,500 of them, of friction beside the nine lags of a creep, take half
# the time of products of matrices, and gcc 12 0.6 s once. Judgement: a longer step is compiled for longer than it runs.
LONGEST_WRITTEN = 10_000
# The same of a whole sample in balance, whose derivatives are mostly its own operations: 14,000 of them, of plays before creep, take
# two thirds of the time, and the compiler no longer.
LONGEST_SAMPLE = 20_000
# Operations of a value from which on its derivatives are taken in both directions: of a shorter one they are few in either. Judgement.
LONG = 100
REVERSE = {"helper_options": {"ad_weight": 1.0, "ad_weight_sp": 1.0}}

Jacobian = Callable[[ca.SX, ca.SX], ca.SX]
Step = Callable[[ca.MX, ca.MX, list[ca.MX]], tuple[ca.MX, ca.MX]]
"""(T, seed, [Y, u, u at the end of the step, held values, ambient, c]) -> Y and T one step on. Y = (x, z) as in
`ctrlgen.model.integrators`; `seed` is the transposed derivative of what is constant within the sample."""


def forward_sensitivities(
    equations: SampleEquations, T: ca.MX, seed: ca.MX, given: list[ca.MX]
) -> tuple[ca.MX, ca.MX, ca.MX, ca.MX]:
    """S and T one sample on, the readings (n_y,) and their derivatives (m, n_y).

    `T` (m, n_s) is (dS/dp)', `seed` (m, n_c) is (dc/dp)', `given` are the values of `equations.given`.
    """
    symbols = [equations.given[0], equations.given[4]] if seed.nnz() else equations.given[:1]

    def chain(*derivatives: ca.MX) -> ca.MX:
        """(d value/dp)' from the transposed derivatives by S and, where there is a seed, by c."""
        return sum((V @ derivative for V, derivative in zip((T, seed), derivatives, strict=False)))

    if equations.steps is None:
        values = [equations.following, equations.y]
        transposed = _transposed_jacobians(values, symbols, jacobian_of(equations))
        # some dozens of poses are evaluated faster than what is common to two expressions is found: 0.2 s of 17,000 operations
        one = equations.one("one", [*values, *transposed], {"cse": not equations.poses})
        following, y, *by = one(*given)
        return following, chain(*by[: len(symbols)]), y, chain(*by[len(symbols) :])
    m = equations.model
    # once a sample, at its beginning
    once = [equations.y, m.held_value, ca.vertcat(ca.SX(0, 1), *m.stepped.values())]
    first = ca.Function(
        "first", equations.given, [*once, *_transposed_jacobians(once, symbols, shortest_jacobian)], {"cse": True}
    )
    y, held, stepped, *by = first(*given)
    Y, of_held, of_stepped = (chain(*by[i * len(symbols) : (i + 1) * len(symbols)]) for i in range(3))
    constant = ca.horzcat(of_held, seed) if seed.nnz() else of_held
    following, T = _all_steps(equations, T, constant, given, held)
    if m.stepped:
        places = list(m.stepped)
        following[places], T[:, places] = stepped, of_stepped
    return following, T, y, Y


def reached_entries(equations: SampleEquations, k: int, initial: Sequence[int]) -> ca.Sparsity:
    """Which entries of T (k + n_i, n_s) can differ from zero, of the first `k` parameters, all or none, and of the `initial` states that
    are free, by their places (n_i,) in S. Most laws act on the states of few others: an offset of a reading moves none, a drive those of
    its own stage."""
    by_state, by_constant = (_pattern(ca.jacobian_sparsity(equations.following, equations.given[i])) for i in (0, 4))
    moved = np.zeros((k + len(initial), len(by_state)), dtype=bool)
    if k:
        moved[:k] = (by_constant @ _pattern(equations.constants.sparsity_out(1))).T
    moved[k + np.arange(len(initial)), list(initial)] = True
    known = 0
    while (count := int(np.count_nonzero(moved))) > known:
        moved, known = moved | (moved @ by_state.T), count
    rows, columns = np.nonzero(moved)
    return ca.Sparsity.triplet(*moved.shape, rows.tolist(), columns.tolist())


def _pattern(sparsity: ca.Sparsity) -> np.ndarray:
    entries = np.zeros(sparsity.shape, dtype=bool)
    entries[sparsity.row(), sparsity.get_col()] = True
    return entries


def _transposed_jacobians(values: list[ca.SX], symbols: list[ca.SX], jacobian: Jacobian) -> list[ca.SX]:
    """(d value/d symbol)', sparse, of each value by each symbol in turn."""
    return [ca.sparsify(jacobian(value, symbol)).T for value in values for symbol in symbols]


def jacobian_of(equations: SampleEquations) -> Jacobian:
    """How a sample is differentiated as a whole. Of settled poses, in which few lags follow one signal, both directions take as many
    operations, and to write out both takes half as long again."""
    return ca.jacobian if equations.poses else shortest_jacobian


def shortest_jacobian(value: ca.SX, symbol: ca.SX) -> ca.SX:
    """d value/d symbol in the direction that takes fewer operations. CasADi counts directions alone: where many lags follow one signal,
    the reverse one takes a third of the operations, because it carries no derivatives of that signal by everything."""
    usual = ca.jacobian(value, symbol)
    if min(usual.shape) < 2 or _operations(value) < LONG:
        return usual
    return min(usual, ca.jacobian(value, symbol, REVERSE), key=_operations)


def _operations(value: ca.SX) -> int:
    return int(ca.Function("f", ca.symvar(value), [value]).n_instructions())


def _all_steps(
    equations: SampleEquations, T: ca.MX, seed: ca.MX, given: list[ca.MX], held: ca.MX
) -> tuple[ca.MX, ca.MX]:
    """S and T after all integrator steps of a sample; `seed` by the `held` values, then by c where c has a seed."""
    S, u, u_next, e, c = given
    c_varies = seed.size2() > held.numel()
    steps = equations.integrator
    step = (
        _implicit_step(equations, steps, c_varies)
        if isinstance(steps, ImplicitRadau)
        else _explicit_step(equations, steps, c_varies)
    )
    written = _written_out(step, T, seed, [S, u, u_next, held, e, c])
    for u_start, u_end in pairwise(steps.drives(u, u_next, equations.linear)):
        S, T = written(T, seed, S, u_start, u_end, held, e, c)
    return S, T


def _written_out(step: Step, T: ca.MX, seed: ca.MX, given: list[ca.MX]) -> ca.Function:
    """(T, seed, *given) -> Y and T one step on."""
    like = [ca.MX.sym("like", value.sparsity()) for value in (ca.densify(T), seed, *given)]
    return written_out(ca.Function("step", like, list(step(like[0], like[1], like[2:]))))


def written_out(one: ca.Function, longest: int = LONGEST_WRITTEN) -> ca.Function:
    """The function number by number where that is at most so many operations: as machine code it takes half the time of products of
    small matrices."""
    try:
        written = one.expand()
    except RuntimeError:  # it solves a system that is too large for that
        return one
    return written if written.n_instructions() <= longest else one


def _implicit_step(equations: SampleEquations, steps: ImplicitRadau, c_varies: bool) -> Step:
    """The step of `ImplicitRadau`: at each of its two points Y = base + M n, n = N(Y), so that

    dn = (1 - N_Y M)^-1 (N_Y dbase + N_c dc).
    """
    evaluate = _step_with_jacobians(equations, c_varies)
    E_c, E, P, W, V = (M.T for M in (steps.E_c, steps.E, steps.P, steps.W, steps.V))

    def step(T: ca.MX, seed: ca.MX, given: list[ca.MX]) -> tuple[ca.MX, ca.MX]:
        after, by_Y_1, by_Y_2, by_constant_1, by_constant_2 = evaluate(*given)

        def derivative_of_n(base: ca.MX, M: ca.DM, by_Y: ca.MX, by_constant: ca.MX) -> ca.MX:
            return over(base @ by_Y + seed @ by_constant, ca.DM.eye(M.size1()) - M @ by_Y)

        first = derivative_of_n(T @ E_c, P, by_Y_1, by_constant_1)
        base = T @ E + first @ W
        return after, base + derivative_of_n(base, V, by_Y_2, by_constant_2) @ V

    return step


def _explicit_step(equations: SampleEquations, steps: ExponentialRungeKutta, c_varies: bool) -> Step:
    """The step of `ExponentialRungeKutta`, differentiated from point to point; its matrices as there, transposed."""
    evaluate = _step_with_jacobians(equations, c_varies)
    # N depends on some states only: the other columns of the points' derivatives are not needed
    states = sorted({row for i in range(1, 1 + POINTS) for row in evaluate.sparsity_out(i).row()})
    half, Q, R = (_columns(M.T, states) for M in (steps.half, steps.Q, steps.R))

    def step(T: ca.MX, seed: ca.MX, given: list[ca.MX]) -> tuple[ca.MX, ca.MX]:
        after, *by = evaluate(*given)
        by_Y, entering = by[:POINTS], [ca.densify(seed @ by_constant) for by_constant in by[POINTS:]]
        halfway, whole = T @ half, T @ steps.E.T
        # dN at the four points; mac(A, B, C) is A B + C
        first = ca.mac(T, by_Y[0], entering[0])
        second = ca.mac(ca.mac(first, Q, halfway), by_Y[1], entering[1])
        third = ca.mac(ca.mac(second, Q, halfway), by_Y[2], entering[2])
        fourth = ca.mac(ca.mac(third, 2 * Q, ca.mac(first, R, whole)), by_Y[3], entering[3])
        T = whole
        for value, W in zip((first, second, third, fourth), steps.W, strict=True):
            T = ca.mac(value, W.T, T)
        return after, T

    return step


def _step_with_jacobians(equations: SampleEquations, c_varies: bool) -> ca.Function:
    """[Y, u, u at the end, held values, ambient, c] -> Y one step on, then N_Y' at each point of the step, then the transposed
    derivative of N by what is constant within the sample: the held values and, where it varies, c."""
    Y, u, _, e, c = equations.given
    held, u_end = equations.model.held, ca.SX.sym("end", u.numel())
    constant = ca.vertcat(held, c) if c_varies else held
    value = equations.integrator.nonlinear_rates(equations.model)
    N = ca.Function("N", [Y, u, held, e, c], [value])
    jacobians = ca.Function(
        "jacobians", [Y, u, held, e, c], _transposed_jacobians([value], [Y, constant], shortest_jacobian), {"cse": True}
    )
    if isinstance(equations.integrator, ExponentialRungeKutta):
        # called at each point, not written out there: a quarter of the code, which takes longer to compile than to run
        Y, u, u_end, held, e, c = (ca.MX.sym("given", value.numel()) for value in (Y, u, u_end, held, e, c))
    after, points = equations.integrator.points(lambda Y, u: N(Y, u, held, e, c), Y, u, u_end)
    by_Y, by_constant = zip(*(jacobians(*point, held, e, c) for point in points), strict=True)
    return ca.Function("step", [Y, u, u_end, held, e, c], [after, *by_Y, *by_constant], {"cse": True})


def _columns(M: ca.DM, wanted: list[int]) -> ca.DM:
    """M, sparse, with zeros in the other columns."""
    kept = ca.DM(*M.shape)
    kept[:, wanted] = M[:, wanted]
    return ca.sparsify(kept)
