"""Calibration: commanded inputs and measured poses -> Jacobian with its covariance. Source: S0 section 4.

Noise model: T_j = J U_j (+ T_0) + e_j. The inputs U_j are exact; the errors e_j have mean zero, are independent from
pose to pose, and have one covariance N (channels, channels) in every pose, correlated between channels or not. With
the same inputs in every channel, least squares channel by channel is then the best linear estimate, and with normal
errors the most likely one. Nonlinearity, drift and hysteresis are not noise: they show in the residuals.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import Fault, InputError

# a combination of inputs that moves a millionth of the largest is lost in the noise of any sensor
CONDITION_LIMIT = 1e6
NAMED_SHARE = 0.05  # of a direction: smaller components are not named in a message


@dataclass(frozen=True)
class JacobianCalibration:
    """A calibrated Jacobian; SI.

    `jacobian` (channels, inputs); `covariance` of its entries row by row (`jacobian.ravel()`), None where there are only as
    many poses as unknowns and no noise was given; `noise` N (channels, channels) of one pose, None likewise; `offset` T_0
    (channels,), None where not asked for, and `offset_covariance`; `residuals` measured minus fitted, (n, channels);
    `condition` number of the inputs: the largest over the smallest combination that the poses move.
    """

    jacobian: np.ndarray
    covariance: np.ndarray | None
    noise: np.ndarray | None
    offset: np.ndarray | None
    offset_covariance: np.ndarray | None
    residuals: np.ndarray
    condition: float

    @property
    def sd(self) -> np.ndarray | None:
        """Standard deviation of every entry of the Jacobian, (channels, inputs)."""
        return None if self.covariance is None else np.sqrt(np.diag(self.covariance)).reshape(self.jacobian.shape)

    def moved(self, adjoint: np.ndarray) -> JacobianCalibration:
        """The same calibration for another point of the body: T' = [Ad] T. Source: S0 eq. (15)."""

        def twice(matrix: np.ndarray | None, factor: np.ndarray) -> np.ndarray | None:
            return None if matrix is None else factor @ matrix @ factor.T

        return replace(
            self,
            jacobian=adjoint @ self.jacobian,
            covariance=twice(self.covariance, np.kron(adjoint, np.eye(self.jacobian.shape[1]))),
            noise=twice(self.noise, adjoint),
            offset=None if self.offset is None else adjoint @ self.offset,
            offset_covariance=twice(self.offset_covariance, adjoint),
            residuals=self.residuals @ adjoint.T,
        )


def calibrate_jacobian(
    inputs: np.ndarray, measured: np.ndarray, *, offset: bool = False, noise: np.ndarray | None = None
) -> JacobianCalibration:
    """[J] = [T_1 .. T_n] [U_1 .. U_n]^+ by least squares; six poses of six inputs give S0 eq. (13) itself.

    `inputs` (n, inputs) [m], `measured` (n, channels) [rad, m]. `offset` also estimates the pose T_0 at zero input:
    without it the reference of the measurement is believed. `noise` (channels, channels) is the covariance of one
    measured pose where known; otherwise it is estimated from the residuals over n minus the number of unknowns.
    Raises InputError for too few poses, or poses that leave a combination of inputs unmoved.
    """
    U, T = np.asarray(inputs, dtype=float), np.asarray(measured, dtype=float)
    _check(U, T, noise)
    n, k = U.shape
    unknowns = k + offset
    if n < unknowns:
        what = f"{number_of(n, 'pose')} cannot tell {number_of(k, 'input')}" + (" and an offset" if offset else "")
        raise InputError("calibration", [Fault("poses", f"{what}; record at least {unknowns}")])
    size = np.sqrt(np.mean(U**2)) or 1.0
    design = np.hstack([U, np.full((n, int(offset)), size)])
    left, singular, right = np.linalg.svd(design, full_matrices=False)
    if singular[-1] * CONDITION_LIMIT < singular[0] or singular[0] == 0:
        raise InputError("calibration", [Fault("poses", _unmoved(right[-1], k, singular))])
    pseudo = right.T / singular @ left.T
    solution = (pseudo @ T).T
    spread = right.T / singular**2 @ right  # (design' design)^-1
    residuals = T - design @ solution.T
    if noise is None and n > unknowns:
        noise = residuals.T @ residuals / (n - unknowns)
    return JacobianCalibration(
        jacobian=solution[:, :k],
        covariance=None if noise is None else np.kron(noise, spread[:k, :k]),
        noise=noise,
        offset=solution[:, k] * size if offset else None,
        offset_covariance=noise * spread[k, k] * size**2 if offset and noise is not None else None,
        residuals=residuals,
        condition=float(singular[0] / singular[-1]),
    )


def _check(U: np.ndarray, T: np.ndarray, noise: np.ndarray | None) -> None:
    faults = []
    if U.ndim != 2 or T.ndim != 2 or len(U) != len(T):
        what = f"shapes {U.shape} and {T.shape} do not fit; give one row per pose in both"
        raise InputError("calibration", [Fault("inputs, measured", what)])
    for name, values in (("inputs", U), ("measured", T)):
        bad = np.flatnonzero(~np.isfinite(values).all(1))
        if bad.size:
            faults.append(Fault(name, f"pose {bad[0] + 1} has a value that is not finite; remove the pose"))
    if noise is not None and np.shape(noise) != (T.shape[1],) * 2:
        faults.append(Fault("noise", f"has shape {np.shape(noise)}; {(T.shape[1],) * 2} is needed"))
    if faults:
        raise InputError("calibration", faults)


def _unmoved(direction: np.ndarray, k: int, singular: np.ndarray) -> str:
    """A sentence that names the combination of inputs that the poses do not move."""
    if singular[0] == 0:
        return "no input moves in any pose; record poses away from home"
    names = [f"input {i + 1}" if i < k else "offset" for i in range(len(direction))]
    parts = [f"{value:+.2f} {name}" for name, value in zip(names, direction, strict=True) if abs(value) > NAMED_SHARE]
    return f"the combination {' '.join(parts)} stays still in all of them; record poses that move it"
