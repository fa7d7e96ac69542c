"""The equations of a mechanism: motion of all bodies per displacement of the actuated axes, and what follows from it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, Protocol

import casadi as ca
import numpy as np
from scipy.linalg import eigh

from ctrlgen.core.units import show, written_unit
from ctrlgen.devices.base import BalancedPhysics, Limit, Signal, rate_limit
from ctrlgen.devices.mechanism_elements import TWIST, Copied, Direction, Flexible, Placed
from ctrlgen.physics import mechanism
from ctrlgen.physics.mechanism import GROUND, Element
from ctrlgen.physics.screw import Matrix, adjoint, inverse, inverse_adjoint, move

INDEPENDENT = 1e-3  # singular value of unit rows below which a constraint adds nothing: no drawing is more exact
STILL = 1e-9  # m/m or rad/m: of the motion per actuator, below which it is rounding


class Drawing(Protocol):
    """What the equations need of a mechanism's description (`devices.mechanism.Mechanism`)."""

    actuator: tuple[Any, ...]
    material: tuple[Any, ...]
    element: tuple[Any, ...]
    output: Any

    @property
    def bodies(self) -> tuple[str, ...]:
        """The names of all bodies, copies with their number."""
        ...

    @property
    def placed_bodies(self) -> tuple[Copied, ...]:
        """Every copy of every body, by its number."""
        ...

    @property
    def placed_elements(self) -> tuple[Placed, ...]:
        """Every copy of every element."""
        ...

    @property
    def placed_actuators(self) -> tuple[Placed, ...]:
        """Every copy of every actuator."""
        ...

    @property
    def size(self) -> float:
        """The largest distance of an element's end from the origin [m]."""
        ...

    @property
    def channel_scale(self) -> tuple[float, ...]:
        """A typical size of each channel that is followed."""
        ...

    def values(self) -> SimpleNamespace:
        """Its numbers in SI."""
        ...


class Condensed:
    """The equations of a mechanism with the values `p`: motion of all bodies per displacement of the actuated axes."""

    def __init__(self, device: Drawing, p: SimpleNamespace) -> None:
        self.device, self.p = device, p
        self.pushes = device.actuator[0].kind == "force"
        materials = {m.name: q for m, q in zip(device.material, p.material, strict=True)}
        self.frames = [_right_handed(ca.mtimes(e.turn, e.section.frame)) for e in device.placed_elements]
        self.ends = [ca.mtimes(e.turn, ca.vertcat(*p.element[e.index].at)) for e in device.placed_elements]
        stiffness, self.compliances = [], []
        for e, R, end in zip(device.placed_elements, self.frames, self.ends, strict=True):
            own = p.element[e.index]
            C = e.section.compliance(own, materials.get(getattr(e.section, "material", ""), SimpleNamespace()))
            if float(ca.det(e.turn)) < 0:
                C = ca.mtimes([REFLECTED, C, -REFLECTED])
            self.compliances.append(C)
            stiffness.append(move(inverse(C), R, end))
        self.elements = [Element(e.first, e.second, K) for e, K in zip(device.placed_elements, stiffness, strict=True)]
        self.directions = [ca.mtimes(a.turn, _unit(a.section.along)) for a in device.placed_actuators]
        n = len(self.directions)
        loads: dict[int, Matrix] = {}

        def push(body: int, column: int, wrench: Matrix) -> None:
            if body != GROUND:
                loads.setdefault(body, ca.SX.zeros(6, n))[:, column] += wrench

        self.prescribed: list[Matrix | None] = [None] * len(self.elements)  # m (6, n) of each element
        for i, (a, direction) in enumerate(zip(device.placed_actuators, self.directions, strict=True)):
            if self.pushes:
                wrench = mechanism.point_force(self.point(a), direction)
                push(a.second, i, wrench)
                push(a.first, i, -wrench)
                continue
            k = next(k for k, e in enumerate(device.placed_elements) if e.name == self.moved(a))
            m = self.prescribed[k]
            m = ca.SX.zeros(6, n) if m is None else m
            m[3:, i] = direction
            self.prescribed[k] = m
            wrench = ca.mtimes(self.elements[k].stiffness, ca.vertcat(ca.DM.zeros(3, 1), direction))
            push(self.elements[k].second, i, wrench)
            push(self.elements[k].first, i, -wrench)
        per_input = mechanism.twists(len(device.bodies), self.elements, loads, device.size)
        if self.pushes:
            travel = ca.vertcat(*(self._travel(i, per_input) for i in range(n)))
            self.stiffness = ca.solve(travel, ca.DM.eye(n))  # [N/m] force per displacement of the axes
            self.twists = [ca.mtimes(T, self.stiffness) for T in per_input]
        else:
            self.stiffness, self.twists = ca.DM.eye(n), per_input

    def point(self, a: Placed) -> Matrix:
        """Where an actuator pushes [m]."""
        return ca.mtimes(a.turn, ca.vertcat(*self.p.actuator[a.index].at))

    def moved(self, a: Placed) -> str:
        """The name of the element that a displacement actuator moves."""
        return f"{a.section.on}_{a.copy}" if a.copy else a.section.on

    def _travel(self, i: int, twists: list[Matrix]) -> Matrix:
        """(1, n) travel of actuator i."""
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
        """(6, n): rotation and displacement of the output point per displacement of the actuated axes."""
        T = self.twists[self.device.bodies.index(self.device.output.body)]
        return ca.mtimes(inverse_adjoint(None, self.output_point), T)

    @property
    def jacobian(self) -> Matrix:
        """(channels, n): the components of `output_motion` that are followed."""
        return self.output_motion[[TWIST.index(c) for c in self.device.output.channels], :]

    @property
    def output_compliance(self) -> Matrix:
        """(6, 6) twist of the output point per wrench there, the drives held."""
        device, at = self.device, self.output_point
        k = device.bodies.index(device.output.body)
        T = mechanism.twists(len(device.bodies), self.held_elements(), {k: adjoint(None, at)}, device.size)
        return ca.mtimes(inverse_adjoint(None, at), T[k])

    def held_elements(self) -> list[Element]:
        """The elements, as they are with the drives held, and the stiffness of the actuators beside them."""
        added = []
        for i, a in enumerate(self.device.placed_actuators):
            k = self.p.actuator[a.index].stiffness
            if k is not None:
                point, n = self.point(a), self.directions[i]
                added.append(
                    Element(
                        a.first,
                        a.second,
                        k * ca.mtimes(mechanism.point_force(point, n), mechanism.point_motion(point, n)),
                    )
                )
        return self.elements + added

    def wrench(self, k: int) -> Matrix:
        """(6, n) load of element k per displacement of the axes, on its free end, in the global frame."""
        e = self.elements[k]
        T = [ca.SX.zeros(6, len(self.directions)) if b == GROUND else self.twists[b] for b in (e.second, e.first)]
        m = self.prescribed[k]
        return ca.mtimes(e.stiffness, T[0] - T[1] - (0 if m is None else m))

    def rotation(self, k: int) -> Matrix:
        """(1, n) rotation of element k about its z axis per displacement of the axes [rad/m]."""
        e = self.elements[k]
        turns = [0 if b == GROUND else self.twists[b][:3, :] for b in (e.second, e.first)]
        return ca.mtimes(self.frames[k][:, 2].T, turns[0] - turns[1])

    def stress(self, material: str, d: Matrix, floor: float) -> tuple[tuple[str, ...], Matrix]:
        """Of the flexures of a material: the names of the sections that are stressed most, and the largest stress there (m,) [Pa] with
        the axes displaced by `d` (n,) [m]; `floor` [Pa] as in `flexure.round_stress`."""
        names, stresses = [], []
        for k, e in enumerate(self.device.placed_elements):
            if getattr(e.section, "material", None) != material:
                continue
            own = self.p.element[e.index]
            for section in e.section.sections(own):
                place = self.ends[k] - section.back * self.frames[k][:, 0]
                load = ca.mtimes(inverse_adjoint(self.frames[k], place), self.wrench(k))
                parts = (ca.mtimes(part, d) for part in section.stresses(load))
                names.append(f"{e.name}_{section.name}")
                stresses.append(e.section.largest_stress(*parts, floor))
        return tuple(names), ca.vertcat(*stresses)

    def physics(self) -> BalancedPhysics:
        """As a device's physics."""
        device, actuators, p = self.device, self.device.placed_actuators, self.p
        n, axes = len(actuators), tuple(a.name for a in actuators)
        own = [p.actuator[a.index] for a in actuators]
        sections = [a.section for a in actuators]
        gain = ca.vertcat(*(q.gain for q in own))
        stack = ca.vertcat(*(0.0 if q.stiffness is None else q.stiffness for q in own))
        units = tuple(written_unit(s.low.text) for s in sections)
        sizes = tuple(max(abs(s.low.si), abs(s.high.si)) for s in sections)
        drive = Signal("drive", "drive", axes, units, "u_", ca.SX.sym("u", n), sizes)
        lags = [q.time_constant for q in own]
        lagging = all(tau is not None for tau in lags)  # all of them, or none
        state = Signal("state", "amplifier output", axes, units, "x_", ca.SX.sym("x", n), sizes) if lagging else None
        flexed = {e.material for e in device.element if isinstance(e, Flexible)}
        stressed = {m.name: m.stress_limit for m in device.material if m.stress_limit and m.name in flexed}
        force_unit = "N" if self.pushes else "um"
        travel = max(s.travel.si for s in sections)
        K, J = self.stiffness, self.jacobian

        def limits(signal: SimpleNamespace) -> list[Limit]:
            found = []
            for i, s in enumerate(sections):
                label = f"drive of {axes[i]}"
                found.append(
                    Limit(f"drive_{axes[i]}", label, (axes[i],), units[i], signal.drive[i], s.low.si, s.high.si)
                )
                if state is not None:
                    label = f"amplifier output of {axes[i]}"
                    found.append(
                        Limit(f"output_{axes[i]}", label, (axes[i],), units[i], signal.state[i], s.low.si, s.high.si)
                    )
                label, reach = f"travel of {axes[i]}", s.travel.si
                found.append(Limit(f"travel_{axes[i]}", label, (axes[i],), "um", signal.displacement[i], -reach, reach))
            for k, e in enumerate(device.placed_elements):
                most = getattr(e.section, "rotation_limit", None)
                if most is not None:
                    angle = ca.fabs(ca.mtimes(self.rotation(k), signal.mechanism_displacement))
                    found.append(
                        Limit(f"rotation_{e.name}", f"rotation of {e.name}", (e.name,), "deg", angle, None, most.si)
                    )
            for material, limit in stressed.items():
                names, stress = self.stress(material, signal.mechanism_displacement, 1e-9 * limit.si)
                found.append(Limit(f"stress_{material}", f"stress of {material}", names, "MPa", stress, None, limit.si))
            return found

        channels = device.output.channels
        turn = [c.startswith("theta") for c in channels]
        force_scale = float(max(abs(s.gain.si) * size for s, size in zip(sections, sizes, strict=True)))
        return BalancedPhysics(
            axes=axes, components=channels, pose_units=tuple("urad" if t else "um" for t in turn), pose_scale=device.channel_scale,
            drive=drive, state=state, rest=(0.0,) * (n if lagging else 0), displacement_scale=travel, force_scale=force_scale,
            force_unit=force_unit, bipolar=any(s.low.si < 0 for s in sections),
            rates=(lambda x, u: (u - x) / ca.vertcat(*lags)) if lagging else (lambda x, u: ca.SX(0, 1)),
            force=lambda u, x, d: gain * (x if lagging else u),
            restoring_force=lambda d: ca.mtimes(K, d) + stack * d,
            pose=lambda d: ca.mtimes(J, d), limits=limits,
            rate_limits=tuple(
                rate_limit(drive, i, s.rate[0].si, s.rate[1].si, written_unit(s.rate[1].text))
                for i, s in enumerate(sections) if s.rate is not None
            ),
        )  # fmt: skip


def _right_handed(frame: Matrix) -> Matrix:
    """A frame whose z axis completes x and y: that of a mirrored flexure is seen in its image of z otherwise."""
    return ca.horzcat(frame[:, :2], ca.cross(frame[:, 0], frame[:, 1]))


REFLECTED = ca.diag(ca.DM([-1, -1, 1, 1, 1, -1]))  # of a twist seen in the x-y plane's mirror; of a wrench its negative


def _unit(direction: Direction) -> Matrix:
    return ca.DM(np.array(direction) / np.linalg.norm(direction))


def freedoms(device: Drawing) -> tuple[int, int]:
    """(degrees of freedom, times over-constrained) of the mechanism without its actuators.

    Each flexure holds its stiff directions ideally, a blade three and a wire one: c rows A of relative twists of all bodies,
    6 n - rank(A) and c - rank(A). Source: J. B. Hopkins, M. L. Culpepper, Precis. Eng. 34 (2010) 259 (ideal constraints).
    """
    c = Condensed(device, device.values())
    count, rows = len(device.bodies), []
    turn = np.array([device.size] * 3 + [1.0] * 3)  # twists (theta; delta) as displacements, wrenches (M; F) as forces
    swap = [3, 4, 5, 0, 1, 2]
    yields = [turn[:, None] * ca.DM(ca.evalf(ca.SX(C))).full()[:, swap] * turn for C in c.compliances]
    largest = max(float(np.linalg.eigvalsh((C + C.T) / 2).max()) for C in yields)
    for k, e in enumerate(device.placed_elements):
        pivot = c.ends[k] - e.section.pivot(c.p.element[e.index]) * c.frames[k][:, 0]
        local = inverse_adjoint(c.frames[k], pivot)  # twist in the element's frame
        own = e.section.constrained(yields[k], largest) * turn
        A = np.zeros((len(own), 6 * count))
        held = own @ ca.DM(ca.evalf(ca.SX(local))).full()
        for body, sign in ((e.second, 1), (e.first, -1)):
            if body != GROUND:
                A[:, 6 * body : 6 * body + 6] = sign * held
        rows.append(A)
    A = np.vstack(rows) * np.tile([1 / device.size] * 3 + [1.0] * 3, count)
    A /= np.linalg.norm(A, axis=1, keepdims=True)
    rank = int(np.linalg.matrix_rank(A, tol=INDEPENDENT))
    return 6 * count - rank, len(A) - rank


def natural_frequencies(device: Drawing) -> np.ndarray:
    """The natural frequencies [Hz] with the drives held, ascending; empty where no body has a mass.

    K v = w^2 M v of all bodies, those without mass condensed first (which is exact): a stack counts with its stiffness, a force
    without one leaves its axis free, a prescribed displacement holds it.
    """
    c, p = Condensed(device, device.values()), device.values()
    count = len(device.bodies)
    K, M = np.zeros((6 * count, 6 * count)), np.zeros((6 * count, 6 * count))
    swap = np.r_[3:6, 0:3]  # a wrench as (moment; force) beside a twist: the stiffness is then symmetric
    for e in c.held_elements():
        k = ca.DM(ca.evalf(ca.SX(e.stiffness))).full()[swap]
        for i, j, sign in (
            (e.first, e.first, 1),
            (e.second, e.second, 1),
            (e.first, e.second, -1),
            (e.second, e.first, -1),
        ):
            if GROUND not in (i, j):
                K[6 * i : 6 * i + 6, 6 * j : 6 * j + 6] += sign * k
    heavy: list[int] = []
    for number, placed in enumerate(device.placed_bodies):
        own = p.body[placed.index]
        if own.mass is None:
            continue
        R = np.array(placed.turn)
        r = R @ np.array((0.0, 0.0, 0.0) if own.centre is None else own.centre)
        S = np.array(ca.DM(ca.skew(ca.DM(r))))
        about = R @ np.diag(own.inertia) @ R.T - own.mass * S @ S
        at = slice(6 * number, 6 * number + 6)
        M[at, at] = np.block([[about, own.mass * S], [-own.mass * S, own.mass * np.eye(3)]])
        heavy += range(at.start, at.stop)
    if not heavy:
        return np.zeros(0)
    scale = np.tile([1 / device.size] * 3 + [1.0] * 3, count)  # turns in displacements at the mechanism's size
    K, M = K * np.outer(scale, scale), M * np.outer(scale, scale)
    light = [i for i in range(6 * count) if i not in heavy]
    K_h = K[np.ix_(heavy, heavy)] - K[np.ix_(heavy, light)] @ np.linalg.solve(
        K[np.ix_(light, light)], K[np.ix_(light, heavy)]
    )
    squares = eigh((K_h + K_h.T) / 2, M[np.ix_(heavy, heavy)], eigvals_only=True)
    return np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi)


def summary(device: Drawing) -> list[str]:
    """What `ctrlgen check` prints of a mechanism: its parts, and how stiff it is at the output point."""
    c = Condensed(device, device.values())
    C = ca.DM(ca.evalf(ca.SX(c.output_compliance))).full()
    lines = [
        f"{len(device.bodies)} bodies, {len(device.placed_elements)} flexures, {len(device.placed_actuators)} actuators"
    ]
    free, over = freedoms(device)
    lines.append(f"degrees of freedom without actuators: {free}; redundant constraints: {over}")
    forces = ", ".join(f"{name} {show(1 / C[3 + i, i], 'N/um')}" for i, name in enumerate("xyz"))
    moments = ", ".join(f"{name} {show(1 / C[i, 3 + i], 'N*m/rad')}" for i, name in enumerate("xyz"))
    lines.append(f"stiffness at the output point: {forces}; about {moments}")
    if len(modes := natural_frequencies(device)):
        lines.append(f"natural frequencies with the drives held: {', '.join(show(f, 'Hz') for f in modes[:6])}")
    J = ca.DM(ca.evalf(ca.SX(c.jacobian))).full()
    for channel, row in zip(device.output.channels, J, strict=True):
        unit = "urad/um" if channel.startswith("theta") else "um/um"
        parts = ", ".join(
            f"{show(v, unit)} per {a.name}" for a, v in zip(device.placed_actuators, row, strict=True) if abs(v) > STILL
        )
        lines.append(f"{channel}: {parts or 'not moved'}")
    return lines
