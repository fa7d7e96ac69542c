"""The least-squares problem of one structure: whitened residual and Jacobian, in scaled variables.

min rho(W (y - y(p, s))) + sum ((p_i - nominal_i)/sd_i)^2 + sum ((s_j - s0_j)/sd_j)^2 over the free parameters p and the initial
states s of the records to fit, s0 where these are expected. W whitens with the error model, rho is Huber's loss; the second sum holds
the device's own numbers near what is stated of them.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ctrlgen.estimation.error_model import ErrorModel, huber, huber_curvature
from ctrlgen.estimation.free_parameters import FreeParameter
from ctrlgen.estimation.noise import Noise
from ctrlgen.estimation.settings import FIT
from ctrlgen.estimation.simulator import Simulator
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Record, Recording


def initial_state_sd(simulator: Simulator) -> np.ndarray:
    """Prior standard deviations [SI] of a record's free initial states."""
    m = simulator.model
    return FIT.start_size * np.concatenate([m.x_scale, m.z_scale])[list(simulator.free_initial_states)]


def whiten_residual(noise: Noise | ErrorModel, record: Record, y: np.ndarray) -> np.ndarray:
    """Observed minus `y` (n, n_y) [SI], whitened; zero where a sample is not usable, bounded where `y` has diverged."""
    residual = np.where(record.valid, record.observed - y, 0.0)
    return noise.whiten(_bounded(residual, FIT.reading_limit), record.valid)


def limited(whitened: np.ndarray) -> np.ndarray:
    """A whitened residual with `FIT.residual_limit` in place of what is larger or undefined."""
    most = FIT.residual_limit
    return np.where(np.isfinite(whitened), np.clip(whitened, -most, most), most)


def _bounded(values: np.ndarray, most: float) -> np.ndarray:
    return np.clip(np.nan_to_num(values, nan=most), -most, most)


class Evaluated(NamedTuple):
    """A residual (m,) and its Jacobian (m, n) at x (n,); `curvature` as of `huber_curvature`, of the readings."""

    x: np.ndarray
    residual: np.ndarray
    J: np.ndarray
    curvature: np.ndarray


class LeastSquaresProblem:
    """Residual (m,) and Jacobian (m, k + n_s) of k free parameters and n_s initial states, as functions of scaled x.

    Rows: the readings of each record to fit, sample by sample; then the parameters with a stated standard deviation; then
    the initial states. Variables: the free parameters, then the initial states of each record. x is a value over its typical
    size; of a time or a speed that shapes a law, which may lie anywhere within decades, x is the logarithm. `expected` (n_s,) [SI] are the
    initial states about which the prior of these lies.
    """

    def __init__(self, structure: Structure, recording: Recording, error: ErrorModel) -> None:
        self.structure, self.error = structure, error
        self.records = [r for r in recording.records if r.role == "fit"]
        self.simulators = {t: structure.simulator(recording.channels, t) for t in {r.timing for r in self.records}}
        self.initial_sd = [initial_state_sd(self.simulators[r.timing]) for r in self.records]
        self.n_initial = sum(map(len, self.initial_sd))
        self.expected = np.zeros(self.n_initial)
        parameters = structure.free_parameters
        self.k = len(parameters)
        self.scale = np.concatenate([[p.size for p in parameters], *self.initial_sd]).astype(float)
        self.prior = [(i, p) for i, p in enumerate(parameters) if p.sd]
        self.log = np.array([by_logarithm(p) for p in parameters] + [False] * self.n_initial, dtype=bool)
        self.step_limit = np.where(self.log, FIT.longest_log_step, np.inf)
        self._last: list[Evaluated] = []

    def to_scaled(self, values: np.ndarray) -> np.ndarray:
        """x of SI `values`, (k + n_s,)."""
        x = values / self.scale
        x[self.log] = np.log(values[self.log])
        return x

    def to_si(self, x: np.ndarray) -> np.ndarray:
        """SI values of x, (k + n_s,)."""
        values = x * self.scale
        values[self.log] = np.exp(x[self.log])
        return values

    def si_by_scaled(self, values: np.ndarray) -> np.ndarray:
        """Derivatives of the SI values by their own x, (k + n_s,), at SI `values`."""
        return np.where(self.log, values, self.scale)

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest x."""
        parameters, most = (
            self.structure.free_parameters,
            np.full(self.n_initial, FIT.start_reach) * self.scale[self.k :],
        )
        low = np.concatenate([[p.low for p in parameters], -most])
        high = np.concatenate([[p.high for p in parameters], most])
        return self.to_scaled(low), self.to_scaled(high)

    def residual(self, x: np.ndarray) -> np.ndarray:
        """The residual (m,) alone, without the work that the Jacobian takes."""
        values = self.to_si(x)
        rows = [
            huber(self._white(record, simulator.simulate(record, values[: self.k], values[places])), self.error.corner)[
                0
            ].ravel()
            for record, simulator, places in self._records()
        ]
        return self._with_prior(rows, x)

    def evaluate(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residual (m,) and Jacobian (m, k + n_s) by x; the last two results are kept."""
        for kept in self._last:
            if np.array_equal(kept.x, x):
                return kept.residual, kept.J
        values, k = self.to_si(x), self.k
        si_by_scaled = self.si_by_scaled(values)
        rows, blocks, curvature = [], [], []
        for record, simulator, places in self._records():
            y, Y = simulator.sensitivities(record, values[:k], values[places])
            white = self._white(record, y)
            robust, weight = huber(white, self.error.corner)
            rows.append(robust.ravel())
            curvature.append(huber_curvature(white, self.error.corner).ravel())
            W = self.error.whiten(_clipped(Y), record.valid).reshape(len(rows[-1]), Y.shape[2]) * weight.reshape(-1, 1)
            J = np.zeros((len(W), len(x)))
            J[:, :k], J[:, places] = -W[:, :k], -W[:, k:]
            blocks.append(J * si_by_scaled)
        P = np.zeros((len(self.prior), len(x)))
        for row, (i, p) in enumerate(self.prior):
            P[row, i] = self.scale[i] / p.sd
        J = np.nan_to_num(np.vstack([*blocks, P, np.eye(len(x))[k:]]), posinf=0.0, neginf=0.0)
        evaluated = Evaluated(x.copy(), self._with_prior(rows, x), J, np.concatenate(curvature or [np.zeros(0)]))
        # the one that a step began at, and where it led
        self._last = [*self._last[-1:], evaluated]
        return evaluated.residual, J

    def normal_matrix(self, J: np.ndarray) -> np.ndarray:
        """J'J (k + n_s, k + n_s) of one of the last two Jacobians, with more weight on readings beyond the corner of the loss."""
        curvature = next(kept.curvature for kept in self._last if kept.J is J)
        beyond = np.flatnonzero(curvature > 1.0)
        more = J[beyond] * np.sqrt(curvature[beyond] - 1.0)[:, None]
        return J.T @ J + more.T @ more

    def _white(self, record: Record, y: np.ndarray) -> np.ndarray:
        """The whitened residual (n, n_y) of the readings `y` [SI]."""
        return limited(whiten_residual(self.error, record, y))

    def _records(self) -> Iterator[tuple[Record, Simulator, slice]]:
        """Each record to fit, its simulator, and the places of its initial states among the variables."""
        first = self.k
        for record, sd in zip(self.records, self.initial_sd, strict=True):
            yield record, self.simulators[record.timing], slice(first, first + len(sd))
            first += len(sd)

    def _with_prior(self, rows: list[np.ndarray], x: np.ndarray) -> np.ndarray:
        """The residual of the readings, by record, followed by that of the prior."""
        values = self.to_si(x)
        prior = [(values[i] - p.nominal) / p.sd for i, p in self.prior]
        return limited(np.concatenate([*rows, prior, (values[self.k :] - self.expected) / self.scale[self.k :]]))


def _clipped(sensitivities: np.ndarray) -> np.ndarray:
    return np.clip(np.nan_to_num(sensitivities), -FIT.reading_limit, FIT.reading_limit)


def by_logarithm(p: FreeParameter) -> bool:
    """Whether a parameter is fitted by its logarithm: a positive time or speed that shapes a cause."""
    return p.cause is not None and not p.amplitude and (p.unit == "s" or p.unit.endswith("/s")) and p.low > 0
