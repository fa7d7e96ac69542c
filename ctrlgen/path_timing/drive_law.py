"""What a place on a path and the speed there take: states, displacements and drives in continuous time, and the limits on them.

With the path r(s) and the share s(t) of it that is behind, the chain rule gives the derivatives of the target by time,

    r^(k) = sum_j  d^j r/ds^j  B_k,j(s', s'', ...),      B the partial Bell polynomials,

and the inverse in continuous time (`ctrlgen.model.inverse_dynamics`) the drive. A stage in balance needs the first one only: its
equilibria x(s), z(s) change with the rates x'(s) s', and the drive is the one that makes these rates.
Source: J. E. Bobrow, S. Dubowsky, J. S. Gibson, Int. J. Robotics Res. 4 (1985) 3, eqs. (5)-(9).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import casadi as ca
import numpy as np
import scipy

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.devices import Limit
from ctrlgen.model.inverse import ExpansionPoint, solve_by_blocks
from ctrlgen.model.inverse_dynamics import inverse_dynamics
from ctrlgen.model.model import Model
from ctrlgen.trajectory.inverse.balanced import BalancedInverse
from ctrlgen.trajectory.inverse.clock import Sampled

DEGREE = 5  # of the splines of the equilibria along a path


@dataclass(frozen=True)
class Side:
    """One side of a limit of one channel, or of the rate of one drive: its `bound` [SI], and the `unit` [SI] in which distances from
    it are counted: the range of the limit, or the bound where there is one."""

    limit: Limit
    channel: int
    upper: bool
    bound: float
    unit: float

    @property
    def name(self) -> str:
        """The name of the limited channel."""
        return self.limit.channels[self.channel]


def sides_of(limits: tuple[Limit, ...], model: Model) -> list[Side]:
    """Both sides of all limits, as far as they are bounded."""
    sides = []
    for limit in limits:
        unit = limit.span or model.force_scale
        for i in range(len(limit.channels)):
            sides += [
                Side(limit, i, upper, bound, unit)
                for upper, bound in ((False, limit.lower), (True, limit.upper))
                if bound is not None
            ]
    return sides


class BalancedLaw:
    """A stage in balance whose drives act through a lag each: one derivative of s.

    Raises InputError for a device of which nothing bounds the speed, or whose drives are not determined by it.
    """

    order = 1

    def __init__(self, model: Model, follow: str, inverse: BalancedInverse) -> None:
        self.model, self.follow, self.inverse = model, follow, inverse
        if not model.n_states and not model.rate_limits:
            what = (
                "follows its drives without delay, so that nothing bounds its speed: state time_constant or rate of an actuator, or "
                "give the stage inertia"
            )
            raise InputError(model.name, [Fault("actuator", what)])
        if model.n_states not in (0, model.u.numel()):
            what = "has drives with and without a lag, for which the fastest path is not computed; give each a time_constant"
            raise InputError(model.name, [Fault("actuator", what)])
        m, u = model, ca.SX.sym("u1", model.u.numel())
        v = ca.SX.sym("rate", m.n_states)
        self._sizes = (m.x.numel(), m.z.numel(), m.n_states)
        known = ExpansionPoint.of(
            (m.x, m.rest, m.x_scale),
            (m.z, 0 * m.z_scale, m.z_scale),
            (u, 0 * m.u_scale, m.u_scale),
            (m.heat, np.zeros(m.heat.numel()), np.ones(m.heat.numel())),
            (v, np.zeros(v.numel()), np.zeros(v.numel())),
        )
        produced = ca.substitute(m.heat_of_drive, ca.vertcat(m.u, m.p), ca.vertcat(u, ca.DM(m.p_nominal)))
        rates, balance = (
            ca.substitute(e, ca.vertcat(m.u, m.p), ca.vertcat(u, ca.DM(m.p_nominal)))
            for e in (m.rates_of_heat[: m.n_states], m.balance)
        )
        rows = ca.vertcat(rates - v if m.n_states else balance, m.heat - produced)
        drive = solve_by_blocks(known, rows, ca.vertcat(m.heat, u))[m.heat.numel() :]
        self._drive = ca.Function("drive", [m.x, m.z, v], [drive], {"cse": True})

    def along(self, command: np.ndarray, share: np.ndarray, closed: bool) -> BalancedPath:
        """The equilibria along the samples `command` (n, channels) [SI] of a smooth piece of a path, at the shares (n,)."""
        x, z, _ = self.inverse.equilibria(command)
        return BalancedPath(self, share, np.hstack([x, z]), closed)

    def at(self, place: ca.SX, speed: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """x, z, u at a `place` (x, z and the slope of the states by s) and a `speed` (1,), symbolic."""
        x, z, slope = ca.vertsplit(place, np.cumsum([0, *self._sizes]).tolist())
        return x, z, self._drive(x, z, slope * speed[0])

    @property
    def place_size(self) -> int:
        """The number of values that describe a place of the path."""
        return sum(self._sizes)


class BalancedPath:
    """Equilibria along a smooth piece of a path, as splines in its share."""

    def __init__(self, law: BalancedLaw, share: np.ndarray, values: np.ndarray, closed: bool) -> None:
        self.law, self.closed, self.share, self.ends = law, closed, share, (float(share[0]), float(share[-1]))
        if closed:
            values = np.vstack([values[:-1], values[:1]])
        self._spline = scipy.interpolate.make_interp_spline(
            share, values, DEGREE, bc_type="periodic" if closed else None
        )
        self._n_x = law.model.x.numel()

    def states(self, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """x (n, n_x) and z (n, n_axes) at the shares."""
        at = share % 1.0 if self.closed else np.clip(share, *self.ends)
        x, z = np.split(self._spline(at), [self._n_x], axis=1)
        return x, z

    def places(self, share: np.ndarray) -> np.ndarray:
        """(n, place_size) the places at the shares."""
        at = share % 1.0 if self.closed else np.clip(share, *self.ends)
        return np.hstack([self._spline(at), self._spline(at, 1)[:, : self.law.model.n_states]])


class InertialLaw:
    """A stage with inertia: as many derivatives of s as its drive follows. Internal states stay at rest."""

    def __init__(self, model: Model, follow: str) -> None:
        self.model, self.follow = model, follow
        self.dynamics = inverse_dynamics(model, follow)
        self.order = self.dynamics.order
        self._channels = len(model.signals[follow].channels)

    def at(self, place: ca.SX, speed: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """x, z, u at a `place` (the target and its derivatives by s) under the derivatives `speed` (order,) of s by time, symbolic."""
        by_share = ca.reshape(place, self._channels, self.order + 1)
        target = ca.horzcat(
            by_share[:, 0],
            *(ca.mtimes(by_share[:, 1 : k + 1], bell_polynomials(k, speed)) for k in range(1, self.order + 1)),
        )
        x, z, u = self.dynamics.kernel(target)
        return x, z, u

    @property
    def place_size(self) -> int:
        """The number of values that describe a place of the path."""
        return self._channels * (self.order + 1)


def bell_polynomials(k: int, w: ca.SX) -> ca.SX:
    """(k,) the partial Bell polynomials B_k,1 ... B_k,k of w: B_k,j = sum_i C(k-1, i-1) w_i B_k-i,j-1."""
    table: dict[tuple[int, int], ca.SX] = {(0, 0): ca.SX(1)}
    for a in range(1, k + 1):
        for j in range(1, a + 1):
            terms = [comb(a - 1, i - 1) * w[i - 1] * table.get((a - i, j - 1), ca.SX(0)) for i in range(1, a - j + 2)]
            table[a, j] = sum(terms[1:], terms[0])
    return ca.vertcat(*(table[k, j] for j in range(1, k + 1)))


Law = BalancedLaw | InertialLaw


def drive_law(model: Model, follow: str, sample_time: float) -> Law:
    """That of a model. Raises InputError for a device of which nothing bounds the speed, or whose drives are not determined by it."""
    if model.inertial:
        return InertialLaw(model, follow)
    return BalancedLaw(model, follow, BalancedInverse(model, follow, Sampled(sample_time)))


def distances_at(law: Law, sides: list[Side]) -> ca.Function:
    """(place, speed) -> (sides,) how far each limit is from its bound, in its unit, negative where it is broken; and the drives (n_u,)."""
    m = law.model
    place, speed = ca.SX.sym("place", law.place_size), ca.SX.sym("speed", law.order)
    x, z, u = law.at(place, speed)
    rows = [(-1 if s.upper else 1) * (s.limit.expr[s.channel] - s.bound) / s.unit for s in sides]
    values = ca.substitute(ca.vertcat(*rows), ca.vertcat(m.x, m.z, m.u, m.p), ca.vertcat(x, z, u, ca.DM(m.p_nominal)))
    return ca.Function("distances", [place, speed], [values, u], {"cse": True})


def depends_on_speed(distances: ca.Function) -> list[bool]:
    """Which of the distances change with the speed, whatever the place."""
    pattern = distances.jac_sparsity(0, 1)
    rows = set(pattern.row())
    return [i in rows for i in range(distances.size1_out(0))]
