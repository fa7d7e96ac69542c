"""Constant loads of a mechanism: weights, payloads, preloads, forces on a platform; what they move, press and make stiffer or softer.

With the axes held in place the loads F move the bodies by T_h and put W_h into the flexures. The energy of third order U_3 of all bodies
(`second_order`) along T_1 d + T_h, less the work of forces that keep their direction while their points turn, is to first order in F

    V_F = -f'd + d'K_F d/2,
    d'K_F d/2 = W_h . e_2(d, d) + 2 W_d . e_2(d, h) + f . s_2(d, d) - (K d) . 2 s_2(d, h) - F . (theta x (theta x r))/2:

f = T_1' F their force on the axes, s_2 the second order of the actuators' travels. A moment M that keeps half of its axis has the
work M . theta, no more. K_F of a blade pressed by P between guided ends is -6 P/(5 l). Higher powers of the loads, as near buckling,
are left out; `loaded_tangent` tells what they are.

Source: geometric stiffness, J. S. Przemieniecki, Theory of Matrix Structural Analysis (1968), chapter 15.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from ctrlgen.devices.mechanism.condensed import Condensed
from ctrlgen.devices.mechanism.second_order import LOST, SecondOrder, plain
from ctrlgen.devices.travel import farthest
from ctrlgen.physics import rigid_bodies
from ctrlgen.physics.rigid_bodies import GROUND
from ctrlgen.physics.screw import Matrix, inverse_adjoint
from ctrlgen.physics.second_order_flexure import dot, relative_motion


def without_rounding(values: Matrix, sizes: Callable[[], np.ndarray | None]) -> Matrix:
    """`values` (n, m), those left out that are below a share `LOST` of their `sizes` (n,) or (n, m), where both are numbers: of a symmetric
    drawing they are zero, and in single precision they may be below its least number."""
    if not isinstance(found := plain(values), ca.DM) or (typical := sizes()) is None:
        return values
    kept = found.full()
    typical = np.broadcast_to(typical.reshape(kept.shape[0], -1), kept.shape)
    return ca.sparsify(ca.DM(np.where(np.abs(kept) < LOST * typical, 0.0, kept)))


class Loads:
    """The loads of the file on a condensed mechanism with n axes; `there` says whether there are any."""

    def __init__(self, c: Condensed, second: SecondOrder) -> None:
        self.c, self.s, self.n = c, second, second.n

    @property
    def there(self) -> bool:
        """Whether the file has loads."""
        return bool(self.c.device.load or self.c.device.gravity)

    def points(self) -> Iterator[tuple[int, Matrix, Matrix]]:
        """(body, place, force) (3,) of every force that acts at a point, in the global frame: weights at centres of mass."""
        c, p = self.c, self.c.p
        g = None if p.gravity is None else ca.vertcat(*p.gravity)
        for placed in c.device.placed_loads:
            numbers, at = placed.numbers(p), c.load_point(placed)
            if numbers.mass is not None and g is not None:
                yield placed.second, at, numbers.mass * g
            if numbers.force is not None:
                force = ca.mtimes(placed.turn, ca.vertcat(*numbers.force))
                yield from ((placed.second, at, force), (placed.first, at, -force))
        for i, body in enumerate(c.device.placed_bodies if g is not None else ()):
            numbers = body.numbers(p)
            if numbers.mass is not None:
                centre = ca.DM.zeros(3) if numbers.centre is None else ca.vertcat(*numbers.centre)
                yield i, ca.mtimes(body.turn, centre), numbers.mass * g

    @cached_property
    def wrenches(self) -> dict[int, Matrix]:
        """(6, 1) at the global origin on each body that is loaded, the weight of flexures among them as they move at rest."""
        found: dict[int, Matrix] = {}

        def push(body: int, wrench: Matrix) -> None:
            if body != GROUND:
                found[body] = found.get(body, ca.SX(6, 1)) + wrench

        for body, at, force in self.points():
            push(body, ca.vertcat(force, ca.cross(at, force)))
        for placed in self.c.device.placed_loads:
            stated = placed.numbers(self.c.p).moment
            if stated is not None:  # of a mirror image about the image of its axis, the other way round
                moment = ca.det(placed.turn) * ca.mtimes(placed.turn, ca.vertcat(*stated))
                for body, sign in ((placed.second, 1), (placed.first, -1)):
                    push(body, ca.vertcat(ca.DM.zeros(3), sign * moment))
        if self.c.p.gravity is not None:
            falls = ca.vertcat(ca.DM.zeros(3), *self.c.p.gravity)
            one, other = (
                ca.horzcat(*(ca.DM.eye(6) if at == k else ca.DM(6, 6) for at in range(2)), falls) for k in range(2)
            )
            for k, e in enumerate(self.c.elements):
                if (mass := self.c.flexure_mass(k, one, other)) is not None:
                    for body, rows in ((e.first, mass[:6, 12]), (e.second, mass[6:12, 12])):
                        push(body, ca.vertcat(rows[3:], rows[:3]))
        return {body: plain(W) for body, W in found.items()}

    @cached_property
    def free(self) -> list[Matrix]:
        """(6, 1) twist of every body under the loads, the axes free and without drives (prescribed ones where they are)."""
        device = self.c.device
        if not self.wrenches:
            return [ca.DM(6, 1) for _ in device.bodies]
        return [plain(T) for T in rigid_bodies.twists(len(device.bodies), self.c.elements, self.wrenches, device.size)]

    @cached_property
    def sag(self) -> Matrix:
        """(n,) how far the free axes move [m]."""
        if not self.c.pushes:
            return ca.DM(self.n, 1)
        return plain(ca.vertcat(*(self.c.travel(i, self.free) for i in range(self.n))))

    @cached_property
    def force(self) -> Matrix:
        """f (n,) on the axes [N]; of prescribed displacements none is asked."""
        return without_rounding(ca.mtimes(self.c.stiffness, self.sag), self._usual_forces)

    @cached_property
    def held(self) -> list[Matrix]:
        """T_h (6, 1) of every body, the axes held."""
        return [plain(T - ca.mtimes(T_1, self.sag)) for T, T_1 in zip(self.free, self.s.first_order, strict=True)]

    @cached_property
    def pose(self) -> Matrix:
        """(channels,) what the loads add to the pose, the axes held."""
        c = self.c
        seen = ca.mtimes(inverse_adjoint(None, c.output_point), self.held[c.device.bodies.index(c.device.output.body)])
        return without_rounding(seen[c.channel_rows, :], lambda: np.array(c.device.channel_scale))

    @cached_property
    def sensed(self) -> Matrix:
        """(readings,) the same of what is read beside the output."""
        rows = [ca.SX(0, 1)]
        for r, row in zip(self.c.device.placed_readings, self.c.reading_rows, strict=True):
            if r.section.of is not None:
                k, of_wrench = self.c.load_row(r)
                rows.append(ca.mtimes(of_wrench, self.wrench(k)))
                continue
            ends = [ca.mtimes(row, self.held[b]) if b != GROUND else 0 for b in (r.second, r.first)]
            rows.append(ends[0] - ends[1])
        return ca.vertcat(*rows)

    def prescribed(self, k: int) -> Matrix:
        """(6, 1) what prescribes the motion of element k while the axes are held, at the global origin: nothing."""
        return ca.DM(6, 1)

    def wrench(self, k: int) -> Matrix:
        """W_h (6, 1) of element k on its free end, at the global origin."""
        return ca.mtimes(self.c.elements[k].stiffness, self.relative(k))

    def relative(self, k: int) -> Matrix:
        """(6, 1) twist of the free end of element k against its fixed one, at the global origin."""
        e = self.c.elements[k]
        ends = [ca.DM(6, 1) if b == GROUND else self.held[b] for b in (e.second, e.first)]
        return ends[0] - ends[1]

    @cached_property
    def stiffness(self) -> Matrix:
        """K_F (n, n) [N/m]; zero of prescribed displacements, which take whatever force they need."""
        c, n = self.c, self.n
        if not (self.there and c.pushes):
            return ca.DM(n, n)
        I, J = [i for i in range(n) for _ in range(n)], [j for _ in range(n) for j in range(n)]
        h = [n] * (n * n)
        V = ca.SX(1, n * n)  # of d_i d_j
        for k in range(len(c.elements)):
            e = self.s.motions(k, self.held)
            V += dot(e.load[:, h], e.deformation(I, J)) + 2 * dot(e.load[:, I], e.deformation(J, h))
        V += ca.mtimes(self.force.T, self.s.travels(I, J))
        V -= 2 * ca.sum1(c.stiffness[:, I] * self.s.travels(J, h, self.held))
        for body, at, force in self.points():
            if body != GROUND:
                T = self.s.first_order[body]
                V -= ca.mtimes(force.T, relative_motion(at, ca.DM(*T.shape), T, I, J)[3:, :])
        form = ca.reshape(V, n, n)
        return without_rounding(form + form.T, self._usual_stiffnesses)

    def _usual_stiffnesses(self) -> np.ndarray | None:
        """(n, n) the roots of the products of the axes' stiffnesses [N/m]; None of a mechanism of symbols."""
        if not isinstance(K := plain(self.c.stiffness), ca.DM):
            return None
        roots = np.sqrt(np.abs(np.diag(K.full())))
        return np.outer(roots, roots)

    def _usual_forces(self) -> np.ndarray | None:
        """(n,) what the axes' stiffnesses take at their ends [N]; None of a mechanism of symbols."""
        K = self._usual_stiffnesses()
        travel = np.array([farthest(a.section.travel) for a in self.c.device.placed_actuators])
        return None if K is None else np.diag(K) * travel

    def restoring_force(self, d: Matrix) -> Any:
        """(n,) what the loads add to the force that pulls the axes home from `d` (n,)."""
        return ca.mtimes(self.stiffness, d) - self.force


class DrivenLoads(Loads):
    """The same loads with the axes held at `d` (n,) [m], where their actuators push beside them or move the elements."""

    def __init__(self, loads: Loads, d: Any) -> None:
        super().__init__(loads.c, loads.s)
        self.without, self.d = loads, ca.DM(d)

    @cached_property
    def held(self) -> list[Matrix]:
        """(6, 1) of every body."""
        return [plain(T + ca.mtimes(T_1, self.d)) for T, T_1 in zip(self.without.held, self.s.first_order, strict=True)]

    @cached_property
    def force(self) -> Matrix:
        """(n,) that of the loads on the axes, less what the actuators push."""
        pushed = ca.mtimes(self.c.stiffness, self.d) if self.c.pushes else ca.DM(self.n, 1)
        return plain(self.without.force - pushed)

    def prescribed(self, k: int) -> Matrix:
        """(6, 1) the stroke of element k at `d`."""
        m = self.c.prescribed[k]
        return ca.DM(6, 1) if m is None else plain(ca.mtimes(m[:, : self.n], self.d))
