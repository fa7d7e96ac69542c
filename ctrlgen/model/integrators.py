"""Exponential integrators of y' = A y + N(y, u), the motion of a stage with inertia, y = (x, z).

A is the slope of the nominal rates at rest and its part is exact, e^(A h); N is what is left. Without dry friction N is
integrated by explicit steps of fourth order. With it the slope of a contact that sticks is thousands of times that of one
that slides, explicit steps would chatter, and the steps are implicit in the velocities.
"""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np

from ctrlgen.model.model import Model
from ctrlgen.numerics.phi_functions import phi_matrices

# Step length: time times the fastest rate (magnitude of an eigenvalue of A) per step, and steps a sample
EXPLICIT_STEP = 0.8  # nonlinear forces are then right to 1e-3 of themselves
IMPLICIT_STEP = 0.2  # friction whose reversal takes no time is then right to 2 % of itself
CONTACT_STEP = 0.25  # at the rate of a stop or a stiffening flexure: impacts are then right to 1 or 2 % of themselves
LAG_OVER = 5.0  # rates above this per sample do not shorten the step: such a lag is over within a sample, and exact
STIFFER_AWAY = 1.2  # a stage this much faster at the ends of its travel than at home touches something there
LEAST_IMPLICIT_STEPS = 4  # a sample, so that the moment of a reversal is followed
MOST_STEPS = 16  # a sample
VELOCITY_NEWTON_STEPS = 2  # from standstill they converge quadratically, from one side
# Typical displacements off home where slopes are taken: a law with a corner there is on one side of it.
NEAR_HOME = 1e-3
VANISHED = 1e-300  # matrix entries below it are structural zeros that underflowed
NonlinearRates = Callable[[ca.SX, ca.SX], ca.SX]  # (y, u) -> the rows `acting` of N


def integrator_of(model: Model, sample_time: float, finer: int = 1) -> ExponentialRungeKutta | ImplicitRadau:
    """The integrator that suits the model: implicit where dry friction acts on an axis. It takes `finer` times its usual steps."""
    kind = ImplicitRadau if model.set_valued_axes else ExponentialRungeKutta
    return kind(model, sample_time, finer)


class ExponentialIntegrator:
    """What both integrators have: `count` steps a sample, of h [s] each; A; E = e^(A h); `acting`, the rows of N that are not
    zero."""

    LEAST_STEPS = 1

    def __init__(self, model: Model, sample_time: float, A: np.ndarray, longest: float, finer: int) -> None:
        usual = max(substeps(A, sample_time, longest), self.LEAST_STEPS, contact_steps(model, sample_time))
        self.count = finer * usual
        self.h = sample_time / self.count
        self.A = _sparse(A)
        N = self._all_nonlinear_rates(model)
        self.acting = [i for i in range(len(A)) if not N[i].is_zero()]
        self.phi = phi_matrices(A * self.h, 3)
        self.E = _sparse(self.phi[0])

    def nonlinear_rates(self, model: Model) -> ca.SX:
        """N, its rows `acting`, in the symbols of the model."""
        return self._all_nonlinear_rates(model)[self.acting]

    def _all_nonlinear_rates(self, model: Model) -> ca.SX:
        return ca.vertcat(model.sampled_rates, model.v) - self.A @ ca.vertcat(model.x, model.z)

    def points(self, N: NonlinearRates, y: ca.SX, u: ca.SX, u_end: ca.SX) -> tuple[ca.SX, list[tuple[ca.SX, ca.SX]]]:
        """y one step on, and each (y, u) where N was evaluated."""
        raise NotImplementedError

    def step(self, N: NonlinearRates, y: ca.SX, u: ca.SX, u_end: ca.SX) -> ca.SX:
        """y one step on, the drive going linearly from `u` to `u_end`."""
        return self.points(N, y, u, u_end)[0]

    def drives(self, u: ca.SX, u_next: ca.SX, linear: bool) -> list[ca.SX]:
        """The drive at the beginning of each step of a sample, and at the sample's end."""
        return [u + k / self.count * (u_next - u) if linear else u for k in range(self.count + 1)]

    def _acting_columns(self, M: np.ndarray) -> ca.DM:
        return _sparse(M[:, self.acting])


class ExponentialRungeKutta(ExponentialIntegrator):
    """ETD-RK4: explicit steps, N to fourth order.

    A step is from y to E y + sum_i W_i N_i, N_i the values at y, a = half y + Q N_1, b = half y + Q N_2 and
    c = E y + R N_1 + 2 Q N_3; half = e^(A h/2), Q = h/2 phi_1(A h/2), R = half Q - Q.
    Source: S. M. Cox, P. C. Matthews, J. Comput. Phys. 176 (2002) 430, eqs. (26)-(29).
    """

    def __init__(self, model: Model, sample_time: float, finer: int = 1) -> None:
        super().__init__(model, sample_time, slope_at_rest(model), EXPLICIT_STEP, finer)
        h, phi = self.h, self.phi
        half, half_phi_1, *_ = phi_matrices(self.A.full() * h / 2, 3)
        Q = h / 2 * half_phi_1
        self.half, self.Q, self.R = _sparse(half), self._acting_columns(Q), self._acting_columns(half @ Q - Q)
        middle = h * (2 * phi[2] - 4 * phi[3])
        ends = h * (phi[1] - 3 * phi[2] + 4 * phi[3]), h * (4 * phi[3] - phi[2])
        self.W = [self._acting_columns(M) for M in (ends[0], middle, middle, ends[1])]

    def points(self, N: NonlinearRates, y: ca.SX, u: ca.SX, u_end: ca.SX) -> tuple[ca.SX, list[tuple[ca.SX, ca.SX]]]:
        """y one step on, and the four (y, u) where N was evaluated."""
        middle = (u + u_end) / 2
        half, whole = _product(self.half, y), _product(self.E, y)
        first = N(y, u)
        a = half + _product(self.Q, first)
        second = N(a, middle)
        b = half + _product(self.Q, second)
        third = N(b, middle)
        c = whole + _product(self.R, first) + 2 * _product(self.Q, third)
        values = first, second, third, N(c, u_end)
        after = whole + sum(_product(W, value) for W, value in zip(self.W, values, strict=True))
        return after, [(y, u), (a, middle), (b, middle), (c, u_end)]


class ImplicitRadau(ExponentialIntegrator):
    """Steps implicit in the velocities of the axes with dry friction and in its bristles; N to second order, also across a
    reversal that takes no time.

    With c = 1/3: Y = E_c y + P N(Y) and y+ = E y + W N(Y) + V N(y+), E_c = e^(A c h), P = c h phi_1(A c h); W and V
    integrate the straight line through N(Y) at c and N(y+) at 1, the nodes of Radau IIA. An axis at rest stays at rest:
    N(y+) is whatever holds it.
    """

    NODE, LEAST_STEPS = 1 / 3, LEAST_IMPLICIT_STEPS

    def __init__(self, model: Model, sample_time: float, finer: int = 1) -> None:
        at_rest, sliding = slope_at_rest(model), slope_at_rest(model, speed=1.0)
        A = np.where(np.abs(sliding) < np.abs(at_rest), sliding, at_rest)
        self.bristles = list(model.bristles)  # places in y
        A[self.bristles, :] = A[:, self.bristles] = 0.0  # they bend and slip far faster than anything else: all in N
        super().__init__(model, sample_time, A, IMPLICIT_STEP, finer)
        h, c, (_, phi_1, phi_2, _) = self.h, self.NODE, self.phi
        E_c, phi_1_c, *_ = phi_matrices(self.A.full() * c * h, 3)
        self.E_c, self.P = _sparse(E_c), self._acting_columns(c * h * phi_1_c)
        self.W = self._acting_columns(h * (phi_1 - phi_2) / (1 - c))
        self.V = self._acting_columns(h * (phi_2 - c * phi_1) / (1 - c))
        first = model.x.numel() - model.v.numel()
        self.velocities = [first + i for i in model.set_valued_axes]  # places in y
        self.velocity_rows = [self.acting.index(i) for i in self.velocities]  # rows of N
        self.bristle_rows = [self.acting.index(i) for i in self.bristles]  # rows of N
        self._functions: dict[tuple[NonlinearRates, int], tuple[ca.Function, ca.Function, ca.SX]] = {}

    def points(self, N: NonlinearRates, y: ca.SX, u: ca.SX, u_end: ca.SX) -> tuple[ca.SX, list[tuple[ca.SX, ca.SX]]]:
        """y one step on, and the two (y, u) where N = N(y, u) was solved for."""
        u_c = u + self.NODE * (u_end - u)
        Y, n = self._solved(N, self.E_c @ y, self.P, u_c, N(y, u))
        after, _ = self._solved(N, self.E @ y + self.W @ n, self.V, u_end, n)
        return after, [(Y, u_c), (after, u_end)]

    def _solved(self, N: NonlinearRates, base: ca.SX, M: ca.DM, u: ca.SX, n: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Y = base + M n and n = N(Y, u), from a guess of n.

        Newton's method in one velocity at a time, and not `ctrlgen.numerics.newton`: friction is nearly a jump at v = 0,
        across which plain Newton steps alternate for ever. Each velocity therefore starts from where the guess takes it, or
        from standstill where that has the wrong sign, and keeps the sign with which a standstill would be left: friction
        saturates, so that no iterate from there overshoots. The bristles are eliminated exactly; what else N depends on
        follows the velocity.
        """
        weight = ca.diag(M[self.velocities, self.velocity_rows])

        def at_speed(v: ca.SX, n: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
            """Y with the velocities v, N there, and its slope by them; for a guess of the rest of n."""
            n = n[:]
            n[self.velocity_rows] += (v - (base + M @ n)[self.velocities]) / weight
            Y = ca.densify(base + M @ n)
            Y[self.velocities] = v
            return self._sloped(N, base, M, Y, u)

        guessed = (base + M @ n)[self.velocities]
        _, n, _ = at_speed(ca.SX.zeros(len(self.velocities)), n)
        direction = ca.sign((base + M @ n)[self.velocities])
        v = ca.fmax(direction * guessed, 0) * direction
        for _ in range(VELOCITY_NEWTON_STEPS):
            _, n, slope = at_speed(v, n)
            residual = (base + M @ n)[self.velocities] - v
            v = ca.fmax(direction * (v + residual / (1 - weight * slope)), 0) * direction
        if self.bristles:
            _, n, _ = at_speed(v, n)
        n[self.velocity_rows] += (v - (base + M @ n)[self.velocities]) / weight
        return base + M @ n, n

    def _sloped(self, N: NonlinearRates, base: ca.SX, M: ca.DM, Y: ca.SX, u: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Y with the bristles where its velocities take them, N there, and the slope of each velocity's row of N by that
        velocity, through the bristles too."""
        sloped, bent, others = self._written_once(N, M, Y.numel(), u.numel())
        if self.bristles:
            Y = Y[:]
            Y[self.bristles] = bent(Y, u, base, others)
        return Y, *sloped(Y, u, base, others)

    def _written_once(self, N: NonlinearRates, M: ca.DM, n: int, n_u: int) -> tuple[ca.Function, ca.Function, ca.SX]:
        """N at Y with its slopes, and the bristles there, as functions of Y (n,), u (n_u,), base and what else N holds: they are
        differentiated once and not at each of some hundred points of a sample."""
        known = self._functions.get((N, id(M)))
        if known is not None:
            return known
        at, u, base = ca.SX.sym("Y", n), ca.SX.sym("u", n_u), ca.SX.sym("base", n)
        value = N(at, u)
        slopes = [ca.jacobian(value[i], at[k]) for i, k in zip(self.velocity_rows, self.velocities, strict=True)]
        bristles = ca.SX(0, 1)
        for i, k in zip(self.bristle_rows, self.bristles, strict=True):
            m = M[k, i]
            stiff = 1 - m * ca.jacobian(value[i], at[k])
            bristles = ca.vertcat(bristles, at[k] + (base[k] + m * value[i] - at[k]) / stiff)
            for j, (row, place) in enumerate(zip(self.velocity_rows, self.velocities, strict=True)):
                slopes[j] += ca.jacobian(value[row], at[k]) * m * ca.jacobian(value[i], at[place]) / stiff
        slope = ca.vertcat(*slopes)
        own = {symbol.element_hash() for symbol in ca.symvar(ca.vertcat(at, u, base))}
        held = [symbol for symbol in ca.symvar(ca.vertcat(value, slope, bristles)) if symbol.element_hash() not in own]
        others = ca.vertcat(ca.SX(0, 1), *held)
        given = [at, u, base, others]
        self._functions[N, id(M)] = (
            ca.Function("sloped", given, [value, slope]),
            ca.Function("bent", given, [bristles]),
            others,
        )
        return self._functions[N, id(M)]


def _product(M: ca.DM, v: ca.SX | ca.MX) -> ca.SX | ca.MX:
    """M (m, n) v of a vector v (n,). Of an MX it is a function with the entries of M written out: CasADi's product of a sparse matrix by a
    vector looks up their places in every step."""
    if isinstance(v, ca.SX):
        return M @ v
    entries = ca.SX.sym("v", v.numel())
    return ca.Function("product", [entries], [ca.densify(M @ entries)])(v)


def _sparse(M: np.ndarray) -> ca.DM:
    return ca.sparsify(ca.DM(np.where(np.abs(M) < VANISHED, 0.0, M)))


def contact_steps(model: Model, sample_time: float) -> int:
    """Steps a sample that follow the nominal stage at either end of its typical travel, where it is stiffer there; else 1.

    An end at which the laws have no value, as a root of a negative number has none, asks for nothing.
    """
    first = model.x.numel() - model.v.numel()
    slopes = (slope_at_rest(model, displacement=d)[first:, first:] for d in (NEAR_HOME, 1.0, -1.0))
    home, *ends = (np.abs(np.linalg.eigvals(A)).max(initial=0.0) if np.isfinite(A).all() else 0.0 for A in slopes)
    fastest = max(ends)
    return int(min(np.ceil(sample_time * fastest / CONTACT_STEP), MOST_STEPS)) if fastest > STIFFER_AWAY * home else 1


def slope_at_rest(model: Model, speed: float = 0.0, displacement: float = NEAR_HOME) -> np.ndarray:
    """df/dy (n_y, n_y) of the nominal model, the drive held, at `speed` and `displacement` in typical sizes."""
    state = ca.vertcat(model.x, model.z)
    slope = ca.jacobian(ca.vertcat(model.sampled_rates, model.v), state)
    at = ca.Function("A", [state, model.held, model.u, model.p, model.ambient_symbol], [slope])
    y = np.concatenate([model.rest, displacement * model.z_scale])
    first = model.x.numel() - model.v.numel()
    y[first : model.x.numel()] += speed * model.x_scale[first:]
    return at(y, 0, 0, model.p_nominal, 0).full()


def substeps(A: np.ndarray, sample_time: float, longest: float) -> int:
    """Steps a sample, each at most `longest` divided by the fastest rate of A."""
    fastest = np.abs(np.linalg.eigvals(A)).max(initial=0.0)
    return int(np.clip(np.ceil(sample_time * min(fastest, LAG_OVER / sample_time) / longest), 1, MOST_STEPS))
