"""What follows from a mechanism's equations at home: degrees of freedom, natural frequencies, and the lines that describe it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np
import scipy

from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import Fault
from ctrlgen.core.units import show
from ctrlgen.devices.mechanism.condensed import KEPT, Condensed, nominal
from ctrlgen.devices.mechanism.drawing import Drawing
from ctrlgen.devices.mechanism.joining import STIFF
from ctrlgen.devices.mechanism.linear_range import range_lines
from ctrlgen.devices.mechanism.load_effects import load_lines
from ctrlgen.devices.mechanism.loads import Loads
from ctrlgen.devices.mechanism.point_compliance import point_compliance
from ctrlgen.devices.mechanism.ported_parts import on_bodies, part_line, stored_motions
from ctrlgen.devices.mechanism.second_order import SecondOrder
from ctrlgen.devices.mechanism.springs import Spring
from ctrlgen.devices.travel import farthest
from ctrlgen.physics.rigid_bodies import GROUND
from ctrlgen.physics.screw import inverse_adjoint

SHORT_CHAIN = 10  # bodies: of a chain of n the weakest independent constraint has a singular value of 1.5/n^2
INDEPENDENT = 1e-3  # singular value of unit rows below which a constraint adds nothing: no drawing is more exact
FREE = 1e-6  # of the largest singular value, below which springs hold nothing: symmetry leaves rounding, 1e-9
INERT = 1e-9  # of the largest mass of an axis, below which rounding moves it and no body
MASSLESS = 1e-13  # of the largest mass of all bodies: rounding of a motion without any
FAR = 0.1  # of a frequency: as far as mass and stiffness of a drawing are from the built one's, roughly
LIKE = 0.5  # of the modal assurance criterion: below it a condensed mode is no single mode
NAMED = 8  # elements in a line
STILL = 1e-9  # m/m or rad/m: of the motion per actuator, below which it is rounding


def freedoms(device: Drawing) -> tuple[int, int]:
    """(degrees of freedom, times over-constrained) of the mechanism without its actuators.

    Each flexure holds its stiff directions ideally, a blade three and a wire one: c rows A of relative twists of all bodies,
    6 n - rank(A) and c - rank(A). Source: J. B. Hopkins, M. L. Culpepper, Precis. Eng. 34 (2010) 259 (ideal constraints).
    """
    stressed = _in_balance(nominal(device))
    rank = len(stressed) - stressed.shape[1]
    return 6 * len(device.bodies) - rank, len(stressed) - rank


def redundant_constraints(device: Drawing) -> dict[str, list[str]]:
    """Of each element the directions that could be left out without another freedom: those that take part in a set of forces in balance
    without a load. Those with a direction of their own, as of a stated compliance, are counted: "constraint 1"."""
    _, names = constraints(nominal(device))
    stressed = _in_balance(nominal(device))
    found: dict[str, list[str]] = {}
    for (element, direction), row in zip(names, stressed, strict=True):
        if np.linalg.norm(row) > INDEPENDENT:
            found.setdefault(element, []).append(direction)
    return found


@lru_cache(maxsize=KEPT)
def _in_balance(c: Condensed) -> np.ndarray:
    """(c, redundant) the sets of forces on the constraints that are in balance without a load, of unit size."""
    A, _ = constraints(c)
    if not len(A):
        return np.zeros((0, 0))
    U, values, _ = np.linalg.svd(A)
    least = INDEPENDENT * min(1.0, (SHORT_CHAIN / len(c.device.bodies)) ** 2)
    return np.asarray(U[:, int((values > least).sum()) :])


@lru_cache(maxsize=KEPT)
def constraints(c: Condensed) -> tuple[np.ndarray, list[tuple[str, str]]]:
    """(c, 6 bodies) unit rows of what the flexures hold of the twists of all bodies, turns counted as displacements, and (element,
    direction) of each."""
    names: list[tuple[str, str]] = []
    device = c.device
    count, rows = len(device.bodies), []
    turn = np.array([device.size] * 3 + [1.0] * 3)  # twists (theta; delta) as displacements, wrenches (M; F) as forces
    swap = [3, 4, 5, 0, 1, 2]
    yields = {
        k: turn[:, None] * ca.DM(ca.evalf(ca.SX(C))).full()[:, swap] * turn
        for k, C in enumerate(c.compliances)
        if C is not None
    }
    stored = [stored_motions(s, device.size) for s in device.placed_super_elements]
    largest = max((float(np.linalg.eigvalsh((C + C.T) / 2).max()) for C in yields.values()), default=0.0)
    largest = max([largest, *(float(1 / values.min()) for values, _ in stored)])
    for k, e in enumerate(device.placed_elements):
        if k not in yields:
            continue  # a spring holds nothing
        pivot = c.ends[k] - e.section.pivot(e.numbers(c.p)) * c.frames[k][:, 0]
        local = inverse_adjoint(c.frames[k], pivot)  # twist in the element's frame
        directions = e.section.constrained(yields[k], largest) * turn
        A = np.zeros((len(directions), 6 * count))
        held = directions @ ca.DM(ca.evalf(ca.SX(local))).full()
        for body, sign in ((e.second, 1), (e.first, -1)):
            if body != GROUND:
                A[:, 6 * body : 6 * body + 6] = sign * held
        rows.append(A)
        held_by = e.section.ideal or [f"constraint {i + 1}" for i in range(len(A))]
        names += [(e.name, direction) for direction in held_by]
    for s, (values, motions) in zip(device.placed_super_elements, stored, strict=True):
        stiff = motions[1 / values < STIFF * largest]
        rows.append(on_bodies(s, stiff, count))
        names += [(s.name, f"constraint {i + 1}") for i in range(len(stiff))]
    A = np.vstack([np.zeros((0, 6 * count)), *rows]) * np.tile([1 / device.size] * 3 + [1.0] * 3, count)
    return A / np.linalg.norm(A, axis=1, keepdims=True), names


def free_between_springs(device: Drawing) -> list[str]:
    """Bodies that can move without a force, because what joins them are springs, or super-elements with joints inside."""
    if not device.super_element and not any(isinstance(e.section, Spring) for e in device.placed_elements):
        return []
    count, c = len(device.bodies), nominal(device)
    size = np.array([1 / device.size] * 3 + [1.0] * 3)  # turns as displacements
    rows = []
    for e, R, end in zip(device.placed_elements, c.frames, c.ends, strict=True):
        held = e.section.directions if isinstance(e.section, Spring) else range(6)
        local = ca.DM(inverse_adjoint(R, end)).full()[list(held)] * size / size[list(held), None]
        row = np.zeros((len(local), 6 * count))
        for body, sign in ((e.second, 1), (e.first, -1)):
            if body != GROUND:
                row[:, 6 * body : 6 * body + 6] = sign * local
        rows.append(row)
    stored = (on_bodies(s, stored_motions(s, device.size)[1], count) for s in device.placed_super_elements)
    rows += [row * np.tile(size, count) for row in stored]
    _, values, motions = np.linalg.svd(np.vstack([*rows, np.zeros((6 * count, 6 * count))]))
    free = motions[values < FREE * values.max()]
    return [name for i, name in enumerate(device.bodies) if np.abs(free[:, 6 * i : 6 * i + 6]).max(initial=0) > FREE]


@dataclass(frozen=True, eq=False)
class Modes:
    """Natural `frequencies` (k,) [Hz], ascending, and the `motions` (6 bodies, k) of all bodies in them, twists at the origin with turns
    counted as displacements; `mass` (6 bodies, 6 bodies) in the same units."""

    frequencies: np.ndarray
    motions: np.ndarray
    mass: np.ndarray

    def likeness(self, other: Modes) -> np.ndarray:
        """(k, k') modal assurance criterion, 1 for the same motion. Source: R. J. Allemang, D. L. Brown, Proc. IMAC 1 (1982) 110."""
        size = [np.einsum("ij,ik,kj->j", m.motions, self.mass, m.motions) for m in (self, other)]
        return (self.motions.T @ self.mass @ other.motions) ** 2 / np.outer(*size)


def natural_frequencies(device: Drawing) -> np.ndarray:
    """The natural frequencies [Hz] with the drives held, ascending; empty where no body has a mass."""
    return free_modes(device).frequencies


def free_modes(device: Drawing) -> Modes:
    """All modes with the drives held; none where no body has a mass.

    K v = w^2 M v of all bodies, those without mass condensed first (which is exact), flexures with mass bent as at rest between their
    ends: a stack counts with its stiffness, a force
    without one leaves its axis free, a prescribed displacement holds it. Cubic springs count with their slope at home, none.
    """
    c = nominal(device)
    count = len(device.bodies)
    K, M, heavy = body_matrices(c)
    if not heavy:
        return Modes(np.zeros(0), np.zeros((6 * count, 0)), M)
    with_mass, without = _massive(c, M, heavy)
    follows = -np.linalg.solve(without.T @ K @ without, without.T @ K @ with_mass)
    moved = with_mass + without @ follows
    K_h = with_mass.T @ K @ moved
    squares, shapes = scipy.linalg.eigh((K_h + K_h.T) / 2, with_mass.T @ M @ with_mass)
    motions = moved @ shapes
    return Modes(np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi), motions, M)


def _massive(c: Condensed, M: np.ndarray, heavy: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """Bases (6 bodies, .) of the motions with mass and without: those of the bodies with mass and of the others; where the matrix of a
    super-element leaves a motion of a body without mass, as lumped ones do turns, the eigenvectors of M."""
    unit = np.eye(len(M))
    light = [i for i in range(len(M)) if i not in heavy]
    if all(part.mass is None for part in c.ported):
        return unit[:, heavy], unit[:, light]
    masses, directions = np.linalg.eigh(M[np.ix_(heavy, heavy)])
    some = masses > MASSLESS * masses.max()
    return unit[:, heavy] @ directions[:, some], np.hstack([unit[:, light], unit[:, heavy] @ directions[:, ~some]])


def guyan_modes(device: Drawing, under_loads: bool = False) -> Modes:
    """The modes of the model with inertia, whose bodies move as they do at rest: as many as actuators; none where the actuators prescribe
    displacements, or move no mass in some direction. `under_loads`: with what constant loads change of the stiffness of the axes."""
    c = nominal(device)
    M, heavy = _mass(c)
    n = len(device.placed_actuators)
    moved = np.vstack([ca.DM(ca.evalf(ca.SX(T[:, :n]))).full() for T in c.twists]) / as_displacements(device)[:, None]
    inert = moved.T @ M @ moved
    if not (c.pushes and heavy) or np.linalg.eigvalsh(inert).min() <= INERT * np.linalg.eigvalsh(inert).max():
        return Modes(np.zeros(0), moved[:, :0], M)
    K = ca.DM(ca.evalf(ca.SX(c.held_stiffness))).full()
    if under_loads:
        K += ca.DM(Loads(c, SecondOrder(c)).stiffness).full()
    squares, shapes = scipy.linalg.eigh((K + K.T) / 2, inert)
    return Modes(np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi), moved @ shapes, M)


@lru_cache(maxsize=KEPT)
def body_matrices(c: Condensed) -> tuple[np.ndarray, np.ndarray, list[int]]:
    """Stiffness with the drives held and mass (6 bodies, 6 bodies) of all bodies, turns counted as displacements; rows with mass."""
    count = len(c.device.bodies)
    K = np.zeros((6 * count, 6 * count))
    M, heavy = _mass(c)
    swap = np.r_[3:6, 0:3]  # a wrench as (moment; force) beside a twist: the stiffness is then symmetric
    for e in c.held_elements():
        k = ca.DM(ca.evalf(ca.SX(e.stiffness))).full()[swap]
        for i, j, on_i in (
            (e.first, e.first, k.T),
            (e.second, e.second, k),
            (e.first, e.second, -k.T),
            (e.second, e.first, -k),
        ):
            if GROUND not in (i, j):
                K[6 * i : 6 * i + 6, 6 * j : 6 * j + 6] += on_i
    scale = as_displacements(c.device)
    return K * np.outer(scale, scale), M, heavy


def as_displacements(device: Drawing) -> np.ndarray:
    """(6 bodies,) by which a twist is multiplied where turns are counted as displacements at the mechanism's size."""
    return np.tile([1 / device.size] * 3 + [1.0] * 3, len(device.bodies))


@lru_cache(maxsize=KEPT)
def _mass(c: Condensed) -> tuple[np.ndarray, list[int]]:
    """The mass matrix of all bodies, turns counted as displacements, and its rows that are not zero."""
    count = len(c.device.bodies)
    M = np.zeros((6 * count, 6 * count))
    heavy: set[int] = set()
    for i in range(count):
        if (inertia := c.body_mass(i)) is not None:
            M[6 * i : 6 * i + 6, 6 * i : 6 * i + 6] = ca.DM(ca.evalf(ca.SX(inertia))).full()
            heavy |= {i}
    for k, e in enumerate(c.elements):
        if (inertia := c.flexure_mass(k, ca.DM.eye(12)[:6, :], ca.DM.eye(12)[6:, :])) is not None:
            both = ca.DM(ca.evalf(ca.SX(inertia))).full()
            ends = [(b, slice(6 * at, 6 * at + 6)) for at, b in enumerate((e.first, e.second)) if b != GROUND]
            for i, row in ends:
                for j, column in ends:
                    M[6 * i : 6 * i + 6, 6 * j : 6 * j + 6] += both[row, column]
            heavy |= {i for i, _ in ends}
    for part in c.ported:
        if part.mass is not None:
            rows = np.concatenate([np.arange(6 * b, 6 * b + 6) for b in part.bodies])
            M[np.ix_(rows, rows)] += ca.DM(ca.evalf(ca.SX(part.mass))).full()
            heavy |= {*part.bodies}
    scale = as_displacements(c.device)
    return M * np.outer(scale, scale), [6 * i + n for i in sorted(heavy) for n in range(6)]


def summary(device: Drawing) -> list[str]:
    """What `ctrlgen check` prints of a mechanism: its parts, and how stiff it is at the output point."""
    c = nominal(device)
    C = ca.DM(ca.evalf(ca.SX(c.output_compliance))).full()
    springs, ported = sum(C is None for C in c.compliances), len(c.ported)
    lines = [
        f"{number_of(len(device.bodies), 'body', 'bodies')}, {number_of(len(c.elements) - springs, 'flexure')}, "
        + (f"{number_of(springs, 'spring')}, " if springs else "")
        + (f"{number_of(ported, 'super-element')}, " if ported else "")
        + number_of(len(device.placed_actuators), "actuator")
    ]
    lines += [part_line(s) for s in device.super_element]
    free, over = freedoms(device)
    lines.append(f"degrees of freedom without actuators: {free}; redundant constraints: {over}")
    if over:
        named = [f"{name} {', '.join(held)}" for name, held in redundant_constraints(device).items()]
        more = f"; and of {len(named) - NAMED} more" if len(named) > NAMED else ""
        lines.append(f"{over} among these are redundant: {'; '.join(named[:NAMED])}{more}")
    forces = ", ".join(f"{name} {show(1 / C[3 + i, i], 'N/um')}" for i, name in enumerate("xyz"))
    moments = ", ".join(f"{name} {show(1 / C[i, 3 + i], 'N*m/rad')}" for i, name in enumerate("xyz"))
    lines.append(f"stiffness at the output point: {forces}; about {moments}")
    centre = point_compliance(device).centre_of_compliance
    lines.append(f"centre of compliance: ({', '.join(show(x, 'mm') for x in centre)})")
    if len((whole := free_modes(device)).frequencies):
        shown = ", ".join(show(f, "Hz") for f in whole.frequencies[:6])
        lines.append(f"natural frequencies with the drives held: {shown}")
    condensed, left_out = condensed_modes(device, whole)
    if condensed:
        used = "solved with it" if device.dynamics is not None else "a table [dynamics] solves with it"
        more = "" if left_out is None else f"; first mode left out: {show(left_out, 'Hz')}"
        lines.append(f"inertia condensed to the actuators (Guyan; {used}): {', '.join(map(str, condensed))}{more}")
        if device.load or device.gravity:
            loaded = ", ".join(show(float(f), "Hz") for f in guyan_modes(device, under_loads=True).frequencies)
            lines.append(f"the same under the constant loads: {loaded}")
    seen = ca.vertcat(c.jacobian, c.reading_motion)[:, : len(device.placed_actuators)]
    units = ["urad" if name.startswith("theta") else "um" for name in device.output.channels]
    units += [r.section.unit for r in device.placed_readings]
    names = [*device.output.channels, *(r.name for r in device.placed_readings)]
    for channel, told, row in zip(names, units, ca.DM(ca.evalf(ca.SX(seen))).full(), strict=True):
        unit = f"{told}/um"
        parts = ", ".join(
            f"{show(v, unit)} per {a.name}" for a, v in zip(device.placed_actuators, row, strict=True) if abs(v) > STILL
        )
        lines.append(f"{channel}: {parts or 'not moved to first order'}")
    return lines + (_second_order_lines(c) if device.second_order else []) + load_lines(device) + range_lines(device)


def _second_order_lines(c: Condensed) -> list[str]:
    """What the second order adds to the channels that are followed, at the largest travels, whatever their signs."""
    second = SecondOrder(c)
    output = np.abs(ca.DM(ca.evalf(ca.SX(second.output))).full())
    travel = np.array([farthest(a.section.travel) for a in c.device.placed_actuators])
    reach = np.abs(ca.DM(second.products(ca.DM(travel))).full()).ravel()
    units = {r.name: r.section.unit for r in c.device.placed_readings}
    names = (*c.device.output.channels, *units)
    shown = (
        f"{name} {show(value, units.get(name, 'urad' if name.startswith('theta') else 'um'))}"
        for name, value in zip(names, (*(output @ reach), *second.sensed_reach()), strict=True)
    )
    return [f"second order at the largest travels, at most: {', '.join(shown)}"]


@dataclass(frozen=True)
class CondensedMode:
    """A mode of the model with inertia [Hz], and the mode of all bodies that is like it; None where it is not like one alone."""

    frequency: float
    whole: float | None

    def __str__(self) -> str:
        if self.whole is None:
            return f"{show(self.frequency, 'Hz')} (no single mode of the whole)"
        off = 100 * (self.frequency / self.whole - 1)
        return f"{show(self.frequency, 'Hz')} ({off:+.2g} % of {show(self.whole, 'Hz')})"


def condensed_modes(device: Drawing, whole: Modes | None = None) -> tuple[tuple[CondensedMode, ...], float | None]:
    """How far the modes of the bodies moving as at rest are from their modes, and the first mode [Hz] that is left out."""
    full, reduced = whole or free_modes(device), guyan_modes(device)
    if not len(reduced.frequencies):
        return (), None
    like = reduced.likeness(full)
    partner = like.argmax(axis=1)
    modes = tuple(
        CondensedMode(float(f), float(full.frequencies[k]) if of[k] > LIKE else None)
        for f, of, k in zip(reduced.frequencies, like, partner, strict=True)
    )
    return modes, next((float(f) for k, f in enumerate(full.frequencies) if k not in partner), None)


def inertia_remarks(device: Drawing) -> list[str]:
    """Modes of the model with inertia that are far from those of the bodies."""
    modes, _ = condensed_modes(device) if device.dynamics is not None else ((), None)
    far = [str(m) for m in modes if m.whole is None or abs(m.frequency / m.whole - 1) > FAR]
    return [f"the bodies do not move as at rest in the modes {', '.join(far)}: drive them far slower"] if far else []


def inertia_faults(device: Drawing) -> list[Fault]:
    """What keeps the table `dynamics` from being of use."""
    if device.actuator[0].kind == "thermal":
        return [
            Fault(
                "dynamics", "belongs to actuators that push by force; a heater is far slower than its mechanism rings"
            )
        ]
    if device.actuator[0].kind == "displacement":
        return [
            Fault(
                "dynamics",
                "inertia needs actuators that push; one that prescribes a displacement takes whatever force it needs",
            )
        ]
    if not len(guyan_modes(device).frequencies):
        return [
            Fault(
                "dynamics",
                "the actuators move no mass in some direction; give mass and inertia to the bodies that they move",
            )
        ]
    return []
