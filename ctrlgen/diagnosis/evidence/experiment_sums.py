"""Sums over records from which it follows how far two models are apart once one of them is refitted to the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.least_squares import initial_state_sd
from ctrlgen.recordings.recording import Record


@dataclass(frozen=True, eq=False)
class Prediction:
    """Readings `y` (n, n_y) [SI] of a record, their `slopes` (n, n_y, k + n_s) by parameters and initial states, the latter of standard
    deviations `start_sd` (n_s,); `own` (n, n_y, m) by errors of the reading itself, of standard deviations `own_sd` (m,)."""

    y: np.ndarray
    slopes: np.ndarray
    start_sd: np.ndarray
    own: np.ndarray | None = None
    own_sd: np.ndarray | None = None

    @classmethod
    def of(cls, fitter: Fitter, fit: Fit, record: Record) -> Prediction:
        """What a fit predicts of a record."""
        simulator = fitter.simulator(fit.structure, record)
        return cls(*simulator.sensitivities(record, fit.theta), initial_state_sd(simulator))


@dataclass(frozen=True, eq=False)
class Sums:
    """N = J'J, g = J'Delta, s = |Delta|^2 over some records, initial states and errors of the reading itself projected out."""

    N: np.ndarray
    g: np.ndarray
    s: float

    @property
    def separation(self) -> float:
        """Norm of Delta after the best refit within J [standard deviations]; NaN where the motion diverged."""
        if not (np.isfinite(self.N).all() and np.isfinite(self.g).all()):
            return float("nan")
        d = np.sqrt(np.maximum(np.diag(self.N), 1e-300))
        taken = (self.g / d) @ np.linalg.pinv(self.N / np.outer(d, d), rcond=1e-12) @ (self.g / d)
        return float(np.sqrt(max(self.s - float(taken), 0.0)))

    @classmethod
    def present(cls, fitter: Fitter, truth: Fit, refitted: Fit) -> Sums:
        """The sums over the records to fit. Prior rows of the refitted model keep its parameters near their stated values."""
        n = sum(r.valid.size for r in fitter.fit_records)
        delta = np.zeros(len(refitted.residual))
        delta[:n] = refitted.residual[:n] - truth.residual[:n]
        return cls._of(-refitted.J, delta, len(refitted.theta))

    def plus(self, fitter: Fitter, truth: Prediction, refitted: Prediction, record: Record) -> Sums:
        """The sums with one more `record`, as both models predict it."""
        delta = fitter.noise.whiten(truth.y - refitted.y, record.valid).ravel()
        slopes, sizes = refitted.slopes, refitted.start_sd
        k = slopes.shape[2] - len(sizes)
        if refitted.own is not None and refitted.own_sd is not None:
            slopes, sizes = np.concatenate([slopes, refitted.own], axis=2), np.concatenate([sizes, refitted.own_sd])
        J = fitter.noise.whiten(slopes, record.valid).reshape(len(delta), -1)
        prior = np.hstack([np.zeros((len(sizes), k)), np.diag(1 / sizes)])
        new = Sums._of(np.vstack([J, prior]), np.concatenate([delta, np.zeros(len(sizes))]), k)
        return Sums(self.N + new.N, self.g + new.g, self.s + new.s)

    @classmethod
    def _of(cls, J: np.ndarray, delta: np.ndarray, k: int) -> Sums:
        theta, start = J[:, :k], J[:, k:]
        if start.shape[1]:
            q = np.linalg.qr(start / np.maximum(np.linalg.norm(start, axis=0), 1e-300))[0]
            theta, delta = theta - q @ (q.T @ theta), delta - q @ (q.T @ delta)
        return cls(theta.T @ theta, theta.T @ delta, float(delta @ delta))
