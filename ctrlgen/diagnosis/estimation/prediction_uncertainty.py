"""How well the held-out records could be foreseen: what the uncertainty of the fitted numbers alone leaves there.

dy = (Y - Y_s (Y_s'W'W Y_s + I)^-1 Y_s'W'W Y) dp, dp ~ N(0, C): Y the slopes of the readings by the numbers, Y_s by what the
record starts with, in sizes of that, which follows the readings; W whitens.
"""

from __future__ import annotations

import numpy as np

from ctrlgen.diagnosis.estimation.fit import Fit, Fitter, start_sizes
from ctrlgen.recordings.recording import Record


def prediction_uncertainty(fitter: Fitter, fit: Fit) -> np.ndarray:
    """Root mean square (n_y,) [SI] of dy over the samples held out; infinite where the slopes leave the numbers."""
    squares = np.zeros(len(fitter.recording.channels))
    count = np.zeros_like(squares)
    for record in fitter.held_out_records if len(fit.theta) else ():  # nothing is fitted, nothing is unsure
        Y = _following(fitter, fit, record)
        variance = np.einsum("nij,jk,nik->ni", Y, fit.covariance, Y)
        squares += np.sum(np.where(record.valid, np.maximum(variance, 0.0), 0.0), axis=0)
        count += record.valid.sum(axis=0)
    found = np.sqrt(squares / np.maximum(count, 1))
    return np.where(np.isfinite(found), found, np.inf)


def _following(fitter: Fitter, fit: Fit, record: Record) -> np.ndarray:
    """How the readings (n, n_y, k) of a record change with the numbers, the record's start following."""
    simulator = fit.structure.simulators(fitter.recording, fitter.cache)[record.sample_time, record.linear]
    k, n_i = len(fit.theta), len(simulator.free_initial_states)
    slopes = simulator.sensitivities(record, fit.theta, np.zeros(n_i))[1]
    if not np.isfinite(slopes).all():
        return np.full((*slopes.shape[:2], k), np.inf)
    Y, Y_s = slopes[:, :, :k], slopes[:, :, k:] * start_sizes(simulator)
    white = fitter.noise.whiten(np.concatenate([Y, Y_s], axis=2), record.valid).reshape(-1, k + n_i)
    WY, WY_s = white[:, :k], white[:, k:]
    return Y - Y_s @ np.linalg.solve(WY_s.T @ WY_s + np.eye(n_i), WY_s.T @ WY)
