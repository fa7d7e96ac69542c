"""What the loads of flexures that stretch do to bodies that have some freedom while the axes are held: they turn toward the tension."""

from __future__ import annotations

import itertools
from functools import cached_property

import casadi as ca
import numpy as np

from ctrlgen.devices.mechanism.second_order import LOST, SecondOrder, plain
from ctrlgen.devices.travel import farthest
from ctrlgen.physics import rigid_bodies
from ctrlgen.physics.rigid_bodies import GROUND
from ctrlgen.physics.screw import Matrix
from ctrlgen.physics.second_order_flexure import dot


class Yielding:
    """The twists T_3 of all bodies in the loads W_2 of second order: K T_3 = -d/dT (W_2 . e_2(T, T)) along T_1 d, the axes held. Of the
    energy that is -work/2 of sixth order, work = (loads) . T_3 = cubes' [stiffness] cubes, cubes d_i d_j d_k (q,)."""

    def __init__(self, second: SecondOrder) -> None:
        self.s = second
        self.triples = list(itertools.combinations_with_replacement(range(second.n), 3))

    def cubes(self, d: Matrix) -> Matrix:
        """(q,): d_i d_j d_k, i <= j <= k."""
        return ca.vertcat(*(d[i] * d[j] * d[k] for i, j, k in self.triples))

    def work(self, d: Matrix) -> Matrix:
        """Of the loads on T_3 [N m]."""
        cubes = self.cubes(d)
        return ca.mtimes([cubes.T, self.stiffness, cubes])

    def relative(self, k: int, d: Matrix) -> Matrix:
        """(6,) twist of the free end of element k against its fixed one by T_3, where it is looked at, in its frame."""
        e, cubes = self.s.c.elements[k], self.cubes(d)
        ends = [ca.DM(6, len(self.triples)) if b == GROUND else self.twists[b] for b in (e.second, e.first)]
        return ca.mtimes(plain(self.s.local(k, ends[0] - ends[1])), cubes)

    @cached_property
    def loads(self) -> dict[int, Matrix]:
        """(6, q) wrench at the global origin on each body that has one."""
        s, n, m = self.s, self.s.n, len(self.s.pairs)
        unit = [ca.horzcat(ca.DM.eye(6), ca.DM(6, 6)), ca.horzcat(ca.DM(6, 6), ca.DM.eye(6))]
        axis, turned = [i for i in range(n) for _ in range(12)], [n + u for _ in range(n) for u in range(12)]
        places = [(p, i) for p in range(m) for i in range(n)]
        pairs, mixed_at = [p for p, _ in places for _ in range(12)], [12 * i + u for _, i in places for u in range(12)]
        add_up = ca.DM(m * n, len(self.triples))
        for row, (p, i) in enumerate(places):
            a, b, c = sorted((*s.pairs[p], i))
            add_up[row, self.triples.index((a, b, c))] = s.weight[p]
        loads: dict[int, Matrix] = {}
        for k, placed in enumerate(s.c.elements):
            mixed = s.motions(k, between=unit).deformation(axis, turned)
            slope = 2 * dot(s.strained[k].load[:, [n + p for p in pairs]], mixed[:, mixed_at])
            both = ca.mtimes(ca.reshape(slope, 12, m * n), add_up)
            for body, part in ((placed.first, both[:6, :]), (placed.second, both[6:, :])):
                if body != GROUND:
                    loads[body] = plain(loads.get(body, ca.SX(*part.shape)) - ca.vertcat(part[3:, :], part[:3, :]))
        return loads

    @cached_property
    def twists(self) -> list[Matrix]:
        """(6, q) of each body."""
        s = self.s
        T = [plain(x) for x in rigid_bodies.twists(len(s.c.device.bodies), s.c.elements, self.loads, s.c.device.size)]
        if not s.c.pushes:
            return T
        travelled = ca.vertcat(*(s.c.travel(i, T) for i in range(s.n)))
        return [plain(x - ca.mtimes(first, travelled)) for x, first in zip(T, s.first_order, strict=True)]

    @cached_property
    def stiffness(self) -> Matrix:
        """(q, q) of `work`; rounding left out where it is numbers."""
        q = len(self.triples)
        work = plain(sum((ca.mtimes(W.T, _swapped(self.twists[b])) for b, W in self.loads.items()), ca.SX(q, q)))
        work = (work + work.T) / 2
        if not isinstance(work, ca.DM):
            return work
        travel = np.array([farthest(a.section.travel) for a in self.s.c.device.placed_actuators])
        reach = np.array([travel[list(triple)].prod() for triple in self.triples])
        values, K = work.full(), np.abs(ca.DM(ca.evalf(ca.SX(self.s.c.stiffness))).full())
        return ca.sparsify(
            ca.DM(np.where(np.abs(values) * np.outer(reach, reach) < LOST * (travel @ K @ travel), 0.0, values))
        )


def _swapped(twist: Matrix) -> Matrix:
    return ca.vertcat(twist[3:, :], twist[:3, :])
