"""The free force (or displacement) that would explain what a fit leaves, sample by sample.

State (D, f) with D+ = F_S D + F_f f, f+ = f + w (separate poses: f+ = w), y = H_S D + H_f f + e. Kalman filter and the
smoother of A. E. Bryson, M. Frazier, TDR-63-119 (1963), which inverts no covariance. How fast f may change is what makes
the recording most likely; e is the noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ctrlgen.diagnosis.along import Along
from ctrlgen.diagnosis.noise import Noise

SPEEDS = tuple(10.0 ** np.arange(-7, 0.1, 1.0))  # variance of f's change a sample, in squares of its own size
POSE_SPEEDS = tuple(10.0 ** np.arange(-3, 1.1, 1.0))
TRIED = 2000  # samples on which the speed is chosen
LONGEST = 20_000  # samples of one record that are explained
MISSING = 1e12  # variance of a missing sample, in those of a present one


@dataclass(frozen=True, eq=False)
class Free:
    """Along one record: `f` (n, n_axes) [SI] with its standard deviation `sd`, and the `speed` chosen."""

    along: Along
    f: np.ndarray
    sd: np.ndarray
    speed: float


def free(left: Along, noise: Noise, size: np.ndarray) -> Free:
    """The most likely disturbance of typical `size` (n_axes,) [SI] along one record."""
    problem = _Problem(left, noise, size)
    speeds = POSE_SPEEDS if left.settled else SPEEDS
    start = max(0, int(np.argmax(np.convolve(np.sum(left.white**2, axis=1), np.ones(TRIED))[: problem.n])) - TRIED)
    likely = problem.likelihood(np.array(speeds), start, min(start + TRIED, problem.n))
    speed = speeds[int(np.argmax(likely))]
    f, sd = problem.smoothed(speed)
    return Free(left, f, sd, float(speed))


class _Problem:
    """The augmented linear system of one record."""

    def __init__(self, left: Along, noise: Noise, size: np.ndarray) -> None:
        self.n = min(len(left.white), LONGEST)
        self.m, self.k = left.F_S.shape[1], left.F_f.shape[2]
        self.left, self.size = left, size
        density = noise.sd / np.array([1 - min(np.sum(a), 0.99) for a in noise.ar])  # coloured noise counts as white of
        self.variance = np.maximum(density, noise.floor) ** 2  # its density at rest, so that slow noise is no force
        self.P_0 = np.diag(np.concatenate([left.start_sd, size]) ** 2)

    def _step(self, k: int) -> tuple[np.ndarray, np.ndarray]:
        """A from sample k to k + 1, and H at k."""
        m, total = self.m, self.m + self.k
        A = np.zeros((total, total))
        if not self.left.settled:
            A[:m, :m], A[:m, m:] = self.left.F_S[k], self.left.F_f[k]
            A[m:, m:] = np.eye(self.k)
        return A, np.hstack([self.left.H_S[k], self.left.H_f[k]])

    def _noise(self, k: int) -> np.ndarray:
        return np.diag(np.where(self.left.record.valid[k], self.variance, MISSING * self.variance))

    def _change(self, speed: float | np.ndarray) -> np.ndarray:
        Q = np.zeros((*np.shape(speed), self.m + self.k, self.m + self.k))
        i = np.arange(self.m, self.m + self.k)
        Q[..., i, i] = np.multiply.outer(speed, self.size**2)
        return Q

    def likelihood(self, speeds: np.ndarray, first: int, last: int) -> np.ndarray:
        """Log likelihood of each speed on samples `first` ... `last`, all filters side by side."""
        Q = self._change(speeds)
        P = np.broadcast_to(self.P_0, Q.shape) + (Q if self.left.settled else 0.0)
        x, total = np.zeros((len(speeds), len(self.P_0))), np.zeros(len(speeds))
        for k in range(first, last):
            A, H = self._step(k)
            S = H @ P @ H.T + self._noise(k)
            PH = P @ H.T
            inverse = np.linalg.inv(S)
            v = self.left.residual[k] - x @ H.T
            total -= 0.5 * (np.einsum("qi,qij,qj->q", v, inverse, v) + np.linalg.slogdet(S)[1])
            K = PH @ inverse
            x = (x + np.einsum("qij,qj->qi", K, v)) @ A.T
            P = A @ (P - K @ np.swapaxes(PH, 1, 2)) @ A.T + Q
        return total

    def smoothed(self, speed: float) -> tuple[np.ndarray, np.ndarray]:
        """f (n, n_axes) and its standard deviation, given the whole record."""
        n, m, total, Q = self.n, self.m, self.m + self.k, self._change(speed)
        x, P = np.zeros(total), self.P_0 + (Q if self.left.settled else 0.0)
        xs, Ps, kept = np.empty((n, total)), np.empty((n, total, total)), []
        for k in range(n):
            A, H = self._step(k)
            xs[k], Ps[k] = x, P
            inverse = np.linalg.inv(H @ P @ H.T + self._noise(k))
            v, K = self.left.residual[k] - H @ x, P @ H.T @ inverse
            kept.append((A, H, inverse, v, K))
            x, P = A @ (x + K @ v), A @ (P - K @ H @ P) @ A.T + Q
            P = (P + P.T) / 2
        score, information = np.zeros(total), np.zeros((total, total))
        f, sd = np.empty((n, self.k)), np.empty((n, self.k))
        for k in reversed(range(n)):
            A, H, inverse, v, K = kept[k]
            C = np.eye(total) - K @ H
            score, information = C.T @ (A.T @ score), C.T @ (A.T @ information @ A) @ C
            score, information = score - H.T @ inverse @ v, information + H.T @ inverse @ H
            f[k] = (xs[k] - Ps[k] @ score)[m:]
            variance = np.diag(Ps[k] - Ps[k] @ information @ Ps[k])[m:]
            sd[k] = np.sqrt(np.maximum(variance, 0.0))
        return f, sd
