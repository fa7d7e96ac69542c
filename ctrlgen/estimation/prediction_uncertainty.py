"""Error of the prediction of the held-out records that the uncertainty of the fitted parameters alone leaves.

dy = (Y - Y_s (Y_s'W'W Y_s + I)^-1 Y_s'W'W Y) dp, dp ~ N(0, C) by `posterior`: Y the sensitivities of the readings by
the parameters, Y_s by the initial states in their prior standard deviations, which follow the readings (see `Fitter.predict`); W
whitens.
"""

from __future__ import annotations

import numpy as np

from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.least_squares import initial_state_sd
from ctrlgen.estimation.posterior import Posterior
from ctrlgen.recordings.recording import Record


def prediction_uncertainty(fitter: Fitter, fit: Fit) -> np.ndarray:
    """Root mean square of dy (n_y,) [SI] over the held-out samples.

    Zero where no parameter is free; infinite where the sensitivities have diverged.
    """
    squares = np.zeros(len(fitter.recording.channels))
    if not len(fit.theta):
        return squares
    count, posterior = np.zeros_like(squares), Posterior.of(fit)
    for record in fitter.held_out_records:
        Y = _sensitivities(fitter, fit, record) * posterior.slope(fit.theta)
        variance = np.einsum("nij,jk,nik->ni", Y, posterior.C, Y)
        squares += np.sum(np.where(record.valid, np.maximum(variance, 0.0), 0.0), axis=0)
        count += record.valid.sum(axis=0)
    rms = np.sqrt(squares / np.maximum(count, 1))
    return np.where(np.isfinite(rms), rms, np.inf)


def _sensitivities(fitter: Fitter, fit: Fit, record: Record) -> np.ndarray:
    """Sensitivities (n, n_y, k) of the readings by the parameters, the initial states following the readings."""
    simulator = fitter.simulator(fit.structure, record)
    k, n_s = len(fit.theta), len(simulator.free_initial_states)
    Y_all = simulator.sensitivities(record, fit.theta, np.zeros(n_s))[1]
    if not np.isfinite(Y_all).all():
        return np.full((*Y_all.shape[:2], k), np.inf)
    Y, Y_s = Y_all[:, :, :k], Y_all[:, :, k:] * initial_state_sd(simulator)
    white = fitter.error.whiten(np.concatenate([Y, Y_s], axis=2), record.valid).reshape(-1, k + n_s)
    WY, WY_s = white[:, :k], white[:, k:]
    return Y - Y_s @ np.linalg.solve(WY_s.T @ WY_s + np.eye(n_s), WY_s.T @ WY)
