"""Lengths, angles and senses of S0's kinematic model, fitted to what the paper prints of it.

The Jacobian of such a hexapod tells only three numbers from one another: strut ends may slide along their strut, on either
side, and one more change of radii, angles and heights together leaves it as it is (`identifiable`). So each number of
Table 1 is fitted alone, beside the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from math import radians
from types import SimpleNamespace

import casadi as ca
import numpy as np

from ctrlgen.devices.meso_hexapod import MesoHexapod
from ctrlgen.physics import meso_hexapod_kinematics as meso_hexapod

from .rounding import half_units
from .s0_data import PaperRecordings
from .s0_tables import COMMANDS_2, DIGITS, HALF_J_CUBE, SCALE, TABLE_2

UNIFORM = 1 / np.sqrt(3)  # standard deviation of a rounding error, in half units
STEPS = 10  # of Gauss-Newton; four suffice
NUMBERS = ("r_a", "r_b", "phi_1", "psi_4", "t", "H")  # of Table 1, by symmetry all that [J^k] has
EQUATION_4 = np.radians([0.0, 0.0, 90.0, 0.0, 90.0, 90.0])  # directions of the six actuators, as printed
EQUATION_9 = np.radians([0.0, 0.0, 90.0, 90.0, 0.0, 90.0])  # those of its columns, as printed


@dataclass(frozen=True)
class LengthFit:
    """A number of Table 1 fitted alone: `value` and standard deviation `sd` in SI, rms `misfit` in standard deviations of rounding."""

    value: float
    sd: float
    misfit: float


@dataclass(frozen=True)
class SignFit:
    """The senses of the six actuators that meet Tables 2 and 4 best, their rms misfit, and that of the next best."""

    signs: tuple[float, ...]
    misfit: float
    next_misfit: float


class KinematicFit:
    """Tables 2 and 4 and eq. (14) as residuals of NUMBERS, of the actuators' senses along `directions` [rad], and of rounding.

    324 numbers of Table 4, 36 of Table 2, each in standard deviations of its rounding, and the roundings of the 36 numbers of
    eq. (14), which are unknown because every pose has them. Other numbers are those of `device`.
    """

    def __init__(self, device: MesoHexapod, data: PaperRecordings, directions: np.ndarray) -> None:
        self.numbers = _numbers(device.values().hexapod)
        x, sense, rounding = (ca.SX.sym(name, n) for name, n in (("x", 6), ("sense", 6), ("rounding", 36)))
        J_k = ca.mtimes(_jacobian(x, directions), ca.diag(sense))
        J_cube = ca.DM(data.J_cube) + ca.reshape(rounding * HALF_J_CUBE * UNIFORM, 6, 6).T
        J_c = ca.mtimes(meso_hexapod.cube_to_platform(device.cube.depth.si), J_cube)
        poses = ca.mtimes(J_k, ca.solve(J_c, ca.DM(data.commanded.T))).T
        table = np.array(TABLE_2.split(), dtype=float).reshape(6, 6)
        motions = ca.mtimes(J_cube, ca.solve(J_k, ca.DM(np.diag(np.array(COMMANDS_2) * SCALE)))).T
        residual = ca.vertcat(_rounded(poses, data.kinematic / SCALE), _rounded(motions, table), rounding)
        unknown = ca.vertcat(x, rounding)
        self._misfit = ca.Function("misfit", [unknown, sense], [residual, ca.jacobian(residual, unknown)])

    def signs(self) -> SignFit:
        """The senses that meet the tables best, of all 64, with the lengths of the device."""
        found = []
        for signs in product((1.0, -1.0), repeat=6):
            r, J = self._at(self.numbers, np.zeros(36), signs)
            rounding = J[:, 6:]  # the residuals are linear in it: a change of half a last digit
            left = r - rounding @ np.linalg.lstsq(rounding, r, rcond=None)[0]
            found.append((float(np.sqrt(np.sum(left**2) / (len(left) - 36))), signs))
        (best, signs), (second, _), *_ = sorted(found)
        return SignFit(signs, best, second)

    def length(self, name: str, signs: tuple[float, ...]) -> LengthFit:
        """The number `name` of NUMBERS, the others as the device has them."""
        k = NUMBERS.index(name)
        free = [k, *range(6, 42)]
        at = np.concatenate([self.numbers, np.zeros(36)])
        for _ in range(STEPS):
            r, J = self._at(at[:6], at[6:], signs)
            at[free] -= np.linalg.lstsq(J[:, free], r, rcond=None)[0]
        r, J = self._at(at[:6], at[6:], signs)
        sd = float(np.sqrt(np.linalg.inv(J[:, free].T @ J[:, free])[0, 0]))
        return LengthFit(float(at[k]), sd, float(np.sqrt(np.sum(r**2) / (len(r) - len(free)))))

    def _at(self, numbers: np.ndarray, rounding: np.ndarray, signs: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
        r, J = (m.full() for m in self._misfit(np.concatenate([numbers, rounding]), signs))
        return r.ravel(), J


def identifiable(device: MesoHexapod) -> int:
    """How many combinations of the six NUMBERS the 36 numbers of [J^k] tell: the rank of their slopes."""
    p = device.values()
    x, numbers = ca.SX.sym("x", len(NUMBERS)), _numbers(p.hexapod)
    J_k = _jacobian(x, p.directions.jacobian)
    slopes = ca.Function("slopes", [x], [ca.jacobian(ca.vec(J_k), x)])(numbers).full() * numbers
    return int(np.linalg.matrix_rank(slopes, tol=1e-9 * np.abs(slopes).max()))


def _numbers(h: SimpleNamespace) -> np.ndarray:
    angles = h.platform_angles[0], h.base_angles[3]
    return np.array([h.platform_radius, h.base_radius, *angles, h.platform_thickness, h.height])


def _jacobian(x: ca.SX, directions: Sequence[float] | np.ndarray) -> ca.SX:
    """[J^k] of NUMBERS, with the threefold and mirror symmetry of Table 1."""
    r_a, r_b, phi_1, psi_4, t, H = ca.vertsplit(x)
    phi = phi_1 - radians(180)
    platform = zip(np.radians([180, 180, 60, 60, -60, -60]), (1, -1) * 3, strict=True)
    base = zip(np.radians([240, 120, 120, 0, 0, -120]), (-1, 1) * 3, strict=True)
    h = SimpleNamespace(
        platform_radius=r_a,
        base_radius=r_b,
        platform_thickness=t,
        height=H,
        platform_angles=[centre + side * phi for centre, side in platform],
        base_angles=[centre + side * psi_4 for centre, side in base],
    )
    return meso_hexapod.kinematic_jacobian(h, list(directions))


def _rounded(ours: ca.SX, printed: np.ndarray) -> ca.SX:
    sharp = 1 / (UNIFORM * half_units(printed, DIGITS) * SCALE)
    return ca.vec((ours - ca.DM(printed * SCALE)) * ca.DM(sharp))
