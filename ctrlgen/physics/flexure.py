"""Compliances of the elementary flexures, each about its free end, x along the flexure."""

from __future__ import annotations

import casadi as ca

from ctrlgen.physics.screw import Matrix, Scalar


def shear_ratio(poisson: Scalar) -> Scalar:
    """chi = G/E = 1 / (2 (1 + nu)). Source: S1 eq. (22)."""
    return 1 / (2 * (1 + poisson))


def torsion_ratio(t: Scalar, w: Scalar) -> Scalar:
    """beta = J/I_z of a rectangular section t x w, t <= w: 12 (1/3 - 0.21 (t/w) (1 - (t/w)^4 / 12)).

    Source: S1 eq. (23).
    """
    return 12 * (1 / 3 - 0.21 * t / w * (1 - (t / w) ** 4 / 12))


def beam_compliance(l: Scalar, EA: Scalar, EI_y: Scalar, EI_z: Scalar, GJ: Scalar) -> Matrix:
    """Euler-Bernoulli cantilever about its free end, twist per wrench, shape (6, 6).

    theta_x/M_x = l/GJ, delta_x/F_x = l/EA; in the x-y plane delta_y/F_y = l^3/3EI_z,
    delta_y/M_z = theta_z/F_y = l^2/2EI_z, theta_z/M_z = l/EI_z; in the x-z plane the same
    with EI_y and the opposite coupling sign. Source: S1 eq. (21) and (24), common form.

    `l` [m], `EA` [N], `EI_y`, `EI_z`, `GJ` [N m^2].
    """
    zero = 0 * l
    rows = [
        [zero, zero, zero, l / GJ, zero, zero],
        [zero, zero, -(l**2) / (2 * EI_y), zero, l / EI_y, zero],
        [zero, l**2 / (2 * EI_z), zero, zero, zero, l / EI_z],
        [l / EA, zero, zero, zero, zero, zero],
        [zero, l**3 / (3 * EI_z), zero, zero, zero, l**2 / (2 * EI_z)],
        [zero, zero, l**3 / (3 * EI_y), zero, -(l**2) / (2 * EI_y), zero],
    ]
    return ca.vertcat(*(ca.horzcat(*row) for row in rows))


def blade_compliance(l: Scalar, t: Scalar, w: Scalar, E: Scalar, nu: Scalar) -> Matrix:
    """[C^b]: blade of length l, thickness t (along y), width w (along z), t <= w, shape (6, 6).

    EA = E t w, EI_z = E w t^3/12, EI_y = E t w^3/12, GJ = chi beta EI_z.
    Source: S1 eq. (21)-(23). `l`, `t`, `w` [m], `E` [Pa], `nu` [1].
    """
    EI_z = E * w * t**3 / 12
    return beam_compliance(l, E * t * w, E * t * w**3 / 12, EI_z, shear_ratio(nu) * torsion_ratio(t, w) * EI_z)


def wire_compliance(l: Scalar, d: Scalar, E: Scalar, nu: Scalar) -> Matrix:
    """[C^w]: round wire of length l and diameter d, shape (6, 6).

    EA = pi E d^2/4, EI = pi E d^4/64, GJ = 2 chi EI.
    Source: S1 eq. (24). `l`, `d` [m], `E` [Pa], `nu` [1].
    """
    EI = E * ca.pi * d**4 / 64
    return beam_compliance(l, E * ca.pi * d**2 / 4, EI, EI, 2 * shear_ratio(nu) * EI)
