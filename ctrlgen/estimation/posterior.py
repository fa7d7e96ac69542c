"""What a fit says of its parameters: normal about the fit, and no less certain than the bounds.

x is a parameter, or its logarithm where a fit counts by that. Of a parameter that may lie anywhere between its bounds the deviation
is their distance over sqrt(12): with D that of all of them, and J the slopes of the whitened readings to fit by x,

    C = (J'J + D^-2)^-1.

The curvature alone would let a number that the records hardly show, such as a corner sharper than they can tell, be anything at all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ctrlgen.estimation.fit import Fit
from ctrlgen.estimation.least_squares import by_logarithm


@dataclass(frozen=True, eq=False)
class Posterior:
    """What a fit says of its parameters: `fitted` (k,) x of them, their `sd` (k,), 0 of one that keeps its value, within `low` and
    `high`; correlations `C` (k, k) and a `root` R with |R d|^2 = d' C^-1 d, d deviations in units of `sd`."""

    fitted: np.ndarray
    sd: np.ndarray
    low: np.ndarray
    high: np.ndarray
    log: np.ndarray
    C: np.ndarray
    root: np.ndarray

    @classmethod
    def of(cls, fit: Fit) -> Posterior:
        """That of a fit; a parameter on which its readings do not depend keeps its value."""
        parameters = fit.structure.free_parameters
        log = np.array([by_logarithm(p) for p in parameters], dtype=bool)
        ends = [np.array([getattr(p, end) for p in parameters], dtype=float) for end in ("low", "high")]
        low, high, fitted = (np.where(log, np.log(np.where(log, v, 1.0)), v) for v in (*ends, fit.theta))
        reach = (high - low) / np.sqrt(12)
        known = fit.J[:, : len(fitted)].any(axis=0) & np.isfinite(np.diag(fit.covariance)) & (reach > 0)
        unit = np.where(known, reach, 0.0)
        R = fit.information_root * np.where(log, fit.theta, 1.0) * unit
        _, singular, V = np.linalg.svd(R)
        C = (V.T / (1 + singular**2)) @ V
        sd = np.sqrt(np.diag(C))
        root = np.vstack([R, np.eye(len(R))]) * sd
        return cls(fitted, sd * unit, low, high, log, C / np.outer(sd, sd) * np.outer(known, known), root)

    def x(self, theta: np.ndarray) -> np.ndarray:
        """What the parameters [SI] are counted by."""
        return np.where(self.log, np.log(np.where(self.log, theta, 1.0)), theta)

    def slope(self, theta: np.ndarray) -> np.ndarray:
        """Derivatives (k,) of the parameters by their deviation in units of `sd`."""
        return np.where(self.log, theta, 1.0) * self.sd

    def moved(self, theta: np.ndarray, step: np.ndarray) -> np.ndarray:
        """The parameters after a step in x, within their bounds; what does not move keeps every bit of its value."""
        x = np.clip(self.x(theta) + step, self.low, self.high)
        return np.where(step == 0, theta, np.where(self.log, np.exp(np.where(self.log, x, 0.0)), x))

    def penalty(self, theta: np.ndarray) -> float:
        """dx' C^-1 dx of the parameters [SI]."""
        return float(np.sum((self.root @ self._deviation(theta)) ** 2))

    def step(self, theta: np.ndarray, gradient: np.ndarray, H: np.ndarray) -> np.ndarray:
        """The Gauss-Newton step (k,) in x, of those parameters alone that it does not push beyond a bound at which they are."""
        deviation, x, step = self._deviation(theta), self.x(theta), np.zeros(len(theta))
        free = self.sd > 0
        while free.any():
            R = self.root[:, free]
            left = gradient[free] - R.T @ (self.root @ deviation)
            step = np.zeros(len(theta))
            step[free] = self.sd[free] * np.linalg.lstsq(R.T @ R + H[np.ix_(free, free)], left, rcond=None)[0]
            beyond = free & (((x <= self.low) & (step < 0)) | ((x >= self.high) & (step > 0)))
            if not beyond.any():
                return step
            free = free & ~beyond
        return np.zeros(len(theta))

    def _deviation(self, theta: np.ndarray) -> np.ndarray:
        return np.where(self.sd > 0, (self.x(theta) - self.fitted) / np.where(self.sd > 0, self.sd, 1.0), 0.0)
