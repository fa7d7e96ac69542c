"""One sample of a model with the derivatives of its state and readings carried along.

Tangents T (m, n_s) hold dS/dp of m numbers, one a row, so that CasADi's product with a sparse matrix runs along columns.
A model with inertia takes many steps a sample: T goes from step to step. An explicit step needs only its constant
matrices and the slopes of what is not linear at the points where it was evaluated, instead of being differentiated whole.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import casadi as ca

from ctrlgen.diagnosis.estimation.sample_equations import SampleEquations
from ctrlgen.model.integrators import ExponentialRungeKutta, ImplicitRadau

POINTS = 4  # of an explicit step
Step = Callable[
    [ca.MX, ca.MX, list[ca.MX]], tuple[ca.MX, ca.MX]
]  # T, seed, (y, u, u at the end, held, ambient, c) -> y, T


def forward_sensitivities(
    q: SampleEquations, T: ca.MX, seed: ca.MX, given: list[ca.MX]
) -> tuple[ca.MX, ca.MX, ca.MX, ca.MX]:
    """S and T one sample on, the readings (n_y,) and their derivatives (m, n_y); `seed` (m, n_c) is dc/dp,
    `given` those of `q`."""
    by = [q.given[0], q.given[4]] if seed.nnz() else q.given[:1]

    def slope(*slopes: ca.MX) -> ca.MX:
        return sum((V @ slope for V, slope in zip((T, seed), slopes, strict=False)))

    if not takes_several_steps(q):
        one = ca.Function("one", q.given, [q.following, q.y, *_slopes([q.following, q.y], by)])
        following, y, *slopes = one(*given)
        return following, slope(*slopes[: len(by)]), y, slope(*slopes[len(by) :])
    m = q.model
    once = [q.y, m.held_value, ca.vertcat(ca.SX(0, 1), *m.stepped.values())]
    first = ca.Function("first", q.given, [*once, *_slopes(once, by)], {"cse": True})
    y, held, stepped, *slopes = first(*given)
    Y, of_held, of_stepped = (slope(*slopes[i * len(by) : (i + 1) * len(by)]) for i in range(3))
    after, T = _steps(q, T, ca.horzcat(of_held, seed) if seed.nnz() else of_held, given, held)
    if m.stepped:
        places = list(m.stepped)
        after[places], T[:, places] = stepped, of_stepped
    return after, T, y, Y


def takes_several_steps(q: SampleEquations) -> bool:
    """Whether a sample takes more than one explicit step, or implicit ones: not to be differentiated whole."""
    return q.steps is not None and (isinstance(q.steps, ImplicitRadau) or q.steps.count > 1)


def _slopes(values: list[ca.SX], by: list[ca.SX]) -> list[ca.SX]:
    """(d value/d symbols)^T of each value by each of `by`, sparse."""
    return [ca.sparsify(ca.jacobian(value, symbols)).T for value in values for symbols in by]


def _steps(q: SampleEquations, T: ca.MX, seed: ca.MX, given: list[ca.MX], held: ca.MX) -> tuple[ca.MX, ca.MX]:
    """y and T after all steps of a sample; `seed` by what keeps its value meanwhile: `held`, then the constants."""
    y, u, u_next, e, c = given
    free = seed.size2() > held.numel()
    steps = q.integrator
    on = _implicitly(q, steps, free) if isinstance(steps, ImplicitRadau) else _explicitly(q, steps, free)
    for begin, end in pairwise(steps.drives(u, u_next, q.linear)):
        y, T = on(T, seed, [y, begin, end, held, e, c])
    return y, T


def _implicitly(q: SampleEquations, steps: ImplicitRadau, free: bool) -> Step:
    """A step through points Y = base + M n with n = N(Y): dn = (1 - N_Y M)^-1 (N_Y dbase + N_c dc)."""
    along = _along(q, free)
    E_c, E, P, W, V = (M.T for M in (steps.E_c, steps.E, steps.P, steps.W, steps.V))

    def on(T: ca.MX, seed: ca.MX, given: list[ca.MX]) -> tuple[ca.MX, ca.MX]:
        y, *slopes = along(*given)

        def of_n(base: ca.MX, M: ca.DM, by_y: ca.MX, by_kept: ca.MX) -> ca.MX:
            return (base @ by_y + seed @ by_kept) @ ca.inv(ca.DM.eye(M.size1()) - M @ by_y)

        first = of_n(T @ E_c, P, slopes[0], slopes[2])
        base = T @ E + first @ W
        return y, base + of_n(base, V, slopes[1], slopes[3]) @ V

    return on


def _explicitly(q: SampleEquations, steps: ExponentialRungeKutta, free: bool) -> Step:
    """A step from point to point."""
    along = _along(q, free)
    read = sorted({row for i in range(1, 1 + POINTS) for row in along.sparsity_out(i).row()})  # the states N depends on
    half, Q, R = (_columns(M.T, read) for M in (steps.half, steps.Q, steps.R))

    def on(T: ca.MX, seed: ca.MX, given: list[ca.MX]) -> tuple[ca.MX, ca.MX]:
        y, *slopes = along(*given)
        by_y, enters = slopes[:POINTS], [ca.densify(seed @ slope) for slope in slopes[POINTS:]]
        halfway, whole = T @ half, T @ steps.E.T
        first = ca.mac(T, by_y[0], enters[0])
        second = ca.mac(ca.mac(first, Q, halfway), by_y[1], enters[1])
        third = ca.mac(ca.mac(second, Q, halfway), by_y[2], enters[2])
        fourth = ca.mac(ca.mac(third, 2 * Q, ca.mac(first, R, whole)), by_y[3], enters[3])
        T = whole
        for value, W in zip((first, second, third, fourth), steps.W, strict=True):
            T = ca.mac(value, W.T, T)
        return y, T

    return on


def _along(q: SampleEquations, free: bool) -> ca.Function:
    """(y, u, u at the end, held, ambient, c) -> y one step on, then the transposed slopes of N at its points by y,
    then those by what keeps its value through a sample: held and, where they are `free`, the constants."""
    N, arguments, kept = _rest(q, free)
    y, u, end, *own = arguments
    slopes = ca.Function("slopes", [y, u, *own], _slopes([N(y, u, *own)], [y, kept]))
    after, points = q.integrator.points(lambda y, u: N(y, u, *own), y, u, end)
    by_y, by_kept = zip(*(slopes(*point, *own) for point in points), strict=True)
    return ca.Function("along", arguments, [after, *by_y, *by_kept], {"cse": True})


def _rest(q: SampleEquations, free: bool) -> tuple[ca.Function, list[ca.SX], ca.SX]:
    """N (y, u, held, ambient, c); symbols y, u, u at the end, held, ambient, c; those of what keeps its value."""
    y, u, _, e, c = q.given
    own = [q.model.held, e, c]
    N = ca.Function("N", [y, u, *own], [q.integrator.nonlinear_rates(q.model)])
    return N, [y, u, ca.SX.sym("end", u.numel()), *own], ca.vertcat(q.model.held, c) if free else q.model.held


def _columns(M: ca.DM, wanted: list[int]) -> ca.DM:
    """M with nothing in the other columns."""
    found = ca.DM(*M.shape)
    found[:, wanted] = M[:, wanted]
    return ca.sparsify(found)
