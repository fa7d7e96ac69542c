"""Held-out records under the posterior of the parameters from the fit.

The parameters with posterior N(x_fit, C) are refitted to the held-out records: |r(x_fit + dx)|^2 + dx' C^-1 dx is minimised,
r the whitened held-out residual. So a parameter that the records to fit leave open counts neither against its structure
nor for it. C and x are those of `posterior`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.posterior import Posterior
from ctrlgen.estimation.settings import HELD_OUT_REFIT
from ctrlgen.recordings.recording import Record


@dataclass(frozen=True, eq=False)
class HeldOutRefit:
    """`fit` with the refitted parameters, `penalty` dp' C^-1 dp, and `log_det` ln det(I + C J'J), J = dr/dp at p_fit."""

    fit: Fit
    penalty: float
    log_det: float


def refit_to_held_out(
    fitter: Fitter, fit: Fit, steps: int = 1, records: Sequence[Record] | None = None
) -> HeldOutRefit:
    """The parameters refitted to the held-out records, or to other `records` that were not fitted, by at most so many Gauss-Newton steps,
    within their bounds.

    The fit itself, with penalty 0, where no step lowers the objective. A parameter on which the readings to fit do not depend keeps
    its value.
    """
    posterior = Posterior.of(fit)
    if not posterior.sd.any():
        return HeldOutRefit(fit, 0.0, 0.0)
    unseen = fitter.held_out_records if records is None else records
    best, least = HeldOutRefit(fit, 0.0, 0.0), _squares(fitter, fit, unseen)
    for k in range(steps):
        gradient, H = _normal_equations(fitter, best.fit, posterior.slope(best.fit.theta), unseen)
        M = np.eye(len(gradient)) + posterior.C @ H
        if not np.isfinite(M).all() or not np.isfinite(gradient).all():
            break
        if k == 0:
            best = replace(best, log_det=float(np.linalg.slogdet(M)[1]))
        theta, before = best.fit.theta, least
        step = posterior.step(theta, gradient, H)
        for halving in range(HELD_OUT_REFIT.halvings if steps > 1 else 1):
            moved = replace(fit, theta=posterior.moved(theta, step / 2**halving))
            penalty = posterior.penalty(moved.theta)
            objective = _squares(fitter, moved, unseen) + penalty
            if objective < least:
                best, least = replace(best, fit=moved, penalty=penalty), objective
                break
        if not least < before - HELD_OUT_REFIT.settled:
            break
    return best


def _squares(fitter: Fitter, fit: Fit, records: Sequence[Record]) -> float:
    return sum(float(np.sum(fitter.whitened_residual(fit, r) ** 2)) for r in records)


def _normal_equations(
    fitter: Fitter, fit: Fit, slope: np.ndarray, records: Sequence[Record]
) -> tuple[np.ndarray, np.ndarray]:
    """J'r (k,) and J'J (k, k) of the `records`, J the whitened sensitivities, of the parameters by `slope`."""
    gradient, H = np.zeros(len(slope)), np.zeros((len(slope), len(slope)))
    for record in records:
        Y = fitter.simulator(fit.structure, record).sensitivities(record, fit.theta)[1][:, :, : len(slope)]
        J = (fitter.noise.whiten(Y, record.valid) * slope).reshape(-1, len(slope))
        gradient, H = gradient + J.T @ fitter.whitened_residual(fit, record).ravel(), H + J.T @ J
    return gradient, H
