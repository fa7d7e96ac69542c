"""The controller's maps in real numbers, where they are what integers can be made of."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ctrlgen.controller.kernels import ControllerKernels
from ctrlgen.controller.quick_state import state_polynomials
from ctrlgen.numerics.proven_polynomial import ProvenPolynomial


class NoFixedPoint(Exception):
    """Why a controller cannot be made in integers."""


@dataclass(frozen=True)
class RealMaps:
    """z = M t, s_k = f_k(z), u = settle s + settle_0 = step (x, s) + step_0, x+ = by_state x + by_drive u + constant."""

    M: np.ndarray
    state: tuple[tuple[int, ProvenPolynomial], ...]
    settle: tuple[np.ndarray, np.ndarray]
    step: tuple[np.ndarray, np.ndarray]
    by_state: np.ndarray
    by_drive: np.ndarray


def real_maps(kernels: ControllerKernels) -> RealMaps:
    """Those of a device without reasons against them. Raises NoFixedPoint where one is of another kind."""
    m, M, moving = kernels.nominal, kernels.target_directions, kernels.moving
    assert M is not None and moving is not None
    found = [state_polynomials(k.state, *m.z_bounds, even_cheap=True) for k in kernels.modes]
    of_rest, of_motion = found
    if not of_rest or not of_motion or not _same(of_rest, of_motion):
        raise NoFixedPoint("its states do not follow from one displacement each by a polynomial whose error is proved")
    settle = _affine(kernels.static.drive, ("state",))
    step = _affine(moving.drive, ("x", "state"))
    advance = _affine(moving.advance, ("x", "drive"))
    if settle is None or step is None or advance is None:
        raise NoFixedPoint("its drives are not linear in its states")
    n = m.n_states
    return RealMaps(M, of_rest, settle, step, advance[0][:, :n], advance[0][:, n:])


def _same(first: tuple[tuple[int, ProvenPolynomial], ...], second: tuple[tuple[int, ProvenPolynomial], ...]) -> bool:
    return all(
        i == j and np.array_equal(p.coefficients, q.coefficients) for (i, p), (j, q) in zip(first, second, strict=True)
    )


def _affine(kernel: ca.Function, of: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray] | None:
    """Slope and value at zero of a kernel in its arguments `of`; None where it is not affine, or depends on another."""
    arguments = {name: ca.SX.sym(name, *kernel.size_in(name)) for name in kernel.name_in()}
    result = kernel(*arguments.values())
    own = ca.vertcat(*(arguments[name] for name in of))
    others = ca.vertcat(*(value for name, value in arguments.items() if name not in of))
    slope = ca.jacobian(result, own)
    if ca.depends_on(result, others) or ca.depends_on(slope, own):
        return None
    return ca.evalf(slope).full(), ca.evalf(ca.substitute(result, own, ca.SX.zeros(own.numel()))).full().ravel()
