"""Held-out records under the posterior of the parameters from the fit.

The parameters p with posterior N(p_fit, C) are refitted to the held-out records: |r(p_fit + dp)|^2 + dp' C^-1 dp is
minimised, r the whitened held-out residual. So a parameter that the records to fit leave open counts neither against its
structure nor for it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.settings import HELD_OUT_REFIT


@dataclass(frozen=True, eq=False)
class HeldOutRefit:
    """`fit` with the refitted parameters, `penalty` dp' C^-1 dp, and `log_det` ln det(I + C J'J), J = dr/dp at p_fit."""

    fit: Fit
    penalty: float
    log_det: float


def refit_to_held_out(fitter: Fitter, fit: Fit, steps: int = 1) -> HeldOutRefit:
    """The parameters refitted to the held-out records by at most so many Gauss-Newton steps, within their bounds.

    The fit itself, with penalty 0, where no step lowers the objective. A parameter without a finite standard deviation, or
    one that the readings do not depend on, keeps its value.
    """
    sd = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
    sd[~fit.J[:, : len(sd)].any(axis=0) | ~np.isfinite(sd)] = 0.0
    if not sd.any():
        return HeldOutRefit(fit, 0.0, 0.0)
    # dp counts in standard deviations
    unit = np.where(sd > 0, sd, 1.0)
    C = fit.covariance / np.outer(unit, unit) * np.outer(sd > 0, sd > 0)
    R = fit.information_root * sd
    low, high = (np.array([getattr(p, end) for p in fit.structure.free_parameters]) for end in ("low", "high"))
    best, least = HeldOutRefit(fit, 0.0, 0.0), fitter.held_out_squares(fit)
    for k in range(steps):
        gradient, H = _normal_equations(fitter, best.fit, sd)
        M = np.eye(len(sd)) + C @ H
        if not np.isfinite(M).all() or not np.isfinite(gradient).all():
            break
        if k == 0:
            best = replace(best, log_det=float(np.linalg.slogdet(M)[1]))
        theta, before = best.fit.theta, least
        step = sd * np.linalg.solve(M, C @ gradient - (theta - fit.theta) / unit)
        for halving in range(HELD_OUT_REFIT.halvings if steps > 1 else 1):
            moved = replace(fit, theta=np.clip(theta + step / 2**halving, low, high))
            penalty = float(np.sum((R @ ((moved.theta - fit.theta) / unit)) ** 2))
            objective = fitter.held_out_squares(moved) + penalty
            if objective < least:
                best, least = replace(best, fit=moved, penalty=penalty), objective
                break
        if not least < before - HELD_OUT_REFIT.settled:
            break
    return best


def _normal_equations(fitter: Fitter, fit: Fit, sd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """J'r (k,) and J'J (k, k) of the held-out records, J the whitened sensitivities by the parameters in units of `sd`."""
    gradient, H = np.zeros(len(sd)), np.zeros((len(sd), len(sd)))
    for record in fitter.held_out_records:
        Y = fitter.simulator(fit.structure, record).sensitivities(record, fit.theta)[1][:, :, : len(sd)]
        J = (fitter.noise.whiten(Y, record.valid) * sd).reshape(-1, len(sd))
        gradient, H = gradient + J.T @ fitter.whitened_residual(fit, record).ravel(), H + J.T @ J
    return gradient, H
