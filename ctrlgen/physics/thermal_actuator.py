"""The bent-beam thermal actuator: temperature, force and stiffness. Source: S1 section 3.1."""

from __future__ import annotations

from functools import lru_cache
from types import SimpleNamespace
from typing import Any

import casadi as ca

from ctrlgen.physics.flexure import blade_compliance
from ctrlgen.physics.screw import Matrix, Scalar, inverse, move, parallel, rotation_z

STIFFENING = (
    "beams",
    "beam_gap",
    "bar_width",
    "bar_half_height",
    "beam_length",
    "beam_width",
    "thickness",
    "beam_angle",
    "young",
    "poisson",
)
ZERO_CELSIUS = 273.15  # K; S1 Table 1 gives alpha as a function of degrees Celsius


def expansion(T: Scalar, a: Any) -> Scalar:
    """alpha(T) = alpha_0 + alpha_1 (T - 0 degC) [1/K], `T` [K]. Source: S1 Table 1."""
    return a.expansion + a.expansion_slope * (T - ZERO_CELSIUS)


def force(T: Scalar, a: Any) -> Scalar:
    """F = 2 n alpha(T) (T - T_amb) E w_1 h sin(theta) [N] on the actuator bar, `T` [K].

    Source: S1 eq. (4), where T-bar is the average temperature above ambient.
    """
    strain = expansion(T, a) * (T - a.ambient)
    return 2 * a.beams * strain * a.young * a.beam_width * a.thickness * ca.sin(a.beam_angle)


def temperature_rate(T: Scalar, P: Scalar, a: Any) -> Scalar:
    """dT/dt = (R_th P - (T - T_amb)) / tau [K/s]: heated by P >= 0 [W], cooled passively.

    The papers give no dynamics; the first-order lag is our assumption.
    """
    return (a.thermal_resistance * P - (T - a.ambient)) / a.time_constant


def drive_range(power_limit: Scalar, resistance: Scalar | None) -> tuple[float, Scalar]:
    """(lowest, highest) drive of a heater, which can only heat: 0 <= P <= P_max [W]; as a voltage 0 <= V <= sqrt(P_max R) [V], where a
    `resistance` R [ohm] is given."""
    return 0.0, power_limit if resistance is None else (power_limit * resistance) ** 0.5


def heating_power(u: Scalar, resistance: Scalar | None) -> Scalar:
    """P [W] of the drive `u`: itself, or V^2/R where a `resistance` [ohm] is given."""
    return u if resistance is None else u**2 / resistance


def beam_stiffness(a: Any) -> Matrix:
    """[K^tb] of one beam, wrench per twist, shape (6, 6). Source: S1 eq. (5).

    Entry (6, 5) is printed as -0.22; by symmetry it equals (2, 3) = -0.0216.
    """
    return inverse(
        blade_compliance(a.beam_length, a.beam_width, a.thickness, a.young, a.poisson, getattr(a, "shear", None))
    )


def stiffness(a: Any) -> Matrix:
    """[K^t] of all 2 n beams about the bar's end, shape (6, 6). Source: S1 eq. (6).

    Entries (1, 4), (2, 5) and (3, 6) are those of the paper; its moment entries do not follow from its beam spacing, but from a bar of
    half height 19.9 um and beams 23.5 um apart (`ctrlgen reproduce S1`).
    """
    dimensions = {name: getattr(a, name) for name in STIFFENING}
    if all(isinstance(value, float) for value in dimensions.values()):
        # a model asks for it several times, and a budget for many models
        return ca.DM(_stiffness_of(**dimensions))
    return _stiffness(a)


@lru_cache(maxsize=16)
def _stiffness_of(**numbers: float) -> Matrix:
    return _stiffness(SimpleNamespace(**numbers))


def _stiffness(a: Any) -> Matrix:
    K = beam_stiffness(a)
    pitch = a.beam_gap + a.bar_width / 2
    sides = ((ca.pi / 2 + a.beam_angle, -1), (3 * ca.pi / 2 - a.beam_angle, 1))
    return parallel(
        move(K, rotation_z(angle), (-pitch * i, sign * a.bar_half_height, 0))
        for i in range(1, round(float(a.beams)) + 1)
        for angle, sign in sides
    )
