"""Unknown-input estimation: the force (or displacement) at each sample that would explain the residual of a fit.

The input f is a random walk, f+ = f + w; for settled poses it is independent from pose to pose, f+ = w. With the LTV model
D+ = F_S D + F_f f, y = H_S D + H_f f + e, a Kalman filter and the smoother of Bryson and Frazier, which inverts no state
covariance, give its conditional mean and standard deviation. The variance of w maximises the likelihood; e is the noise.

Source: A. E. Bryson, M. Frazier, Smoothing for linear and nonlinear dynamic systems, TDR-63-119 (1963).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ctrlgen.diagnosis.evidence.ltv_linearisation import LtvModel
from ctrlgen.diagnosis.settings import UNKNOWN_INPUT
from ctrlgen.estimation.noise import Noise


@dataclass(frozen=True, eq=False)
class UnknownInput:
    """Input of one record: `f` (n, n_axes) [SI], its standard deviation `sd`, and the variance of its random walk, relative."""

    model: LtvModel
    f: np.ndarray
    sd: np.ndarray
    speed: float


def estimate_unknown_input(model: LtvModel, noise: Noise, size: np.ndarray) -> UnknownInput:
    """The unknown input along one record; `size` (n_axes,) [SI] is its typical size, in which the random walk is counted."""
    problem = _Problem(model, noise, size)
    speeds = UNKNOWN_INPUT.pose_random_walks if model.poses else UNKNOWN_INPUT.random_walks
    start = max(
        0,
        int(np.argmax(np.convolve(np.sum(model.white**2, axis=1), np.ones(UNKNOWN_INPUT.tried_samples))[: problem.n]))
        - UNKNOWN_INPUT.tried_samples,
    )
    likely = problem.likelihood(np.array(speeds), start, min(start + UNKNOWN_INPUT.tried_samples, problem.n))
    speed = speeds[int(np.argmax(likely))]
    f, sd = problem.smoothed(speed)
    return UnknownInput(model, f, sd, float(speed))


class _Problem:
    """The augmented system (D, f) of one record, scaled to order one."""

    def __init__(self, model: LtvModel, noise: Noise, size: np.ndarray) -> None:
        self.n = min(len(model.white), UNKNOWN_INPUT.most_samples)
        self.m, self.k = model.F_S.shape[1], model.F_f.shape[2]
        self.model, self.size = model, size
        # coloured noise is taken as white noise of its density at zero frequency, so that slow noise does not appear as a force
        density = noise.sd / np.array([1 - min(np.sum(a), 0.99) for a in noise.ar])
        self.sd = np.maximum(density, noise.floor)
        residual, self.valid = model.advanced
        self.residual = residual / self.sd
        scale = np.concatenate([np.where(model.start_sd > 0, model.start_sd, model.state_scale), size])
        self.up, self.down = scale, 1 / scale
        self.P_0 = np.diag(np.concatenate([model.start_sd > 0, np.ones(self.k)]).astype(float))

    def _step(self, k: int) -> tuple[np.ndarray, np.ndarray]:
        """Transition matrix from sample k to k + 1, and output matrix at k."""
        m, total = self.m, self.m + self.k
        A = np.zeros((total, total))
        if not self.model.poses:
            A[:m, :m], A[:m, m:] = self.model.F_S[k], self.model.F_f[k]
            A[m:, m:] = np.eye(self.k)
        H = np.hstack([self.model.H_S[k], self.model.H_f[k]])
        return self.down[:, None] * A * self.up, H * self.up / self.sd[:, None]

    def _noise(self, k: int) -> np.ndarray:
        return np.where(self.valid[k], 1.0, UNKNOWN_INPUT.missing_variance)

    def _change(self, speed: float | np.ndarray) -> np.ndarray:
        Q = np.zeros((*np.shape(speed), self.m + self.k, self.m + self.k))
        i = np.arange(self.m, self.m + self.k)
        Q[..., i, i] = np.asarray(speed)[..., None]
        return Q

    def _update(self, k: int, x: np.ndarray, P: np.ndarray, H: np.ndarray) -> tuple[np.ndarray, ...]:
        """Innovation v, S^-1, S, I - K H, and x, P after the measurement update (Joseph form), for one filter or several."""
        R = self._noise(k)
        S = H @ P @ H.T + np.diag(R)
        inverse = np.linalg.inv(S)
        v = self.residual[k] - x @ H.T
        K = P @ H.T @ inverse
        C = np.eye(len(self.up)) - K @ H
        P = C @ P @ np.swapaxes(C, -1, -2) + K * R @ np.swapaxes(K, -1, -2)
        return v, inverse, S, C, x + (K @ v[..., None])[..., 0], P

    def likelihood(self, speeds: np.ndarray, first: int, last: int) -> np.ndarray:
        """Log likelihood of each random-walk variance on samples `first` ... `last`; all filters run side by side."""
        Q = self._change(speeds)
        P = Q if self.model.poses else np.broadcast_to(self.P_0, Q.shape)
        x, total = np.zeros((len(speeds), len(self.up))), np.zeros(len(speeds))
        for k in range(first, last):
            A, H = self._step(k)
            v, inverse, S, _, x, P = self._update(k, x, P, H)
            total -= 0.5 * (np.einsum("qi,qij,qj->q", v, inverse, v) + np.linalg.slogdet(S)[1])
            x, P = x @ A.T, A @ P @ A.T + Q
        return total

    def smoothed(self, speed: float) -> tuple[np.ndarray, np.ndarray]:
        """Smoothed f (n, n_axes) and its standard deviation [SI], given the whole record."""
        n, m, total, Q = self.n, self.m, len(self.up), self._change(speed)
        x, P = np.zeros(total), Q if self.model.poses else self.P_0
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
