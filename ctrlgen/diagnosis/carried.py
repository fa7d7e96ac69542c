"""One sample of a model with the derivatives of its state and readings carried along.

Tangents T (m, n_s) hold dS/dp of m numbers, one a row, so that CasADi's product with a sparse matrix runs along columns.
A model with inertia takes many steps a sample: T goes from step to step, which needs only the constant matrices of the
steps and the slopes of what is not linear at the points where it was evaluated, instead of differentiating all the steps
at once.
"""

from __future__ import annotations

from itertools import pairwise

import casadi as ca

from ctrlgen.diagnosis.equations import Equations

POINTS = 4  # of a step


def carried(q: Equations, T: ca.MX, seed: ca.MX, given: list[ca.MX]) -> tuple[ca.MX, ca.MX, ca.MX, ca.MX]:
    """S and T one sample on, the readings (n_y,) and their derivatives (m, n_y); `seed` (m, n_c) is dc/dp,
    `given` those of `q`."""
    by = [q.given[0], q.given[4]] if seed.nnz() else q.given[:1]

    def slope(*slopes: ca.MX) -> ca.MX:
        return sum((V @ slope for V, slope in zip((T, seed), slopes, strict=False)))

    if q.steps is None or q.steps.count == 1:
        one = ca.Function("one", q.given, [q.following, q.y, *_slopes([q.following, q.y], by)], {"cse": True})
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


def _slopes(values: list[ca.SX], by: list[ca.SX]) -> list[ca.SX]:
    """(d value/d symbols)^T of each value by each of `by`, sparse."""
    return [ca.sparsify(ca.jacobian(value, symbols)).T for value in values for symbols in by]


def _steps(q: Equations, T: ca.MX, seed: ca.MX, given: list[ca.MX], held: ca.MX) -> tuple[ca.MX, ca.MX]:
    """y and T after all steps of a sample; `seed` by what keeps its value meanwhile: `held`, then the constants."""
    steps = q.steps
    y, u, u_next, e, c = given
    along = _along(q, seed.size2() > held.numel())
    read = sorted({row for i in range(1, 1 + POINTS) for row in along.sparsity_out(i).row()})  # the states N depends on
    half, Q, R = (_columns(M.T, read) for M in (steps.half, steps.Q, steps.R))
    for begin, end in pairwise(steps.drives(u, u_next, q.linear)):
        y, *slopes = along(y, begin, end, held, e, c)
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


def _along(q: Equations, free: bool) -> ca.Function:
    """(y, u, u at the end, held, ambient, c) -> y one step on, then the transposed slopes of N at the four points by y,
    then those by what keeps its value through a sample: held and, where they are `free`, the constants."""
    y, u, _, e, c = q.given
    own = [q.model.held, e, c]
    kept = ca.vertcat(q.model.held, c) if free else q.model.held
    N = q.steps.rest(q.model)
    value = ca.Function("N", [y, u, *own], [N])
    slopes = ca.Function("slopes", [y, u, *own], _slopes([N], [y, kept]))
    end = ca.SX.sym("end", u.numel())
    after, points = q.steps.step(lambda y, u: value(y, u, *own), y, u, end)
    by_y, by_kept = zip(*(slopes(*point, *own) for point in points), strict=True)
    return ca.Function("along", [y, u, end, *own], [after, *by_y, *by_kept], {"cse": True})


def _columns(M: ca.DM, wanted: list[int]) -> ca.DM:
    """M with nothing in the other columns."""
    found = ca.DM(*M.shape)
    found[:, wanted] = M[:, wanted]
    return ca.sparsify(found)
