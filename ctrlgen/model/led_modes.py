"""Modes of the bodies in the feedforward: axes and forces with which a structure follows a target, by the target's derivatives.

A structure M q'' + D q' + K q = (f, 0), q = (d, eta), whose pose is C q (`ctrlgen.devices.structural_model`), follows a slow target r with

    q = sum_j q_j r^(j),  f = sum_j f_j r^(j):   K q_j + D q_(j-1) + M q_(j-2) = (f_j, 0),   C q_j = 1 for j = 0, else 0,

the expansion of its inverse G^-1(s) about s = 0. C_d d_2 is minus the displacement of the platform beside the axes by the inertia of an
acceleration, m/k; f_4 has the force that moves the modes. Cut off behind the fourth derivative it is exact for two masses with a
spring between drive and platform, without damping, whose inverse ends there; else it is off by the sixth power of frequency over the
lowest zero of the structure, wherever that zero lies: of an inverse that is not stable too, the expansion is the bounded one.

The model condensed to the axes is led by it as by a target: it is told C_d d and its rate, and in place of the second derivative what makes
it need the force f,

    C_d a,  M_d a = f - D_d d' - K_d d,   and after it   M_d a' = f' - D_d a - K_d d',   M_d, D_d, K_d those of the condensed model.

Source: bounded inverse of a system with zeros to the right, S. Devasia, D. Chen, B. Paden, IEEE Trans. Autom. Control 41 (1996) 930; its
expansion by derivatives of the target, L. R. Hunt, G. Meyer, Automatica 33 (1997) 1549; acceleration and its second derivative as
feedforward of one mode, P. Lambrechts, M. Boerlage, M. Steinbuch, Control Eng. Pract. 13 (2005) 145.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import scipy.linalg

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.devices.structural_model import StructuralModel
from ctrlgen.model.model import Model

TERMS = 4  # derivatives of the target: the inertia of a mode is of the fourth
MORE = 2  # derivatives of the target beyond those of the condensed model
FINITE = 1e6  # times the fastest mode: a zero beyond it is at infinity


def structure_to_lead(model: Model, follow: str) -> StructuralModel:
    """The structure whose modes a path of the signal `follow` is to lead. Raises InputError where the model has none."""
    structure = model.device.structural_model() if model.inertial else None
    why = ""
    if structure is None:
        why = "has no inertia of bodies"
    elif model.device.effect:
        why = "has effects, which are not stated of its bodies"
    elif follow != "pose":
        why = f"is followed in its {follow}, which its axes have themselves"
    elif len(structure.output) != structure.axes:
        why = f"has {structure.axes} axes for {len(structure.output)} channels"
    elif len(structure.mass) == structure.axes:
        why = "has no mode of its bodies below modes_below that its axes do not have"
    if structure is None or why:
        what = f'is "modes", but {model.name} {why}; leave it out'
        raise InputError(model.name, [Fault("feedforward", what)])
    return structure


def inverse_series(structure: StructuralModel) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """d_j [m s^j] and f_j [N s^j], j = 0 ... 4, each (axes, channels), per channel of the target [SI]. K has no terms between d and eta,
    the modes with the axes held."""
    n = structure.axes
    q, forces = _series(structure)
    return [each[:n] for each in q], forces


def amplitudes(structure: StructuralModel) -> list[np.ndarray]:
    """eta_j [m s^j], j = 0 ... 4, each (modes, channels), of the modes beside the axes, as `inverse_series`."""
    return [each[structure.axes :] for each in _series(structure)[0]]


def _series(structure: StructuralModel) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """q_j and f_j."""
    n = structure.axes
    M, D, K, C = structure.mass, structure.damping, structure.stiffness, structure.output
    q, forces = [np.zeros((len(K), n)), np.zeros((len(K), n))], []
    for j in range(TERMS + 1):
        rates = D @ q[-1] + M @ q[-2]
        eta = -np.linalg.solve(K[n:, n:], rates[n:])
        d = np.linalg.solve(C[:, :n], (np.eye(n) if j == 0 else np.zeros((n, n))) - C[:, n:] @ eta)
        q.append(np.vstack([d, eta]))
        forces.append(K[:n, :n] @ d + rates[:n])
    return q[2:], forces


def lowest_zero(structure: StructuralModel) -> float | None:
    """The lowest frequency [Hz] at which forces move the bodies and not the platform, or grow as fast as it does; None where none does.
    Far below it the series holds."""
    n, k = structure.axes, len(structure.mass)
    pencil = np.zeros((k + n, k + n))
    pencil[:k, :k], pencil[:k, k:], pencil[k:, :k] = structure.stiffness, -np.eye(k)[:, :n], structure.output
    mass = np.zeros_like(pencil)
    mass[:k, :k] = structure.mass
    squares = scipy.linalg.eigvals(pencil, mass)
    found = np.sqrt(np.abs(squares[np.isfinite(squares)])) / (2 * np.pi)
    found = found[found < FINITE * structure.frequencies[-1]]
    return float(found.min()) if len(found) else None


def condensed_target(structure: StructuralModel, order: int) -> ca.Function:
    """`target` (channels, order + 3), the asked pose and its derivatives by time [SI], -> (channels, order + 1), what the condensed model
    is told in its place; `order` 2 or more."""
    own, (d, f) = structure.condensed, inverse_series(structure)
    target, last = ca.SX.sym("target", len(d[0]), order + MORE + 1), order + MORE

    def derivative(series: list[np.ndarray], k: int) -> ca.SX:
        return sum(
            (ca.mtimes(ca.DM(c), target[:, k + j]) for j, c in enumerate(series) if k + j <= last),
            ca.SX.zeros(len(series[0]), 1),
        )

    axes = [derivative(d, 0), derivative(d, 1)]
    for k in range(order - 1):
        inertia = derivative(f, k) - ca.mtimes(ca.DM(own.damping), axes[-1]) - ca.mtimes(ca.DM(own.stiffness), axes[-2])
        axes.append(ca.mtimes(ca.DM(np.linalg.inv(own.mass)), inertia))
    told = ca.mtimes(ca.DM(own.output), ca.horzcat(*axes))
    return ca.Function("condensed_target", [target], [told], ["target"], ["condensed"])


def forces_along(structure: StructuralModel, target: np.ndarray) -> np.ndarray:
    """(n, axes) [N] sum_j f_j r^(j) along a `target` (n, channels, 5 or more), the pose from home and its derivatives by time [SI]."""
    return sum(target[:, :, j] @ f.T for j, f in enumerate(inverse_series(structure)[1]))


def led(model: Model, follow: str, order: int) -> ca.Function:
    """`condensed_target` of a model whose own inverse follows `order` derivatives. Raises InputError as `structure_to_lead`."""
    return condensed_target(structure_to_lead(model, follow), order)
