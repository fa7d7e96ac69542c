"""The free force (or displacement) that would explain what a fit leaves, sample by sample.

State (D, f) with D+ = F_S D + F_f f, f+ = f + w (separate poses: f+ = w), y = H_S D + H_f f + e. Kalman filter and the
smoother of A. E. Bryson, M. Frazier, TDR-63-119 (1963), which inverts no covariance. How fast f may change is what makes
the recording most likely; e is the noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ctrlgen.diagnosis.estimation.noise import Noise
from ctrlgen.diagnosis.evidence.ltv_linearisation import LtvModel
from ctrlgen.diagnosis.settings import UNKNOWN_INPUT


@dataclass(frozen=True, eq=False)
class UnknownInput:
    """Along one record: `f` (n, n_axes) [SI] with its standard deviation `sd`, and the `speed` chosen."""

    model: LtvModel
    f: np.ndarray
    sd: np.ndarray
    speed: float


def estimate_unknown_input(left: LtvModel, noise: Noise, size: np.ndarray) -> UnknownInput:
    """The most likely disturbance of typical `size` (n_axes,) [SI] along one record."""
    problem = _Problem(left, noise, size)
    speeds = UNKNOWN_INPUT.pose_random_walks if left.settled else UNKNOWN_INPUT.random_walks
    start = max(
        0,
        int(np.argmax(np.convolve(np.sum(left.white**2, axis=1), np.ones(UNKNOWN_INPUT.tried_samples))[: problem.n]))
        - UNKNOWN_INPUT.tried_samples,
    )
    likely = problem.likelihood(np.array(speeds), start, min(start + UNKNOWN_INPUT.tried_samples, problem.n))
    speed = speeds[int(np.argmax(likely))]
    f, sd = problem.smoothed(speed)
    return UnknownInput(left, f, sd, float(speed))


class _Problem:
    """The augmented linear system of one record, in numbers of order one."""

    def __init__(self, left: LtvModel, noise: Noise, size: np.ndarray) -> None:
        self.n = min(len(left.white), UNKNOWN_INPUT.most_samples)
        self.m, self.k = left.F_S.shape[1], left.F_f.shape[2]
        self.left, self.size = left, size
        density = noise.sd / np.array([1 - min(np.sum(a), 0.99) for a in noise.ar])  # coloured noise counts as white of
        self.sd = np.maximum(density, noise.floor)  # its density at rest, so that slow noise is no force
        self.residual = left.residual / self.sd
        scale = np.concatenate([np.where(left.start_sd > 0, left.start_sd, left.state_scale), size])
        self.up, self.down = scale, 1 / scale
        self.P_0 = np.diag(np.concatenate([left.start_sd > 0, np.ones(self.k)]).astype(float))

    def _step(self, k: int) -> tuple[np.ndarray, np.ndarray]:
        """A from sample k to k + 1, and H at k."""
        m, total = self.m, self.m + self.k
        A = np.zeros((total, total))
        if not self.left.settled:
            A[:m, :m], A[:m, m:] = self.left.F_S[k], self.left.F_f[k]
            A[m:, m:] = np.eye(self.k)
        H = np.hstack([self.left.H_S[k], self.left.H_f[k]])
        return self.down[:, None] * A * self.up, H * self.up / self.sd[:, None]

    def _noise(self, k: int) -> np.ndarray:
        return np.where(self.left.record.valid[k], 1.0, UNKNOWN_INPUT.missing_variance)

    def _change(self, speed: float | np.ndarray) -> np.ndarray:
        Q = np.zeros((*np.shape(speed), self.m + self.k, self.m + self.k))
        i = np.arange(self.m, self.m + self.k)
        Q[..., i, i] = np.asarray(speed)[..., None]
        return Q

    def _update(self, k: int, x: np.ndarray, P: np.ndarray, H: np.ndarray) -> tuple[np.ndarray, ...]:
        """v, S^-1, S, I - K H and x, P after the reading (Joseph's form), for one filter or several."""
        R = self._noise(k)
        S = H @ P @ H.T + np.diag(R)
        inverse = np.linalg.inv(S)
        v = self.residual[k] - x @ H.T
        K = P @ H.T @ inverse
        C = np.eye(len(self.up)) - K @ H
        P = C @ P @ np.swapaxes(C, -1, -2) + K * R @ np.swapaxes(K, -1, -2)
        return v, inverse, S, C, x + (K @ v[..., None])[..., 0], P

    def likelihood(self, speeds: np.ndarray, first: int, last: int) -> np.ndarray:
        """Log likelihood of each speed on samples `first` ... `last`, all filters side by side."""
        Q = self._change(speeds)
        P = Q if self.left.settled else np.broadcast_to(self.P_0, Q.shape)
        x, total = np.zeros((len(speeds), len(self.up))), np.zeros(len(speeds))
        for k in range(first, last):
            A, H = self._step(k)
            v, inverse, S, _, x, P = self._update(k, x, P, H)
            total -= 0.5 * (np.einsum("qi,qij,qj->q", v, inverse, v) + np.linalg.slogdet(S)[1])
            x, P = x @ A.T, A @ P @ A.T + Q
        return total

    def smoothed(self, speed: float) -> tuple[np.ndarray, np.ndarray]:
        """f (n, n_axes) and its standard deviation [SI], given the whole record."""
        n, m, total, Q = self.n, self.m, len(self.up), self._change(speed)
        x, P = np.zeros(total), Q if self.left.settled else self.P_0
        xs, Ps, kept = np.empty((n, total)), np.empty((n, total, total)), []
        for k in range(n):
            A, H = self._step(k)
            xs[k], Ps[k] = x, P
            v, inverse, _, C, x, P = self._update(k, x, P, H)
            kept.append((A, H.T @ inverse, H, v, C))
            x, P = A @ x, A @ P @ A.T + Q
        score, information = np.zeros(total), np.zeros((total, total))
        f, sd = np.empty((n, self.k)), np.empty((n, self.k))
        for k in reversed(range(n)):
            A, weight, H, v, C = kept[k]
            AC = A @ C
            score, information = AC.T @ score - weight @ v, AC.T @ information @ AC + weight @ H
            f[k] = (xs[k] - Ps[k] @ score)[m:]
            variance = np.diag(Ps[k] - Ps[k] @ information @ Ps[k])[m:]
            sd[k] = np.sqrt(np.maximum(variance, 0.0))
        return f * self.size, sd * self.size
