"""Natural modes of a mechanism at home: of all bodies, and of the model with inertia, whose bodies move as they do at rest."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np
import scipy

from ctrlgen.core.errors import Fault
from ctrlgen.core.percent import percent
from ctrlgen.core.units import show
from ctrlgen.devices.mechanism.condensed import KEPT, Condensed, nominal
from ctrlgen.devices.mechanism.drawing import Drawing
from ctrlgen.devices.mechanism.loads import Loads
from ctrlgen.devices.mechanism.second_order import SecondOrder
from ctrlgen.physics.rigid_bodies import GROUND

INERT = 1e-9  # of the largest mass of an axis, below which rounding moves it and no body
MASSLESS = 1e-13  # of the largest mass of all bodies: rounding of a motion without any
ROUNDING = 1e-8  # of a frequency: what two eigenvalue problems of one structure differ by; a mode that is condensed differs by more
FAR = 0.1  # of a frequency: as far as mass and stiffness of a drawing are from the built one's, roughly
LIKE = 0.5  # of the modal assurance criterion: below it a condensed mode is no single mode
EQUAL = 1e-4  # of a frequency: half-power width of a resonance in metal (damping ratio 5e-5), closer than which two modes are one


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


@dataclass(frozen=True)
class CondensedMode:
    """A mode of the model with inertia [Hz], and the mode of all bodies that is like it; None where it is not like one alone."""

    frequency: float
    whole: float | None

    def __str__(self) -> str:
        if self.whole is None:
            return f"{show(self.frequency, 'Hz')} (no single mode of the whole)"
        off = self.frequency / self.whole - 1
        if abs(off) < ROUNDING:
            return f"{show(self.frequency, 'Hz')} (that of the bodies)"
        return f"{show(self.frequency, 'Hz')} ({percent(off, sign=True)} of {show(self.whole, 'Hz')})"


def condensed_modes(device: Drawing, whole: Modes | None = None) -> tuple[tuple[CondensedMode, ...], float | None]:
    """How far the modes of the bodies moving as at rest are from their modes, and the first mode [Hz] that is left out."""
    full, reduced = whole or free_modes(device), guyan_modes(device)
    return compared(reduced, full) if len(reduced.frequencies) else ((), None)


def compared(reduced: Modes, full: Modes) -> tuple[tuple[CondensedMode, ...], float | None]:
    """Each mode of a `reduced` model with that of the `full` one that it is like, no two with the same; the first [Hz] that none is like.

    Modes of equal frequency, whose directions are any, count together. A motion that is held to some shapes is never slower than the
    slowest mode in it (Rayleigh): where it is slower than a mode, others share the motion, and it is not like that one alone.
    """
    f, own = full.frequencies, reduced.frequencies
    equal = np.abs(f[:, None] - f) <= EQUAL * f
    like = np.where(f <= (1 + EQUAL) * own[:, None], reduced.likeness(full) @ equal, 0.0)
    _, partner = scipy.optimize.linear_sum_assignment(like, maximize=True)
    alike = like[np.arange(len(own)), partner] > LIKE
    modes = tuple(
        CondensedMode(float(g), float(f[k]) if alone else None) for g, k, alone in zip(own, partner, alike, strict=True)
    )
    return modes, next((float(g) for k, g in enumerate(f) if k not in partner[alike]), None)


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
