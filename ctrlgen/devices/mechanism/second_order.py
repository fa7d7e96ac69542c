"""A mechanism to second order in the displacements of its axes: finite rotations, flexures that shorten as they bend, and the stretching
that this makes where they are held."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np

from ctrlgen.devices.mechanism.condensed import Condensed
from ctrlgen.devices.mechanism.copies import Placed
from ctrlgen.devices.travel import farthest
from ctrlgen.physics import rigid_bodies as mechanism
from ctrlgen.physics.flexure import Segment
from ctrlgen.physics.rigid_bodies import GROUND
from ctrlgen.physics.screw import TWIST, Matrix, adjoint, inverse_adjoint
from ctrlgen.physics.second_order_flexure import (
    AWTAR_2,
    beam,
    dot,
    point_flexure,
    relative_motion,
)

LOST = 1e-12  # of a typical size, below which a coefficient of the drawing's numbers is rounding


def plain(value: Any) -> Any:
    """`value`, as numbers where it has no symbols: they are far faster to compute with."""
    return ca.DM(ca.evalf(value)) if isinstance(value, ca.SX) and value.is_constant() else value


@dataclass(frozen=True, eq=False)
class Motions:
    """What k motions of the mechanism, the columns, do to an element at `place`, about which its frame `R` is: twists of its bodies
    `first` and `second` (6, k) at the global origin; its deformation `relative` and the `load` on its free end (6, k) in its frame. `shape`
    (6, 36) is that of `beam` per product of two components of its load; None where it yields at a point."""

    R: Matrix
    place: Matrix
    shape: Matrix | None
    first: Matrix
    second: Matrix
    relative: Matrix
    load: Matrix

    def deformation(self, a: Sequence[int], b: Sequence[int]) -> Matrix:
        """Its second order (6, m) in the columns `a` and `b` of equal length, in its frame (`physics.second_order_flexure`)."""
        seen = relative_motion(self.place, self.first, self.second, a, b)
        if self.shape is not None and all(isinstance(x, ca.DM) for x in (seen, self.load, self.R, self.shape)):
            W, R = self.load.full(), self.R.full()
            turned = np.vstack([R.T @ half for half in np.split(seen.full(), 2)])
            return ca.DM(turned + self.shape.full() @ (W[:, None, a] * W[None, :, b]).reshape(36, len(a)))
        local = ca.vertcat(ca.mtimes(self.R.T, seen[:3, :]), ca.mtimes(self.R.T, seen[3:, :]))
        if self.shape is None:
            return local + point_flexure(self.relative, a, b)
        return local + ca.mtimes(
            self.shape, ca.vertcat(*(ca.repmat(self.load[x, a], 6, 1) * self.load[:, b] for x in range(6)))
        )


class SecondOrder:
    """The second order of a condensed mechanism with n axes displaced by d (n,), home at zero.

    The elastic energy to third order is d' K d/2 + U_3(d), that of all bodies' twists T = T_1 d + T_2(d, d) + ...; in equilibrium
    K T_2 = -dU_3/dT along T_1 d, with the axes where they are (`twists`). Products d_i d_j, i <= j, are counted as `products`, every
    second order as columns (., p) per product. The condensed energy is d' K d/2 + V_3 + V_4 + ...: V_3 follows from T_1 alone and V_4 from
    T_1 and T_2. Of V_4 the deformations of third order are left out: bending that it adds is (y/l)^2 of the linear one, what it keeps,
    stretching, is (y/t)^2 of it.

    Source: expansion of the equilibrium, W. T. Koiter, On the stability of elastic equilibrium (1945, NASA TT F-10833), chapter 2.
    """

    def __init__(self, c: Condensed) -> None:
        self.c, self.n = c, len(c.directions)
        self.pairs = [(i, j) for i in range(self.n) for j in range(i, self.n)]
        self.I, self.J = [i for i, _ in self.pairs], [j for _, j in self.pairs]
        self.weight = ca.DM([1.0 if i == j else 2.0 for i, j in self.pairs])
        self.first_order = [plain(T[:, : self.n]) for T in c.twists]
        # Of a mechanism whose numbers are symbols a gradient takes ten seconds, and a model asks for it at one d several times
        self._forces: dict[Callable[[Matrix], Matrix] | None, list[tuple[Matrix, Matrix]]] = {}

    @cached_property
    def parts(self) -> list[tuple[Matrix, tuple[Segment, ...], Matrix | None]]:
        """For every element: where it is looked at, its segments, and what its `beam` makes of products of its loads (6, 36)."""
        c, parts = self.c, []
        materials = {m.name: q for m, q in zip(c.device.material, c.p.material, strict=True)}
        a, b = [x for x in range(6) for _ in range(6)], [y for _ in range(6) for y in range(6)]
        shapes: dict[tuple[Segment, ...], Matrix] = {}  # equal flexures have one
        for k, e in enumerate(c.device.placed_elements):
            numbers = e.numbers(c.p)
            segments = e.section.segments(numbers, materials.get(getattr(e.section, "material", ""), SimpleNamespace()))
            back = 0.0 if segments else e.section.pivot(numbers)
            plain_numbers = all(isinstance(x, float) for segment in segments for x in vars(segment).values())
            shape = shapes.get(segments) if plain_numbers else None
            if segments and shape is None:
                shape = plain(ca.sparsify(ca.SX(beam(segments, ca.DM.eye(6), a, b))))
                shapes |= {segments: shape} if plain_numbers else {}
            parts.append((plain(c.ends[k] - back * c.frames[k][:, 0]), segments, shape))
        return parts

    def products(self, d: Matrix) -> Matrix:
        """(m,): d_i d_j, twice where i and j differ."""
        return self.weight * d[self.I] * d[self.J]

    def pose(self, d: Matrix) -> Matrix:
        """The second order of the pose (channels,) [SI] from the displacements `d`."""
        return ca.mtimes(self.output, self.products(d))

    def sensed(self, d: Matrix) -> Matrix:
        """(readings,): second order of the readings beside those of the output."""
        return ca.mtimes(self.readings, self.products(d))

    def restoring_force(self, d: Matrix, more: Callable[[Matrix], Matrix] | None = None) -> Matrix:
        """(n,): what the axes are pulled home with beside K d: dV_3/dd, and that of the energy that there is `more`, of d."""
        known = self._forces.setdefault(more, [])
        if not known:
            x = ca.SX.sym("d", self.n)
            V = ca.mtimes([x.T, self.cubic, self.products(x)])
            if more is not None:
                V += more(x)
            known.append((x, ca.gradient(V, x)))
        for at, force in known:
            if ca.is_equal(ca.SX(at), ca.SX(d)):
                return force
        known.append((d, ca.substitute(known[0][1], known[0][0], d)))
        return known[-1][1]

    @cached_property
    def output(self) -> Matrix:
        """(channels, m): second order of the pose per product."""
        device = self.c.device
        body = device.bodies.index(device.output.body)
        moved = self.seen(GROUND, body, self.c.output_point)[[TWIST.index(name) for name in device.output.channels], :]
        return self._without_rounding(moved, device.channel_scale)

    @cached_property
    def readings(self) -> Matrix:
        """(readings, m): second order of what the readings see per product, from the body on which each sensor stands."""
        return self._without_rounding(self._sensed_products, self.c.device.reading_scale)

    def sensed_reach(self) -> np.ndarray:
        """(readings,): the size of `sensed` at the largest travels [rad, m]."""
        seen = np.abs(ca.DM(ca.evalf(ca.SX(self._sensed_products))).full())
        return seen @ (self.weight.full().ravel() * np.abs(self._reach()))

    @cached_property
    def _sensed_products(self) -> Matrix:
        rows = [ca.SX(0, len(self.pairs))]
        for r, row in zip(self.c.device.placed_readings, self.c.reading_rows, strict=True):
            at = r.numbers(self.c.p).at
            point = ca.DM.zeros(3) if at is None else ca.mtimes(r.turn, ca.vertcat(*at))
            direction = row[:, :3] if at is None else row[:, 3:]
            seen = self.seen(r.first, r.second, point)
            rows.append(ca.mtimes(direction, seen[:3, :] if at is None else seen[3:, :]))
        return ca.vertcat(*rows)

    @cached_property
    def cubic(self) -> Matrix:
        """(n, m): V_3 = d' [cubic] products, the work of the loads of first order on the deformations of second."""
        cubic = (
            -ca.mtimes(self.c.stiffness.T, self.travels(self.I, self.J))
            if self.c.pushes
            else ca.SX(self.n, len(self.pairs))
        )
        for k in range(len(self.parts)):
            e = self.motions(k)
            for p, deformed in enumerate(ca.horzsplit(e.deformation(self.I, self.J))):
                cubic[:, p] += dot(e.load, ca.repmat(deformed, 1, self.n)).T
        return self._without_rounding(cubic, self._energies(1))

    @cached_property
    def quartic(self) -> Matrix:
        """(m, m): V_4 = products' [quartic] products: half the load on the deformations of second order, T_2 included, and the work of
        the loads of first order on what both orders together make; of uniform beams the square of their axial load."""
        m, n = len(self.pairs), self.n
        quartic = self._second_work
        columns = [(i, j, p) for p in range(m) for i in range(n) for j in range(n)]
        a, b = [i for i, _, _ in columns], [n + p for _, _, p in columns]
        turned = ca.SX(1, len(columns))
        for k in range(len(self.parts)):
            strained = self.strained[k]
            turned += 2 * dot(strained.load[:, a], strained.deformation([j for _, j, _ in columns], b))
            if len(segments := self.parts[k][1]) == 1:
                quartic += self._beam_column(segments[0], strained)
        if self.c.pushes:
            moved = self.travels([j for _, j, _ in columns], b, self.twists)
            turned -= 2 * ca.sum1(self.c.stiffness[:, a] * moved)
        for (i, j, p), value in zip(columns, ca.horzsplit(turned), strict=True):
            q = self.pairs.index((min(i, j), max(i, j)))
            quartic[q, p] += value / self.weight[q]
        return self._without_rounding((quartic + quartic.T) / 2, self._energies(2))

    @cached_property
    def strained(self) -> list[Motions]:
        """Every element in the n motions of first order and, behind them, the m of second: deformation and load of both orders."""
        found = []
        for k in range(len(self.parts)):
            e = self.motions(k, self.twists)
            E = e.relative[:, self.n :] + e.deformation(self.I, self.J)
            load = ca.mtimes(self.local_stiffness(k), E)
            relative = ca.horzcat(e.relative[:, : self.n], E)
            found.append(replace(e, relative=relative, load=ca.horzcat(e.load[:, : self.n], load)))
        return found

    @cached_property
    def stretching(self) -> Matrix:
        """(m, m): the part of V_4 that is stored in the deformations of second order, half the load on them."""
        return self._without_rounding(self._second_work, self._energies(2))

    @property
    def _second_work(self) -> Matrix:
        m = len(self.pairs)
        work = ca.SX(m, m)
        for e in self.strained:
            E, load = e.relative[:, self.n :], e.load[:, self.n :]
            for p, deformed in enumerate(ca.horzsplit(E)):
                work[:, p] += dot(load, ca.repmat(deformed, 1, m)).T / 2
        return (work + work.T) / 2

    @cached_property
    def twists(self) -> list[Matrix]:
        """(6, m) of each body: T_2, the axes held."""
        c, m, n = self.c, len(self.pairs), self.n
        unit = [ca.horzcat(ca.DM.eye(6), ca.DM(6, 6)), ca.horzcat(ca.DM(6, 6), ca.DM.eye(6))]
        axis, turned = [i for i in range(n) for _ in range(12)], [n + u for _ in range(n) for u in range(12)]
        p, u = [p for p in range(m) for _ in range(12)], [n + u for _ in range(m) for u in range(12)]
        I, J = [self.I[q] for q in p], [self.J[q] for q in p]
        with_I, with_J = ([12 * i + u for i in by for u in range(12)] for by in (self.I, self.J))
        loads: dict[int, Matrix] = {}

        def push(first: int, second: int, gradient: Matrix) -> None:
            """Puts the negative of a gradient (1, 12 m) by the twists of two bodies on them."""
            both = ca.reshape(gradient, 12, m)
            for body, part in ((first, both[:6, :]), (second, both[6:, :])):
                if body != GROUND:
                    loads[body] = loads.get(body, ca.SX(6, m)) - ca.vertcat(part[3:, :], part[:3, :])

        for k, placed in enumerate(c.elements):
            e = self.motions(k, between=unit)
            W, E, mixed = e.load, e.deformation(self.I, self.J), e.deformation(axis, turned)
            push(
                placed.first,
                placed.second,
                dot(W[:, u], E[:, p]) + dot(W[:, I], mixed[:, with_J]) + dot(W[:, J], mixed[:, with_I]),
            )
        moved = ca.SX(n, m)
        if c.pushes:
            moved = self.travels(self.I, self.J)
            for i, a in enumerate(c.device.placed_actuators):
                row = self._travel_of(i, a, axis, turned, between=unit)
                push(a.first, a.second, -c.stiffness[i, I] * row[:, with_J] - c.stiffness[i, J] * row[:, with_I])
        free = [plain(T) for T in mechanism.twists(len(c.device.bodies), c.elements, loads, c.device.size)]
        if not c.pushes:
            return free
        travelled = ca.vertcat(*(c.travel(i, free) for i in range(n)))
        return [T - ca.mtimes(T_1, travelled + moved) for T, T_1 in zip(free, self.first_order, strict=True)]

    def motions(self, k: int, more: list[Matrix] | None = None, between: list[Matrix] | None = None) -> Motions:
        """The twists of element k in the n motions of first order, and behind them in `more` (of every body) or in those
        `between` (of its two)."""
        c, e, n = self.c, self.c.elements[k], self.n
        added = between
        if more is not None:
            added = [ca.DM(6, more[0].shape[1]) if b == GROUND else more[b] for b in (e.first, e.second)]
        bodies = [ca.DM(6, n) if b == GROUND else self.first_order[b] for b in (e.first, e.second)]
        m = c.prescribed[k]
        deformed = c.relative_twist(k)[:, :n] - (0 if m is None else m[:, :n])
        if added is not None:
            bodies = [ca.horzcat(T, T_2) for T, T_2 in zip(bodies, added, strict=True)]
            deformed = ca.horzcat(deformed, added[1] - added[0])
        load, (place, _, shape) = ca.mtimes(plain(e.stiffness), plain(deformed)), self.parts[k]
        first, second = bodies
        return Motions(c.frames[k], place, shape, first, second, self.local(k, plain(deformed)), self.local(k, load))

    def local_stiffness(self, k: int) -> Matrix:
        """(6, 6) wrench on the free end of element k per twist of it, where the element is looked at, in its frame."""
        return plain(self.local(k, ca.mtimes(plain(self.c.elements[k].stiffness), self._global(k, ca.DM.eye(6)))))

    def local(self, k: int, twist: Matrix) -> Matrix:
        """A twist or wrench at the global origin as it is at element k, in its frame."""
        return ca.mtimes(inverse_adjoint(self.c.frames[k], self.parts[k][0]), twist)

    def _global(self, k: int, twist: Matrix) -> Matrix:
        return ca.mtimes(adjoint(self.c.frames[k], self.parts[k][0]), twist)

    def seen(self, first: int, second: int, point: Matrix) -> Matrix:
        """(6, m): second order of the rotation of a body and the displacement of its point, seen from another one."""
        seen = self._relative(point, first, second, self.I, self.J)
        at = inverse_adjoint(None, point)
        for body, sign in ((second, 1), (first, -1)):
            if body != GROUND:
                seen += sign * ca.mtimes(at, self.twists[body])
        return seen

    def _relative(
        self,
        point: Matrix,
        first: int,
        second: int,
        a: Sequence[int],
        b: Sequence[int],
        more: list[Matrix] | None = None,
        between: list[Matrix] | None = None,
    ) -> Matrix:
        """`relative_motion` of two bodies."""
        bodies = []
        for k, body in enumerate((first, second)):
            T = ca.DM(6, self.n) if body == GROUND else self.first_order[body]
            if between is not None:
                T = ca.horzcat(T, between[k])
            elif more is not None:
                T = ca.horzcat(T, ca.DM(6, more[0].shape[1]) if body == GROUND else more[body])
            bodies.append(T)
        return relative_motion(point, bodies[0], bodies[1], a, b)

    def travels(self, a: Sequence[int], b: Sequence[int], more: list[Matrix] | None = None) -> Matrix:
        """(n, m): what the rotations of bodies add to the travels of the actuators."""
        return ca.vertcat(*(self._travel_of(i, x, a, b, more) for i, x in enumerate(self.c.device.placed_actuators)))

    def _travel_of(
        self,
        i: int,
        placed: Placed,
        a: Sequence[int],
        b: Sequence[int],
        more: list[Matrix] | None = None,
        between: list[Matrix] | None = None,
    ) -> Matrix:
        """(1, m): that of actuator i, whose direction turns with the body against which it pushes."""
        moved = self._relative(self.c.point(placed), placed.first, placed.second, a, b, more, between)
        return ca.mtimes(self.c.directions[i].T, moved[3:, :])

    def _beam_column(self, s: Segment, e: Motions) -> Matrix:
        """(m, m): EI/l p^2 y' [third coefficients] y/2 of both planes, p = P l^2/EI, y = (displacement/l, rotation).

        Source: S. Awtar, A. H. Slocum, E. Sevincer, J. Mech. Des. 129 (2007) 625, eq. (5).
        """
        energy = ca.SX(len(self.pairs), len(self.pairs))
        for EI, shift, turn, sign in ((s.EI_z, 4, 2, 1), (s.EI_y, 5, 1, -1)):
            p, y = (
                e.load[0, :] * s.length**2 / EI,
                ca.vertcat(e.relative[shift, :] / s.length, sign * e.relative[turn, :]),
            )
            squares = ca.sum1(y[:, self.I] * ca.mtimes(AWTAR_2, y[:, self.J]))
            energy += EI / s.length / 2 * ca.mtimes((p[:, self.I] * p[:, self.J]).T, squares)
        return energy

    def _reach(self) -> np.ndarray:
        """(m,): products at the largest travels, each by its own sign."""
        travel = np.array([farthest(a.section.travel) for a in self.c.device.placed_actuators])
        return travel[self.I] * travel[self.J]

    def _energies(self, order: int) -> Any:
        """By which size the rows of `cubic` (1) and `quartic` (2) count: the stored energy over what each row is multiplied by."""
        travel = np.array([farthest(a.section.travel) for a in self.c.device.placed_actuators])
        K = self.c.stiffness
        if not ca.SX(K).is_constant():
            return None
        most = float(np.abs(ca.DM(ca.evalf(ca.SX(K))).full() @ travel @ travel))
        return tuple(most / (travel if order == 1 else self._reach()))

    def _without_rounding(self, forms: Matrix, scales: Any) -> Matrix:
        """The coefficients (., m) of products, those left out that are below a share `LOST` of the `scales` of their rows at the largest
        travel, where they are numbers: of a symmetric mechanism they are zero."""
        if scales is None or not ca.SX(forms).is_constant():
            return forms
        values = ca.DM(ca.evalf(ca.SX(forms))).full()
        small = np.abs(values) * self._reach() < LOST * np.asarray(scales)[:, None]
        return ca.sparsify(ca.DM(np.where(small, 0.0, values)))
