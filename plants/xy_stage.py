"""One axis of an X-Y stage at large displacement: levers and guides on notches, driven through the lever.

Where a number or a place comes from:

- Four arms of length e_4 between notch centres stand along y between frame and plate: two levers, at
  x = -a, driven at e_3 from their root by the bar, and two guides at x = +a (S1 sections 3.3-3.4; Figs. 5 and
  6 are lost, a and b are reconstructions of the device file and do not matter for a symmetric load).
- Notch, S1 eq. (7): a half circle of radius r, so its elastic centre is its middle (printed: 7.105/0.178 =
  39.92 of 40 um). There it is diagonal: theta_z/M_z = 0.178 rad/(N um), and in shear 301 - 7.105^2/0.178 = 17.4 um/N,
  in z 42.6 - 0.8015^2/0.0201 = 10.6 um/N. The bend is spread over 2 sqrt(r w_4), where the neck is
  at most twice its smallest width; the rest of the notch is rigid, its compliance being in eq. (7).
- Arm: beam of section w_5 x h, bending and twisting as such. `arm="straight"` softens its axial stiffness so that an
  arm has k_a/2 (S1 section 4.2; a half stage holds two arms side by side); `arm="z"` keeps the true EA and
  shifts the two halves of the beam sideways by +s and -s with s^2 l/EI + l/EA = the same axial
  compliance, which is where a Z-shaped beam gets it from.
- Actuator, S1 eq. (6): the 2 n beams as one spring between frame and bar, built here from beam formulas.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np

from plants.frame import Array, Equilibrium, Frame, Link, Node, Pose, about_z, skew

Arm = Literal["straight", "z"]
HOME = Pose(np.zeros(3), np.eye(3))


@dataclass(frozen=True)
class Options:
    """`beam_elements` per lever or guide; `arm` see the module; `ideal` > 0 divides all compliances but theta_z by it.

    With a large `ideal` (1e3) only kinematics, notch rotation and the actuator's spring remain, as in S1 eq. (9).
    `rigid_axial` False keeps k_a in spite of `ideal`, as in S1 eq. (11).
    """

    beam_elements: int = 4
    arm: Arm = "straight"
    ideal: float = 1.0
    rigid_axial: bool = True


def actuator_stiffness(a: Any) -> Array:
    """Stiffness (6, 6), order (u, theta) [N/um, N, N um], of the 2 n beams about the middle of their row, x along the bar.

    A clamped-guided beam at +-(90 deg - theta) to the bar: EA/l along it, 12 EI/l^3 across, 4 EI/l in
    bending and 6 EI/l^2 between them; K(x, x) is S1's K^t(1, 4) = 0.0133374 N/um.
    """
    l, w, h, E = a.beam_length, a.beam_width, a.thickness, a.young
    t, b = min(w, h), max(w, h)
    G = E / 2 / (1 + a.poisson)
    GJ = G * b * t**3 * (1 / 3 - 0.21 * t / b * (1 - (t / b) ** 4 / 12))
    EI_z, EI_y = E * h * w**3 / 12, E * w * h**3 / 12
    beam = np.diag([E * w * h / l, 12 * EI_z / l**3, 12 * EI_y / l**3, GJ / l, 4 * EI_y / l, 4 * EI_z / l])
    beam[1, 5] = beam[5, 1] = -6 * EI_z / l**2
    beam[2, 4] = beam[4, 2] = 6 * EI_y / l**2
    pitch = a.beam_gap + a.bar_width / 2
    n = round(a.beams)
    K = np.zeros((6, 6))
    for i in range(1, n + 1):
        for angle, side in ((np.pi / 2 + a.beam_angle, -1), (-np.pi / 2 - a.beam_angle, 1)):
            R = about_z(angle)
            turn = np.kron(np.eye(2), R)
            p = np.array([-pitch * (i - (n + 1) / 2), side * a.bar_half_height, 0.0])
            carry = np.block([[np.eye(3), -skew(p)], [np.zeros((3, 3)), np.eye(3)]])  # motion at p of a twist at 0
            K += carry.T @ turn @ beam @ turn.T @ carry
    return K


def notch_section(s: Any, length: float, ideal: float = 1.0) -> Array:
    """D (6,) of a link of `length` [um] with the compliances of S1 eq. (7) about the notch's middle."""
    n = s.notch
    z = (n.theta_z_per_F_y + n.delta_y_per_M_z) / 2
    y = (n.theta_y_per_F_z + n.delta_z_per_M_y) / 2
    soft = np.array(
        [
            n.delta_x_per_F_x,
            n.delta_y_per_F_y - z**2 / n.theta_z_per_M_z,
            n.delta_z_per_F_z - y**2 / n.theta_y_per_M_y,
            n.theta_x_per_M_x,
            n.theta_y_per_M_y,
            n.theta_z_per_M_z,
        ]
    )
    soft[:5] /= ideal
    return length / soft


def bend_length(s: Any, neck: float = 7.0) -> float:
    """2 sqrt(r w_4) [um]: where w_4 + x^2/r < 2 w_4. w_4 = 7 um: S1 Table 1."""
    return 2 * np.sqrt(s.notch_radius * neck)


def arm_section(s: Any, a: Any, o: Options) -> tuple[tuple[float, float, float, float], float]:
    """(EA, GJ, EI_y, EI_z) of the arm's beam, and the sideways shift s of its halves [um]."""
    w, h, E = s.lever_width, a.thickness, a.young
    t, b = min(w, h), max(w, h)
    G = E / 2 / (1 + a.poisson)
    GJ = G * b * t**3 * (1 / 3 - 0.21 * t / b * (1 - (t / b) ** 4 / 12))
    EI_z, EI_y, EA = E * h * w**3 / 12, E * w * h**3 / 12, E * w * h
    length = s.lever_long - 2 * s.notch_radius
    axial = 2 / s.half_stage_stiffness - 2 * s.notch.delta_x_per_F_x  # um/N
    if o.arm == "z":
        return (EA, GJ, EI_y, EI_z), float(np.sqrt((axial - length / EA) * EI_z / length))
    if not o.rigid_axial:  # the notches' share has been divided away by `ideal`
        return (length / (2 / s.half_stage_stiffness), GJ * o.ideal, EI_y * o.ideal, EI_z * o.ideal), 0.0
    return tuple(o.ideal * x for x in (length / axial, GJ, EI_y, EI_z)), 0.0


@dataclass(frozen=True)
class Axis:
    """Handles of one axis in a frame: `bar`, `plate`, the loads of the force pair, and the notch links."""

    bar: Node
    plate: Node
    push: int
    react: int | None
    notches: list[Link]


def add_axis(f: Frame, parent: Node, plate: Node, at: Pose, numbers: SimpleNamespace, o: Options) -> Axis:
    """Build one axis between `parent` and `plate`; `at`: pose of the axis, x the direction of motion."""
    s, a = numbers.stage, numbers.actuator
    r, bend = s.notch_radius, bend_length(s)
    section, shift = arm_section(s, a, o)
    notches: list[Link] = []

    def notch(start: Node) -> Node:
        notches.append(f.link(start, f.node(start.home.at(x=bend)), notch_section(s, bend, o.ideal)))
        return notches[-1].end

    bar = f.node(at.at(x=-s.plate_half_length - _row_middle(a)))
    f.spring(parent, bar, actuator_stiffness(a))
    for side in (1, -1):
        root_y = side * (s.plate_half_width + s.lever_long)
        for x, driven in ((-s.plate_half_length, True), (s.plate_half_length, False)):
            root = at.at(x=x, y=root_y, turn_z=-side * np.pi / 2)  # local x along the arm, toward the plate
            end = notch(f.attach(parent, root.at(x=-bend / 2)))
            end = f.attach(end, end.home.at(x=r - bend / 2))
            to_drive = s.lever_short - r if driven else (s.lever_long - 2 * r) / 2
            length = s.lever_long - 2 * r
            if shift:
                first = f.attach(end, end.home.at(y=side * shift))
                if driven:
                    first = f.beam(first, to_drive, section, 1)[-1].end
                    drive_node = first
                    first = f.beam(first, length / 2 - to_drive, section, max(1, o.beam_elements // 2))[-1].end
                else:
                    first = f.beam(first, length / 2, section, max(1, o.beam_elements // 2))[-1].end
                second = f.attach(first, first.home.at(y=-2 * side * shift))
                second = f.beam(second, length / 2, section, max(1, o.beam_elements // 2))[-1].end
                end = f.attach(second, second.home.at(y=side * shift))
            else:
                end = f.beam(end, to_drive, section, 1)[-1].end
                drive_node = end
                end = f.beam(end, length - to_drive, section, o.beam_elements)[-1].end
            end = f.attach(end, end.home.at(x=r - bend / 2))
            f.fix(plate, notch(end))
            if driven:
                tip = at.at(x=x - bend / 2, y=side * (s.plate_half_width + s.lever_long - s.lever_short))
                f.fix(drive_node, notch(f.attach(bar, tip)))
    push = f.load(bar, bar.home)
    react = f.load(parent, bar.home) if parent.index >= 0 else None
    return Axis(bar, plate, push, react, notches)


def _row_middle(a: Any) -> float:
    """Distance [um] from the end of the bar to the middle of the row of beams."""
    return (a.beam_gap + a.bar_width / 2) * (round(a.beams) + 1) / 2


class Stage:
    """One axis on ground, motion along x. `solve(force)` gives the plate's displacement."""

    def __init__(self, numbers: SimpleNamespace, options: Options | None = None) -> None:
        self.numbers = numbers
        self.frame = Frame()
        self.plate = self.frame.node(HOME)
        o = options or Options()
        self.axis = add_axis(self.frame, self.frame.ground, self.plate, HOME, numbers, o)
        self._plate_load = self.frame.load(self.plate, HOME)
        self.frame.assemble(1e-9 * o.ideal)

    def solve(self, force: float, plate_force: Array | None = None, start: Equilibrium | None = None) -> Equilibrium:
        """Equilibrium under `force` [N] on the bar and `plate_force` (3,) [N] on the plate."""
        loads = np.zeros((2, 3))
        loads[self.axis.push, 0] = force
        loads[self._plate_load] = 0 if plate_force is None else plate_force
        return self.frame.solve(loads, start=start)

    def displacement(self, state: Equilibrium) -> float:
        """Displacement of the plate along x [um]."""
        return float(state.moved(self.plate)[0][0])

    def bar_travel(self, state: Equilibrium) -> float:
        """Displacement of the bar along x [um]."""
        return float(state.moved(self.axis.bar)[0][0])

    def path(self, forces: Array) -> list[Equilibrium]:
        """Equilibria along increasing `forces` [N], each begun at the one before."""
        states: list[Equilibrium] = []
        for force in forces:
            states.append(self.solve(float(force), start=states[-1] if states else None))
        return states

    def force_for(self, displacement: float, start: Equilibrium | None = None) -> tuple[float, Equilibrium]:
        """Bar force [N] that holds the plate at `displacement` [um] (secant, to 1e-9 um), and the equilibrium."""
        force = 2e-3 * displacement
        state = self.solve(force, start=start)
        d = self.displacement(state)
        slope = d / force if force else 500.0
        for _ in range(30):
            if abs(d - displacement) < 1e-9:
                return force, state
            step = (displacement - d) / slope
            state = self.solve(force + step, start=state)
            moved = self.displacement(state) - d
            slope, force, d = (moved / step if step else slope), force + step, d + moved
        raise RuntimeError(f"no bar force found for a displacement of {displacement} um")
