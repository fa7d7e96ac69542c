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
# Operations up to which a step is written out number by number. An implicit one of 7,500, of friction beside the nine lags of a creep,
# takes half the time of products of matrices then, and gcc 12 0.5 s once. Explicit ones of 4,300 to 6,600 take about the same time either
# way (14 % more to 23 % less), and gcc twice as long.
LONGEST_IMPLICIT, LONGEST_EXPLICIT = 10_000, 4_000
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
    c_varies = seed.nnz() > 0
    symbols = [equations.given[0], equations.given[4]] if c_varies else equations.given[:1]
    if equations.steps is None:
        values = [equations.following, equations.y]
        transposed = _transposed_jacobians(values, symbols, jacobian_of(equations))
        # some dozens of poses are evaluated faster than what is common to two expressions is found: 0.2 s of 17,000 operations
        one = equations.one("one", [*values, *transposed], {"cse": not equations.poses})
        following, y, *by = one(*given)
        T, Y = _chained(T, seed, by, len(symbols))
        return following, T, y, Y
    m = equations.model
    # once a sample, at its beginning
    once = [equations.y, m.held_value, ca.vertcat(ca.SX(0, 1), *m.stepped.values())]
    first = ca.Function(
        "first", equations.given, [*once, *_transposed_jacobians(once, symbols, shortest_jacobian)], {"cse": True}
    )
    y, held, stepped, *by = first(*given)
    step, longest = _step_of(equations, c_varies)

    def whole(T: ca.MX, seed: ca.MX) -> tuple[ca.Function, tuple[ca.MX, ca.MX, ca.MX, ca.MX]]:
        """One integrator step, and the sample."""
        Y, of_held, of_stepped = _chained(T, seed, by, len(symbols))
        constant = ca.horzcat(of_held, seed) if c_varies else of_held
        one, following, T = _all_steps(equations, step, longest, T, constant, given, held)
        if m.stepped:
            places = list(m.stepped)
            following[places], T[:, places] = stepped, of_stepped
        return one, (following, T, y, Y)

    one, sample = whole(T, seed)
    if not one.is_a("SXFunction"):
        # products of a full matrix by a sparse one run along columns, without indices of the former
        one, sample = whole(ca.densify(T), ca.densify(seed) if c_varies else seed)
    return sample


def _chained(T: ca.MX, seed: ca.MX, by: Sequence[ca.MX], symbols: int) -> list[ca.MX]:
    """(d value/dp)' of several values from their transposed derivatives: of each by S and, where there are two `symbols`, by c."""
    each = (by[i : i + symbols] for i in range(0, len(by), symbols))
    return [sum(V @ derivative for V, derivative in zip((T, seed), one, strict=False)) for one in each]


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


def _step_of(equations: SampleEquations, c_varies: bool) -> tuple[Step, int]:
    """A step of the integrator with its derivatives, `c_varies` where c has a seed too; and up to how many operations it is written out."""
    steps = equations.integrator
    if isinstance(steps, ImplicitRadau):
        return _implicit_step(equations, steps, c_varies), LONGEST_IMPLICIT
    return _explicit_step(equations, steps, c_varies), LONGEST_EXPLICIT


def _all_steps(
    equations: SampleEquations, step: Step, longest: int, T: ca.MX, seed: ca.MX, given: list[ca.MX], held: ca.MX
) -> tuple[ca.Function, ca.MX, ca.MX]:
    """The function of one step, and S and T after all integrator steps of a sample; `seed` by the `held` values, then by c where c has a
    seed."""
    S, u, u_next, e, c = given
    like = [ca.MX.sym("like", value.sparsity()) for value in (ca.densify(T), seed, S, u, u, held, e, c)]
    one = written_out(ca.Function("step", like, list(step(like[0], like[1], like[2:]))), longest)
    for u_start, u_end in pairwise(equations.integrator.drives(u, u_next, equations.linear)):
        S, T = one(T, seed, S, u_start, u_end, held, e, c)
    return one, S, T


def written_out(one: ca.Function, longest: int) -> ca.Function:
    """The function number by number where that is at most so many operations."""
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
        by_Y, none = by[:POINTS], ca.MX(ca.DM.zeros(T.size1(), len(steps.acting)))
        # mac(A, B, C) is A B + C
        entering = [ca.mac(seed, by_constant, none) for by_constant in by[POINTS:]]
        halfway, whole = T @ half, T @ steps.E.T
        # dN at the four points
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
    slopes = _transposed_jacobians([value], [Y, constant], shortest_jacobian)
    sloped = ca.Function("sloped", [Y, u, held, e, c], [value, *slopes], {"cse": True})
    if isinstance(equations.integrator, ExponentialRungeKutta):
        # called once at each point, not written out there: a quarter of the code, which takes longer to compile than to run
        Y, u, u_end, held, e, c = (ca.MX.sym("given", value.numel()) for value in (Y, u, u_end, held, e, c))
    after, points = equations.integrator.points(lambda Y, u: sloped(Y, u, held, e, c)[0], Y, u, u_end)
    by_Y, by_constant = zip(*(sloped(*point, held, e, c)[1:] for point in points), strict=True)
    return ca.Function("step", [Y, u, u_end, held, e, c], [after, *by_Y, *by_constant], {"cse": True})


def _columns(M: ca.DM, wanted: list[int]) -> ca.DM:
    """M, sparse, with zeros in the other columns."""
    kept = ca.DM(*M.shape)
    kept[:, wanted] = M[:, wanted]
    return ca.sparsify(kept)
