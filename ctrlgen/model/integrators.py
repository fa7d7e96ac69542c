"""Steps of y' = A y + N(y, u), the motion of a stage with inertia: e^(A h) exactly, with A the nominal slope, N approximately.

Explicit steps of fourth order, except with dry friction: its slope where the contact sticks is thousands of times that where
it slides, so that explicit steps chatter, and these are implicit in the velocities.
"""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np

from ctrlgen.model.model import Model
from ctrlgen.numerics.phi_functions import phis

SUBSTEP = 0.8  # step times the fastest nominal eigenvalue; what is not linear is then right to 1e-3 of itself
FASTEST = 5.0  # eigenvalue times sample time beyond which a lag is over within a sample, and exact
STIFFENED = 1.2  # times faster where the stage is far out than at home: it touches something
CONTACT = 0.25  # step times the fastest eigenvalue there: what an impact does is then right to 1 or 2 % of itself
REVERSING = 0.2  # the same where a reversal takes no time: what friction does is then right to 2 % of itself
REVERSALS = 4  # steps a sample at least, for the same reason
MOST_SUBSTEPS = 16
SOLVING = 2  # iterations for a velocity: from standstill they come from one side and quadratically
Rest = Callable[[ca.SX, ca.SX], ca.SX]  # y, u -> N, its rows `acting`


def integrator_of(model: Model, sample_time: float) -> ExponentialRungeKutta | ImplicitRadau:
    """The steps that suit the model."""
    return ImplicitRadau(model, sample_time) if model.set_valued_axes else ExponentialRungeKutta(model, sample_time)


class Steps:
    """What both kinds have: `count` a sample, of h [s]; A; the rows `acting` of y that N alone has; E = e^(A h)."""

    LEAST = 1

    def __init__(self, model: Model, sample_time: float, A: np.ndarray, longest: float) -> None:
        self.count = max(substeps(A, sample_time, longest), self.LEAST, contact_steps(model, sample_time))
        self.h = sample_time / self.count
        self.A = _sparse(A)
        rest = self._rest(model)
        self.acting = [i for i in range(len(A)) if not rest[i].is_zero()]
        self.phis = phis(A * self.h, 3)
        self.E = _sparse(self.phis[0])

    def rest(self, model: Model) -> ca.SX:
        """N, its rows `acting`."""
        return self._rest(model)[self.acting]

    def _rest(self, model: Model) -> ca.SX:
        return ca.vertcat(model.sampled_rates, model.v) - self.A @ ca.vertcat(model.x, model.z)

    def points(self, N: Rest, y: ca.SX, u: ca.SX, u_end: ca.SX) -> tuple[ca.SX, list[tuple[ca.SX, ca.SX]]]:
        """y one step on, and each (y, u) where N was evaluated."""
        raise NotImplementedError

    def step(self, N: Rest, y: ca.SX, u: ca.SX, u_end: ca.SX) -> ca.SX:
        """y one step on, the drive going from `u` to `u_end`."""
        return self.points(N, y, u, u_end)[0]

    def drives(self, u: ca.SX, u_next: ca.SX, linear: bool) -> list[ca.SX]:
        """The drive at the beginning of each step of a sample, and at its end."""
        return [u + k / self.count * (u_next - u) if linear else u for k in range(self.count + 1)]

    def _acting(self, M: np.ndarray) -> ca.DM:
        return _sparse(M[:, self.acting])


class ExponentialRungeKutta(Steps):
    """Explicit steps, N to fourth order.

    S. M. Cox, P. C. Matthews, J. Comput. Phys. 176 (2002) 430, eqs. (26)-(29): a step is from y to E y + sum_i W_i N_i,
    through the points half y + Q N_1, half y + Q N_2 and E y + R N_1 + 2 Q N_3.
    """

    def __init__(self, model: Model, sample_time: float) -> None:
        super().__init__(model, sample_time, home_slope(model), SUBSTEP)
        h, whole = self.h, self.phis
        half, phi, *_ = phis(self.A.full() * h / 2, 3)
        Q = h / 2 * phi
        self.half, self.Q, self.R = _sparse(half), self._acting(Q), self._acting(half @ Q - Q)
        middle = h * (2 * whole[2] - 4 * whole[3])
        ends = h * (whole[1] - 3 * whole[2] + 4 * whole[3]), h * (4 * whole[3] - whole[2])
        self.W = [self._acting(M) for M in (ends[0], middle, middle, ends[1])]

    def points(self, N: Rest, y: ca.SX, u: ca.SX, u_end: ca.SX) -> tuple[ca.SX, list[tuple[ca.SX, ca.SX]]]:
        """y one step on, and the four (y, u) where N was evaluated."""
        middle = (u + u_end) / 2
        half, whole = self.half @ y, self.E @ y
        first = N(y, u)
        a = half + self.Q @ first
        second = N(a, middle)
        b = half + self.Q @ second
        third = N(b, middle)
        c = whole + self.R @ first + 2 * (self.Q @ third)
        values = first, second, third, N(c, u_end)
        after = whole + sum(W @ value for W, value in zip(self.W, values, strict=True))
        return after, [(y, u), (a, middle), (b, middle), (c, u_end)]


class ImplicitRadau(Steps):
    """Steps implicit in the velocities of the axes that stick and in the bristles that hold them; N to second order, also
    across a reversal that takes no time.

    With c = 1/3: Y = E_c y + P N(Y) and y+ = E y + W N(Y) + V N(y+), E_c = e^(A c h), P = c h phi_1(A c h); W and V
    integrate the straight line through N(Y) at c and N(y+) at 1 (the nodes of Radau IIA). What stands stays: N(y+) is
    whatever keeps it at rest.
    """

    NODE, LEAST = 1 / 3, REVERSALS

    def __init__(self, model: Model, sample_time: float) -> None:
        stuck, sliding = home_slope(model), home_slope(model, 1.0)
        A = np.where(np.abs(sliding) < np.abs(stuck), sliding, stuck)
        self.bristles = list(model.bristles)  # in y
        A[self.bristles, :] = A[:, self.bristles] = 0.0  # they bend and slip far faster than anything else
        super().__init__(model, sample_time, A, REVERSING)
        h, c, (_, phi_1, phi_2, _) = self.h, self.NODE, self.phis
        E_c, phi_c, *_ = phis(self.A.full() * c * h, 3)
        self.E_c, self.P = _sparse(E_c), self._acting(c * h * phi_c)
        self.W = self._acting(h * (phi_1 - phi_2) / (1 - c))
        self.V = self._acting(h * (phi_2 - c * phi_1) / (1 - c))
        first = model.x.numel() - model.v.numel()
        self.places = [first + i for i in model.set_valued_axes]  # in y
        self.own = [self.acting.index(i) for i in self.places]  # in N
        self.bent = [self.acting.index(i) for i in self.bristles]

    def points(self, N: Rest, y: ca.SX, u: ca.SX, u_end: ca.SX) -> tuple[ca.SX, list[tuple[ca.SX, ca.SX]]]:
        """y one step on, and the two (y, u) where N = N(y, u) was solved for."""
        u_c = u + self.NODE * (u_end - u)
        Y, n = self._solved(N, self.E_c @ y, self.P, u_c, N(y, u))
        after, _ = self._solved(N, self.E @ y + self.W @ n, self.V, u_end, n)
        return after, [(Y, u_c), (after, u_end)]

    def _solved(self, N: Rest, base: ca.SX, M: ca.DM, u: ca.SX, n: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Y = base + M n and n = N(Y, u), from a guess of n.

        Newton's method for each velocity, from where the guess goes, or from standstill where it does not go the way that
        a standstill would be left: friction bends toward its full force, so that no iterate from there overshoots. The
        bristles go exactly where the velocity takes them; what else N depends on follows along.
        """
        weight = ca.diag(M[self.places, self.own])

        def at_speed(v: ca.SX, n: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
            """Y with the velocities v, N there, and the slope by them; for a guess of the rest of n."""
            n = n[:]
            n[self.own] += (v - (base + M @ n)[self.places]) / weight
            Y = ca.densify(base + M @ n)
            Y[self.places] = v
            return self._sloped(N, base, M, Y, u)

        sliding = (base + M @ n)[self.places]
        _, n, _ = at_speed(ca.SX.zeros(len(self.places)), n)
        way = ca.sign((base + M @ n)[self.places])
        v = ca.fmax(way * sliding, 0) * way
        for _ in range(SOLVING):
            _, n, slope = at_speed(v, n)
            off = (base + M @ n)[self.places] - v
            v = ca.fmax(way * (v + off / (1 - weight * slope)), 0) * way
        if self.bristles:
            _, n, _ = at_speed(v, n)
        n[self.own] += (v - (base + M @ n)[self.places]) / weight
        return base + M @ n, n

    def _sloped(self, N: Rest, base: ca.SX, M: ca.DM, Y: ca.SX, u: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Y with the bristles where its velocities take them, N there, and how much each sticking row changes with its own
        velocity, the bristles with it."""
        at = ca.SX.sym("Y", Y.numel())
        value = N(at, u)
        slopes = [ca.jacobian(value[i], at[k]) for i, k in zip(self.own, self.places, strict=True)]
        bend = ca.SX(0, 1)
        for i, k in zip(self.bent, self.bristles, strict=True):
            m = M[k, i]
            stiff = 1 - m * ca.jacobian(value[i], at[k])
            bend = ca.vertcat(bend, at[k] + (base[k] + m * value[i] - at[k]) / stiff)
            for j, (own, place) in enumerate(zip(self.own, self.places, strict=True)):
                slopes[j] += ca.jacobian(value[own], at[k]) * m * ca.jacobian(value[i], at[place]) / stiff
        slope = ca.vertcat(*slopes)
        if self.bristles:
            Y = Y[:]
            Y[self.bristles] = ca.substitute(bend, at, Y)
        value, slope = ca.substitute([value, slope], [at], [Y])
        return Y, value, slope


def _sparse(M: np.ndarray) -> ca.DM:
    return ca.sparsify(ca.DM(np.where(np.abs(M) < 1e-300, 0.0, M)))


def contact_steps(model: Model, sample_time: float) -> int:
    """Steps a sample that follow the nominal stage at either end of its typical travel, if it is stiffer there; an end at
    which its laws have no value, as a root beyond its range has none, asks for nothing."""
    first = model.x.numel() - model.v.numel()
    slopes = (home_slope(model, away=away)[first:, first:] for away in (1e-3, 1.0, -1.0))
    home, *ends = (np.abs(np.linalg.eigvals(A)).max(initial=0.0) if np.isfinite(A).all() else 0.0 for A in slopes)
    fastest = max(ends)
    return int(min(np.ceil(sample_time * fastest / CONTACT), MOST_SUBSTEPS)) if fastest > STIFFENED * home else 1


def home_slope(model: Model, moving: float = 0.0, away: float = 1e-3) -> np.ndarray:
    """df/dy of the nominal model near home, the drive held, where a law with a corner at home is on one side of it; at
    standstill or `moving` at so many typical speeds, `away` by so many typical displacements."""
    state = ca.vertcat(model.x, model.z)
    A = ca.jacobian(ca.vertcat(model.sampled_rates, model.v), state)
    at = ca.Function("A", [state, model.held, model.u, model.p, model.ambient_symbol], [A])
    here = np.concatenate([model.rest, away * model.z_scale])
    first = model.x.numel() - model.v.numel()
    here[first : model.x.numel()] += moving * model.x_scale[first:]
    return at(here, 0, 0, model.p_nominal, 0).full()


def substeps(A: np.ndarray, sample_time: float, longest: float) -> int:
    """Steps a sample, each at most `longest` of the time in which the fastest nominal motion changes by itself."""
    fastest = np.abs(np.linalg.eigvals(A)).max(initial=0.0)
    return int(np.clip(np.ceil(sample_time * min(fastest, FASTEST / sample_time) / longest), 1, MOST_SUBSTEPS))
