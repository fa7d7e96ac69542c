"""How sure fitted numbers are where the noise is not quite of its model, or a law not quite of its form.

Sandwich: H^-1 B H^-1 instead of H^-1, H = J'J, B the sum of squared scores J'r over blocks of time: holds where the
residual r is not as white as the noise model says (W. K. Newey, K. D. West, Econometrica 55 (1987) 703, with blocks).
"""

from __future__ import annotations

import numpy as np

from ctrlgen.diagnosis.estimation.fit import Fit
from ctrlgen.diagnosis.settings import ROBUST_COVARIANCE


def robust_deviations(fit: Fit) -> np.ndarray:
    """Standard deviation [SI] of each unknown: by curvature, or by the sandwich where that disagrees upwards."""
    if not len(fit.theta):
        return np.zeros(0)
    ratio = sandwich_over_model(fit)
    wider = 1.0 if ratio is None else np.where(ratio < ROBUST_COVARIANCE.agreement, 1.0, ratio)
    return np.sqrt(np.maximum(np.diag(fit.covariance), 0.0)) * wider


def sandwich_over_model(fit: Fit) -> np.ndarray | None:
    """Per unknown, the deviation by block scores over that by curvature; None where there are too few blocks."""
    k = len(fit.theta)
    size = max(
        sum(n for n, _ in fit.shapes) // max(ROBUST_COVARIANCE.blocks, ROBUST_COVARIANCE.blocks_per_parameter * k), 1
    )
    scale = np.linalg.norm(fit.J, axis=0)
    scale[scale == 0] = 1.0
    J, first, scores = fit.J / scale, 0, []
    for n, n_y in fit.shapes:
        for a in range(0, n, size):
            rows = slice(first + a * n_y, first + min(a + size, n) * n_y)
            scores.append(J[rows].T @ fit.residual[rows])
        first += n * n_y
    if len(scores) < ROBUST_COVARIANCE.blocks_per_parameter * k:
        return None
    s, prior = np.array(scores), J[first:]
    inverse = np.linalg.pinv(J.T @ J, rcond=1e-14)
    B = (s - s.mean(axis=0)).T @ (s - s.mean(axis=0)) * len(s) / (len(s) - 1) + prior.T @ prior
    sandwich = np.diag(inverse @ B @ inverse)[:k]
    return np.sqrt(np.maximum(sandwich, 0.0) / np.maximum(np.diag(inverse)[:k], 1e-300))
