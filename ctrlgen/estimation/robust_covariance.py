"""Standard deviations of the parameters that hold where the residual is not as white as the noise model says.

Sandwich covariance H^-1 B H^-1 instead of H^-1: H = J'J, B the summed squares of the scores J'r over blocks of time (W. K.
Newey, K. D. West, Econometrica 55 (1987) 703, here with blocks). It also covers a law that is not quite of the right form.
"""

from __future__ import annotations

import numpy as np

from ctrlgen.estimation.fit import Fit
from ctrlgen.estimation.settings import ROBUST_COVARIANCE


def robust_deviations(fit: Fit) -> np.ndarray:
    """Standard deviation (k,) [SI] of each free parameter: of the model, or of the sandwich where that is clearly larger."""
    if not len(fit.theta):
        return np.zeros(0)
    return np.sqrt(np.maximum(np.diag(fit.covariance), 0.0)) * widening(fit)


def widening(fit: Fit) -> np.ndarray:
    """Factor (k,) on the standard deviations of the model: sandwich over model, 1 where that is within its own error."""
    ratio = sandwich_over_model(fit)
    if ratio is None:
        return np.ones(len(fit.theta))
    return np.where(ratio < ROBUST_COVARIANCE.agreement, 1.0, ratio)


def sandwich_over_model(fit: Fit) -> np.ndarray | None:
    """Standard deviation of the sandwich over that of the model (k,); None where there are too few blocks."""
    k = len(fit.theta)
    fewest = ROBUST_COVARIANCE.blocks_per_parameter * k
    size = max(sum(n for n, _ in fit.shapes) // max(ROBUST_COVARIANCE.blocks, fewest), 1)
    scale = np.linalg.norm(fit.J, axis=0)
    scale[scale == 0] = 1.0
    J, first, scores = fit.J / scale, 0, []
    for n, n_y in fit.shapes:
        for a in range(0, n, size):
            rows = slice(first + a * n_y, first + min(a + size, n) * n_y)
            scores.append(J[rows].T @ fit.residual[rows])
        first += n * n_y
    if len(scores) < fewest:
        return None
    s, prior = np.array(scores), J[first:]
    inverse = np.linalg.pinv(J.T @ J, rcond=1e-14)
    B = (s - s.mean(axis=0)).T @ (s - s.mean(axis=0)) * len(s) / (len(s) - 1) + prior.T @ prior
    sandwich = np.diag(inverse @ B @ inverse)[:k]
    return np.sqrt(np.maximum(sandwich, 0.0) / np.maximum(np.diag(inverse)[:k], 1e-300))
