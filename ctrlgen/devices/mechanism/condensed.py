"""The equations of a mechanism: motion of all bodies per displacement of the actuated axes, and what follows from it."""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np

from ctrlgen.devices.mechanism.copies import Placed
from ctrlgen.devices.mechanism.drawing import Drawing
from ctrlgen.devices.mechanism.ported_parts import ported_parts
from ctrlgen.devices.place import Direction
from ctrlgen.devices.travel import farthest
from ctrlgen.numerics.newton import newton_root
from ctrlgen.physics import rigid_bodies as mechanism
from ctrlgen.physics.flexure_mass import flexure_mass
from ctrlgen.physics.rigid_bodies import GROUND, Element
from ctrlgen.physics.screw import TWIST, WRENCH, Matrix, adjoint, inverse_adjoint, move

# Of Newton's method from the motion without cubic springs: with more steps they hold more than the flexures do.
MOST_STEPS = 12
ROUNDING = 1e-14  # of the stretch: what an iteration leaves
KEPT = 2  # drawings: one, and what it would be with something more
SPARE_STEPS = 2  # for numbers that differ from the file's, as in a diagnosis


_recent: deque[tuple[Drawing, Condensed]] = deque(maxlen=KEPT)


@dataclass(frozen=True)
class CubicSpring:
    """A force k_3 e^3 in element number `element`, e = `row` (1, 6) on its relative twist; `wrench` (6, 1) of a unit of it on the
    second body, both at the global origin."""

    element: int
    row: Matrix
    wrench: Matrix
    k3: Any


class Condensed:
    """The equations of a mechanism with the values `p`: motion of all bodies per load q = (d, g) of the actuated axes.

    d (n,) are the displacements of the axes, g (m,) the forces k_3 e^3 of the cubic springs (`loads`). By superposition, with the
    axes held at d, the springs are stretched by e = A d + B g, B the negative of the compliance that they then see. `twists` (6, n + m)
    are the motions of the bodies per q.
    """

    def __init__(self, device: Drawing, p: SimpleNamespace) -> None:
        self.device, self.p = device, p
        self.pushes = device.actuator[0].kind != "displacement"
        self.materials = {m.name: q for m, q in zip(device.material, p.material, strict=True)}
        self.frames = [_right_handed(ca.mtimes(e.turn, e.section.frame)) for e in device.placed_elements]
        self.ends = [ca.mtimes(e.turn, ca.vertcat(*e.numbers(p).at)) for e in device.placed_elements]
        self.compliances: list[Matrix | None] = []  # about their free ends, in their frames; None of springs
        self.elements: list[Element] = []
        self.cubics: list[CubicSpring] = []
        for k, (e, R, end) in enumerate(zip(device.placed_elements, self.frames, self.ends, strict=True)):
            numbers = e.numbers(p)
            C = e.section.compliance(numbers, self.materials.get(getattr(e.section, "material", ""), SimpleNamespace()))
            if C is not None and float(ca.det(e.turn)) < 0:
                C = ca.mtimes([REFLECTED, C, -REFLECTED])
            self.compliances.append(C)
            self.elements.append(Element(e.first, e.second, move(e.section.stiffness(C, numbers), R, end)))
            for place, k3 in e.section.cubic_terms(numbers).items():
                row, wrench = inverse_adjoint(R, end)[place, :], adjoint(R, end)[:, (place + 3) % 6]
                self.cubics.append(CubicSpring(k, row, wrench, k3))
        self.ported = ported_parts(device, p)
        self.joints = [*self.elements, *(pair for part in self.ported for pair in part.pairs)]
        self.directions = [
            self.frames[self.element_of(a)][:, 0]
            if a.section.kind == "thermal"
            else ca.mtimes(a.turn, _unit(a.section.along))
            for a in device.placed_actuators
        ]
        n, columns = len(self.directions), len(self.directions) + len(self.cubics)
        loads: dict[int, Matrix] = {}

        def push(body: int, column: int, wrench: Matrix) -> None:
            if body != GROUND:
                loads.setdefault(body, ca.SX.zeros(6, columns))[:, column] += wrench

        self.prescribed: list[Matrix | None] = [None] * len(self.elements)  # m (6, n + m) of each element
        for j, spring in enumerate(self.cubics):
            push(self.elements[spring.element].second, n + j, -spring.wrench)
            push(self.elements[spring.element].first, n + j, spring.wrench)
        for i, (a, direction) in enumerate(zip(device.placed_actuators, self.directions, strict=True)):
            if self.pushes:
                wrench = mechanism.point_force(self.point(a), direction)
                push(a.second, i, wrench)
                push(a.first, i, -wrench)
                continue
            k = self.element_of(a)
            m = self.prescribed[k]
            m = ca.SX.zeros(6, columns) if m is None else m
            m[3:, i] = direction
            self.prescribed[k] = m
            wrench = ca.mtimes(self.elements[k].stiffness, ca.vertcat(ca.DM.zeros(3, 1), direction))
            push(self.elements[k].second, i, wrench)
            push(self.elements[k].first, i, -wrench)
        per_input = mechanism.twists(len(device.bodies), self.joints, loads, device.size)
        self.stiffness, self.beside = ca.DM.eye(n), ca.DM.zeros(n, columns - n)
        self.twists = per_input
        if self.pushes:
            travel = ca.vertcat(*(self.travel(i, per_input) for i in range(n)))
            self.stiffness = ca.solve(travel[:, :n], ca.DM.eye(n))  # [N/m] force per displacement of the axes
            self.beside = -ca.mtimes(self.stiffness, travel[:, n:])  # (n, m) force on the axes per g, the axes held
            self.twists = [
                ca.horzcat(ca.mtimes(T[:, :n], self.stiffness), T[:, n:] + ca.mtimes(T[:, :n], self.beside))
                for T in per_input
            ]
        stretch = [ca.mtimes(spring.row, self.relative_twist(spring.element)) for spring in self.cubics]
        self.stretch = ca.vertcat(ca.SX(0, columns), *stretch)  # (m, n + m): [A, B]

    def loads(self, d: Matrix) -> Matrix:
        """q = (d, g) (n + m,): g = k_3 e^3 where e = A d + B g, by the steps of Newton's method that the drawing needs."""
        n, m = len(self.directions), len(self.cubics)
        if not m:
            return d
        k3 = ca.vertcat(*(spring.k3 for spring in self.cubics))
        e, alone = ca.SX.sym("e", m), ca.mtimes(self.stretch[:, :n], d)
        residual = e - alone - ca.mtimes(self.stretch[:, n:], k3 * e**3)
        return ca.vertcat(d, k3 * newton_root(residual, e, alone, self.device.cubic_steps) ** 3)

    def cubic_steps(self) -> int | None:
        """How many steps of Newton's method find the stretch of the cubic springs to rounding wherever the axes are within their
        travels (looked at in every corner and halfway); None where `MOST_STEPS` do not."""
        n = len(self.directions)
        AB = ca.DM(ca.evalf(ca.SX(self.stretch))).full()
        k3 = np.array([float(spring.k3) for spring in self.cubics])
        travel = np.array([farthest(a.section.travel) for a in self.device.placed_actuators])
        needed = 0
        for corner in itertools.product((-1.0, -0.5, 0.5, 1.0), repeat=n):
            alone = AB[:, :n] @ (travel * corner)
            e, steps = alone.copy(), 0
            while np.abs(r := e - alone - AB[:, n:] @ (k3 * e**3)).max() > ROUNDING * np.abs(alone).max():
                if steps == MOST_STEPS or not np.all(np.isfinite(e)):
                    return None
                e, steps = e - np.linalg.solve(np.eye(len(e)) - AB[:, n:] * (3 * k3 * e**2), r), steps + 1
            needed = max(needed, steps)
        return needed

    def relative_twist(self, k: int) -> Matrix:
        """(6, n + m) twist of the free end of element k against its fixed one, per q, at the global origin."""
        e = self.elements[k]
        T = [ca.SX.zeros(*self.twists[0].shape) if b == GROUND else self.twists[b] for b in (e.second, e.first)]
        return T[0] - T[1]

    @property
    def held_stiffness(self) -> Matrix:
        """(n, n) force on the axes per displacement of them at home, with that of the actuators beside their force."""
        stiffnesses = [getattr(a.numbers(self.p), "stiffness", None) for a in self.device.placed_actuators]
        return self.stiffness + ca.diag(ca.vertcat(*(0.0 if k is None else k for k in stiffnesses)))

    def restoring_force(self, d: Matrix) -> Matrix:
        """(n,) force that pulls the axes home from `d` (n,), that of cubic springs included."""
        linear, n = ca.mtimes(self.held_stiffness, d), len(self.directions)
        return linear + ca.mtimes(self.beside, self.loads(d)[n:, :]) if self.cubics else linear

    def body_mass(self, number: int) -> Matrix | None:
        """(6, 6) of a body and what stands on it, twist -> (angular momentum; momentum) at the global origin; None without a mass."""
        placed = self.device.placed_bodies[number]
        numbers = placed.numbers(self.p)
        if numbers.mass is None:
            return None
        R, centre = placed.turn, ca.DM.zeros(3) if numbers.centre is None else ca.vertcat(*numbers.centre)
        total = _inertia(numbers.mass, ca.mtimes(R, centre), ca.mtimes([R, ca.diag(ca.vertcat(*numbers.inertia)), R.T]))
        for load in self.device.placed_loads:
            carried = load.numbers(self.p)
            if load.second == number and carried.mass is not None:
                total += _inertia(carried.mass, self.load_point(load), ca.DM(3, 3))
        return total

    def flexure_mass(self, k: int, first: Matrix, second: Matrix) -> Matrix | None:
        """(m, m) of element k whose ends move by the twists `first` and `second` (6, m); None of one without a mass: those that are not
        beams, and whose material states no density."""
        e = self.device.placed_elements[k]
        material = self.materials.get(getattr(e.section, "material", ""))
        if material is None or material.density is None:
            return None
        segments, load = (
            e.section.segments(e.numbers(self.p), material),
            ca.mtimes(self.elements[k].stiffness, second - first),
        )
        if not segments:
            return None
        return flexure_mass(segments, material.density, self.frames[k], self.ends[k], first, load)

    @property
    def mass(self) -> Matrix:
        """(n, n) mass of the axes: that of all bodies and flexures moving as they do at rest with the axes displaced, at home.

        Source: R. J. Guyan, AIAA J. 3 (1965) 380.
        """
        n = len(self.directions)
        M = ca.SX.zeros(n, n)
        for number, T in enumerate(self.twists):
            if (inertia := self.body_mass(number)) is not None:
                M += ca.mtimes([T[:, :n].T, inertia, T[:, :n]])
        for k, e in enumerate(self.elements):
            first, second = (ca.SX.zeros(6, n) if b == GROUND else self.twists[b][:, :n] for b in (e.first, e.second))
            if (inertia := self.flexure_mass(k, first, second)) is not None:
                M += inertia
        axes = [T[:, :n] for T in self.twists]
        return M + sum((part.kinetic(axes) for part in self.ported if part.mass is not None), ca.SX.zeros(n, n))

    def point(self, a: Placed) -> Matrix:
        """Where an actuator pushes [m]: a heater at the end of its bar."""
        if a.section.kind == "thermal":
            return self.ends[self.element_of(a)]
        return ca.mtimes(a.turn, ca.vertcat(*a.numbers(self.p).at))

    def load_point(self, load: Placed) -> Matrix:
        """Where a load acts [m]: where nothing is stated at the output point."""
        at = load.numbers(self.p).at
        return self.output_point if at is None else ca.mtimes(load.turn, ca.vertcat(*at))

    def element_of(self, a: Placed) -> int:
        """The number of the element that an actuator moves or heats."""
        return self.element_named(a.section.on, a.copy)

    def element_named(self, name: str, copy: int) -> int:
        """The number of an element, of a pattern that of its `copy`."""
        whole = f"{name}_{copy}" if copy else name
        return next(k for k, e in enumerate(self.device.placed_elements) if e.name == whole)

    def travel(self, i: int, twists: list[Matrix]) -> Matrix:
        """(1, m) travel of actuator i in the motions `twists` (6, m) of all bodies."""
        a = self.device.placed_actuators[i]
        row = mechanism.point_motion(self.point(a), self.directions[i])
        ends = [ca.mtimes(row, twists[b]) if b != GROUND else 0 for b in (a.second, a.first)]
        return ends[0] - ends[1]

    @property
    def output_point(self) -> Matrix:
        """(3,) the point that is followed [m]."""
        return ca.vertcat(*self.p.output.at)

    @property
    def output_motion(self) -> Matrix:
        """(6, n + m): rotation and displacement of the output point per q."""
        T = self.twists[self.device.bodies.index(self.device.output.body)]
        return ca.mtimes(inverse_adjoint(None, self.output_point), T)

    @property
    def jacobian(self) -> Matrix:
        """(channels, n + m): the components of `output_motion` that are followed."""
        return self.output_motion[self.channel_rows, :]

    @property
    def channel_rows(self) -> list[int]:
        """The places in a twist of the components that are followed."""
        return [TWIST.index(name) for name in self.device.output.channels]

    @property
    def reading_rows(self) -> list[Matrix]:
        """(1, 6) of each reading beside those of the output: what it sees of a body's twist [m, rad]; nothing where it is of a load."""
        rows = []
        for r in self.device.placed_readings:
            if r.section.of is not None:
                rows.append(ca.DM.zeros(1, 6))
                continue
            direction, at = ca.mtimes(r.turn, _unit(r.section.direction)), r.numbers(self.p).at
            row = ca.horzcat(direction.T, ca.DM.zeros(1, 3))
            if at is not None:
                row = mechanism.point_motion(ca.mtimes(r.turn, ca.vertcat(*at)), direction)
            elif float(ca.det(r.turn)) < 0:
                row = -row  # the mirror image of a turn is one about the image of its axis, the other way round
            rows.append(row)
        return rows

    def load_row(self, r: Placed) -> tuple[int, Matrix]:
        """The element whose load a reading is of, and its row (1, 6) of a wrench on the free end at the global origin."""
        k = self.element_named(r.section.of, r.copy)
        return k, inverse_adjoint(self.frames[k], self.ends[k])[WRENCH.index(r.section.load or "F_x"), :]

    @property
    def reading_motion(self) -> Matrix:
        """(readings, n + m): what the readings beside those of the output see per q [m, rad, N, N m]."""
        rows = [ca.SX(0, self.twists[0].shape[1])]
        for r, row in zip(self.device.placed_readings, self.reading_rows, strict=True):
            if r.section.of is not None:
                k, of_wrench = self.load_row(r)
                rows.append(ca.mtimes(of_wrench, self.wrench(k)))
                continue
            ends = [ca.mtimes(row, self.twists[b]) if b != GROUND else 0 for b in (r.second, r.first)]
            rows.append(ends[0] - ends[1])
        return ca.vertcat(*rows)

    @property
    def output_compliance(self) -> Matrix:
        """(6, 6) twist of the output point per wrench there, the drives held."""
        device, at = self.device, self.output_point
        k = device.bodies.index(device.output.body)
        T = mechanism.twists(len(device.bodies), self.held_elements(), {k: adjoint(None, at)}, device.size)
        return ca.mtimes(inverse_adjoint(None, at), T[k])

    def held_elements(self) -> list[Element]:
        """All that joins bodies, as it is with the drives held, and the stiffness of the actuators beside it."""
        added = []
        for i, a in enumerate(self.device.placed_actuators):
            k = getattr(a.numbers(self.p), "stiffness", None)
            if k is not None:
                point, n = self.point(a), self.directions[i]
                added.append(
                    Element(
                        a.first,
                        a.second,
                        k * ca.mtimes(mechanism.point_force(point, n), mechanism.point_motion(point, n)),
                    )
                )
        return self.joints + added

    def wrench(self, k: int) -> Matrix:
        """(6, n + m) load of element k per q, on its free end, in the global frame."""
        m = self.prescribed[k]
        return ca.mtimes(self.elements[k].stiffness, self.relative_twist(k) - (0 if m is None else m))

    def rotation(self, k: int) -> Matrix:
        """(1, n + m) rotation of element k about its z axis per q [rad/m, rad/N]."""
        return ca.mtimes(self.frames[k][:, 2].T, self.relative_twist(k)[:3, :])

    def stress(
        self,
        material: str,
        d: Matrix,
        floor: float,
        extra_load: Callable[[int, Any, Matrix], Matrix] | None = None,
        constant: Callable[[int], Matrix] | None = None,
        sheared: bool = False,
    ) -> tuple[tuple[str, ...], Matrix]:
        """Of the flexures of a material: the names of the sections that are stressed most, and the largest stress there (m,) [Pa] with
        the axes displaced by `d` (n,) [m]; `floor` [Pa] as in `flexure.round_stress`, `extra_load` beside the linear one as in
        `stretching.Stretching`, `constant` wrench on the free end of an element, at the global origin, as in `loads.Loads`; `sheared`: the
        stress inside of the sections, where transverse shear is largest."""
        names, stresses, q = [], [], self.loads(d)
        for k, e in enumerate(self.device.placed_elements):
            if getattr(e.section, "material", None) != material:
                continue
            numbers = e.numbers(self.p)
            for section in e.section.sections(numbers):
                place = self.ends[k] - section.back * self.frames[k][:, 0]
                to_place = inverse_adjoint(self.frames[k], place)
                load = ca.mtimes(ca.mtimes(to_place, self.wrench(k)), q)
                if constant is not None:
                    load += ca.mtimes(to_place, constant(k))
                if extra_load is not None:
                    load += extra_load(k, section.back, d)
                names.append(f"{e.name}_{section.name}")
                *bent, torsion = section.stresses(load)
                inside = e.section.sheared_stress(bent, torsion, section.mean_shear(load)) if sheared else None
                stresses.append(e.section.largest_stress(*bent, torsion, floor) if inside is None else inside)
        return tuple(names), ca.vertcat(*stresses)


def nominal(device: Drawing) -> Condensed:
    """The equations with the numbers of the drawing; those of the last drawings are kept, as much of a summary asks for them."""
    for known, c in _recent:
        if known is device:
            return c
    c = Condensed(device, device.values())
    _recent.append((device, c))
    return c


def _inertia(mass: Any, at: Matrix, about_centre: Matrix) -> Matrix:
    """(6, 6) of a mass with its centre at `at`, twist -> (angular momentum; momentum) at the global origin."""
    S = ca.skew(at)
    about = about_centre - mass * ca.mtimes(S, S)
    return ca.vertcat(ca.horzcat(about, mass * S), ca.horzcat(-mass * S, mass * ca.DM.eye(3)))


def _right_handed(frame: Matrix) -> Matrix:
    """A frame whose z axis completes x and y: that of a mirrored flexure is seen in its image of z otherwise."""
    return ca.horzcat(frame[:, :2], ca.cross(frame[:, 0], frame[:, 1]))


REFLECTED = ca.diag(ca.DM([-1, -1, 1, 1, 1, -1]))  # of a twist seen in the x-y plane's mirror; of a wrench its negative


def _unit(direction: Direction) -> Matrix:
    return ca.DM(np.array(direction) / np.linalg.norm(direction))
