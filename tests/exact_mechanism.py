"""A mechanism file as geometrically exact beams between rigid bodies at finite rotations, by Exudyn: what the expansions of
`ctrlgen.devices.mechanism.second_order` are compared with. Lengths in um, forces in N."""

from __future__ import annotations

import numpy as np
from mechanism_files import dm
from scipy.spatial.transform import Rotation

from ctrlgen.devices.mechanism.condensed import Condensed
from ctrlgen.physics.rigid_bodies import GROUND
from plants.frame import Equilibrium, Frame, Node, Pose

UM = 1e6
# The drawing is turned by it: a beam along an axis may be singular
WORLD = Rotation.from_rotvec([0.3, -0.4, 0.5]).as_matrix()


def rigidity(section, p, m) -> list[tuple[float, tuple[float, float, float, float]]]:
    """(length [um], (EA, GJ, EI_y, EI_z) [N, N um^2]) of the pieces of a blade, wire or strut, from its drawing."""
    E, G = m.young, m.young / (2 * (1 + m.poisson))

    def round_(d: float) -> tuple[float, float, float, float]:
        I = np.pi * d**4 / 64
        return E * np.pi * d**2 / 4, G * 2 * I * UM**2, E * I * UM**2, E * I * UM**2

    if section.kind == "wire":
        return [(p.length * UM, round_(p.diameter))]
    if section.kind == "strut":
        wire = (p.wire_length * UM, round_(p.wire_diameter))
        return [wire, ((p.length - 2 * p.wire_length) * UM, round_(p.rod_diameter)), wire]
    t, w = p.thickness, p.width
    J = w * t**3 * (1 / 3 - 0.21 * t / w * (1 - (t / w) ** 4 / 12))
    return [(p.length * UM, (E * t * w, G * J * UM**2, E * t * w**3 / 12 * UM**2, E * w * t**3 / 12 * UM**2))]


class ExactMechanism:
    """The bodies of a mechanism whose actuators push from the ground, or move the bases of matrix elements, and whose other elements are
    blades, wires, struts and springs to the ground; `parts` elements a piece of a beam."""

    def __init__(self, device, parts: int = 8) -> None:
        self.device, self.frame, p = device, Frame(), device.values()
        c, frame = Condensed(device, p), self.frame
        self.bodies = [frame.node(Pose(np.zeros(3), WORLD)) for _ in device.bodies]
        self.bases: list[Node] = []
        materials = {m.name: q for m, q in zip(device.material, p.material, strict=True)}
        moved = [a.section.on for a in device.placed_actuators if a.section.kind == "displacement"]
        for k, e in enumerate(device.placed_elements):
            R, end, own = WORLD @ dm(c.frames[k]), WORLD @ dm(c.ends[k]).ravel() * UM, p.element[e.index]
            bodies = [frame.ground if b == GROUND else self.bodies[b] for b in (e.first, e.second)]
            if e.section.kind in ("matrix", "spring"):
                K = dm(e.section.stiffness(c.compliances[k], own))  # (F, M) per (theta, delta), in its frame, in m
                K = (
                    K[:, [3, 4, 5, 0, 1, 2]]
                    * np.array([1 / UM] * 3 + [1.0] * 3)
                    * np.array([1.0] * 3 + [UM] * 3)[:, None]
                )
                both, home = np.kron(np.eye(2), WORLD.T @ R), Pose(end, WORLD)
                base = frame.node(home)
                (frame.hold if e.name in moved else lambda node, to=bodies[0]: frame.fix(to, node))(base)
                self.bases += [base] if e.name in moved else []
                frame.spring(base, frame.attach(bodies[1], home), both @ K @ both.T)
                continue
            pieces = rigidity(e.section, own, materials[e.section.material])
            start = frame.attach(bodies[0], Pose(end - R[:, 0] * sum(length for length, _ in pieces), R))
            for length, stiffness in pieces:
                start = frame.beam(start, length, stiffness, parts)[-1].end
            frame.fix(bodies[1], start)
        for a in device.placed_actuators:
            if a.section.kind == "force":  # its direction stays, while the body turns
                frame.load(self.bodies[a.second], Pose(WORLD @ dm(c.point(a)).ravel() * UM, WORLD), turns=False)
        self.directions = [WORLD @ dm(n).ravel() for n in c.directions]
        self.points = [dm(c.point(a)).ravel() for a in device.placed_actuators if a.section.kind == "force"]
        frame.assemble(tolerance=1e-3)  # N um: rounding in the stiff directions of a blade leaves 1e-4

    def pushed(self, forces, steps: int = 8) -> Equilibrium:
        """Equilibrium under `forces` (n,) [N] of the actuators, approached in `steps`, each begun where the last three lead to."""
        loads, reached = np.array([f * n for f, n in zip(forces, self.directions, strict=True)]), [0.0]
        for k in range(1, steps + 1):
            past = reached[-3:]
            start = {1: [1.0], 2: [-1.0, 2.0], 3: [1.0, -3.0, 3.0]}[len(past)]
            guess = sum(w * q for w, q in zip(start, past, strict=True))
            state = self.frame.solve(loads * k / steps, start=guess if k > 1 else None)
            reached.append(state.coordinates)
        return state

    def stroked(self, strokes) -> Equilibrium:
        """Equilibrium at `strokes` (n,) [m] of the bases: those of two actuators on one element add up."""
        held = {id(base): np.zeros(6) for base in self.bases}
        names = list(dict.fromkeys(a.section.on for a in self.device.placed_actuators))
        for s, a, n in zip(strokes, self.device.placed_actuators, self.directions, strict=True):
            held[id(self.bases[names.index(a.section.on)])][:3] += s * UM * n
        return self.frame.solve(held=np.array(list(held.values())))

    def output(self, state: Equilibrium) -> np.ndarray:
        """(6,) rotation vector [rad] and displacement [m] of the output point."""
        number = self.device.bodies.index(self.device.output.body)
        shift, turn = self.moved(state, number, np.array([x.si for x in self.device.output.at]))
        return np.concatenate([turn, shift])

    def moved(self, state: Equilibrium, body: int, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Displacement [m] of a point of a body, and the body's rotation vector [rad]."""
        shift, turn = (WORLD.T @ v for v in state.moved(self.bodies[body]))
        return shift / UM + Rotation.from_rotvec(turn).apply(point) - point, turn

    def travel(self, state: Equilibrium) -> np.ndarray:
        """(n,) [m]: displacement of the points that are pushed, along the push."""
        moved = [
            self.moved(state, a.second, point)[0] @ WORLD.T @ n
            for a, n, point in zip(self.device.placed_actuators, self.directions, self.points, strict=True)
        ]
        return np.array(moved)
