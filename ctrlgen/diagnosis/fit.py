"""Steps 2 and 7: the free numbers of a structure from the records to fit, by trust-region least squares.

min |W (y - y(p))|^2 + sum ((p - p_0)/sd)^2: W whitens with the noise, the second sum holds the device's own numbers
within what is stated of them. Every parameter of every cause is fitted jointly with them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import least_squares

from ctrlgen.diagnosis.noise import Noise
from ctrlgen.diagnosis.structure import Structure
from ctrlgen.recording import Record, Recording

STEPS = 40
WORST = 1e8  # whitened residual of a simulation that has left the numbers
START_SIZE = 0.3  # of a state's typical size: how far a record may start from rest


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted structure. `theta` the unknowns [SI], `starts` what each record to fit starts with; `chi2` of the
    readings alone, over `n` usable samples; `J` whitened slopes with the prior's rows, by unknowns, then starts."""

    structure: Structure
    theta: np.ndarray
    starts: tuple[np.ndarray, ...]
    chi2: float
    n: int
    residual: np.ndarray
    J: np.ndarray
    penalty: float

    @property
    def objective(self) -> float:
        """What was minimised."""
        return self.chi2 + self.penalty

    @cached_property
    def covariance(self) -> np.ndarray:
        """Of the unknowns [SI^2], from the slopes at the optimum; numbers that nothing holds get an infinite variance."""
        scale = np.linalg.norm(self.J, axis=0)
        scale[scale == 0] = 1.0
        inverse = np.linalg.pinv((self.J / scale).T @ (self.J / scale), rcond=1e-14)
        k = len(self.theta)
        return (inverse / np.outer(scale, scale))[:k, :k]

    def values(self, cause: int) -> dict[str, float]:
        """The parameters of one cause [SI]."""
        found = dict(self.structure.starts[cause])
        for unknown, value in zip(self.structure.unknowns, self.theta, strict=True):
            if unknown.cause == cause:
                found[unknown.name] = float(value)
        return found


class Fitter:
    """Fits structures to one recording with one noise model; keeps compiled responses."""

    def __init__(self, recording: Recording, noise: Noise) -> None:
        self.recording, self.noise = recording, noise
        self.cache: dict = {}
        self.to_fit = [r for r in recording.records if r.role == "fit"]
        self.held = [r for r in recording.records if r.role == "hold_out"]

    def fit(self, structure: Structure, theta: np.ndarray | None = None, steps: int = STEPS) -> Fit:
        """The optimum from `theta`, or from the structure's own start."""
        problem = _Problem(self, structure)
        low, high = problem.bounds
        begin = (
            np.concatenate([structure.start if theta is None else theta, np.zeros(problem.n_starts)]) / problem.scale
        )
        begin = np.clip(begin, low + 1e-12 * (high - low), high - 1e-12 * (high - low))
        if len(begin):
            found = least_squares(
                problem.residual, begin, problem.slopes, bounds=(low, high), method="trf", x_scale="jac", max_nfev=steps,
                ftol=1e-7, xtol=1e-9, gtol=1e-9,
            ).x  # fmt: skip
        else:
            found = begin
        return problem.result(found * problem.scale)

    def learn_noise(self, fit: Fit) -> None:
        """Where nothing but the misfit tells the noise: what `fit` leaves over, alike for all channels of one unit."""
        channels = self.recording.channels
        squares, count = np.zeros(len(channels)), np.zeros(len(channels))
        for record in self.to_fit:
            y = self.predicted(fit, record)
            squares += np.sum(np.where(record.valid, record.observed - y, 0.0) ** 2, axis=0)
            count += record.valid.sum(axis=0)
        sd = self.noise.sd.copy()
        used = len(fit.theta) / max(count.sum(), 1.0)
        for i in np.flatnonzero(~self.noise.known):
            alike = [k for k in range(len(channels)) if self.recording.units[k] == self.recording.units[i]]
            sd[i] = np.sqrt(squares[alike].sum() / (count[alike].sum() * (1 - used)))
        self.noise = Noise(sd, self.noise.ar, self.noise.known, self.noise.said)

    def predicted(self, fit: Fit, record: Record) -> np.ndarray:
        """Readings (n, n_y) of a fitted structure on any record, started as the record itself says best."""
        response = fit.structure.responses(self.recording, self.cache)[record.sample_time, record.linear]
        start = np.zeros(len(response.initial))
        if len(start) == 0:
            return response.outputs(record, fit.theta)
        sizes = _start_sizes(response)
        for _ in range(2):  # readings are close to linear in what a record starts with
            y, slopes = response.sensitivities(record, fit.theta, start)
            white = self.noise.whiten(np.where(record.valid, record.observed - y, 0.0), record.valid).ravel()
            J = self.noise.whiten(slopes[:, :, len(fit.theta) :], record.valid).reshape(len(white), len(start)) * sizes
            with_prior = np.vstack([J, np.eye(len(start))])
            step = np.linalg.lstsq(with_prior, np.concatenate([white, -start / sizes]), rcond=None)[0]
            start = start + step * sizes
        return response.outputs(record, fit.theta, start)

    def whitened(self, fit: Fit, record: Record) -> np.ndarray:
        """The whitened residual (n, n_y) on any record; zero where a sample is not usable."""
        y = self.predicted(fit, record)
        return self.noise.whiten(np.where(record.valid, record.observed - y, 0.0), record.valid)

    def held_out(self, fit: Fit) -> tuple[float, int]:
        """Whitened sum of squares on the held-out records, and the number of usable samples."""
        total = sum(float(np.sum(_finite(self.whitened(fit, r)) ** 2)) for r in self.held)
        return total, int(sum(self.noise.usable(r.valid).sum() for r in self.held))


def _finite(values: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(values), np.clip(values, -WORST, WORST), WORST)


def _start_sizes(response: object) -> np.ndarray:
    m = response.model
    return START_SIZE * np.concatenate([m.x_scale, m.z_scale])[list(response.initial)]


class _Problem:
    """Residual and slopes of one structure, in numbers of order one."""

    def __init__(self, fitter: Fitter, structure: Structure) -> None:
        self.fitter, self.structure = fitter, structure
        self.responses = structure.responses(fitter.recording, fitter.cache)
        self.records = fitter.to_fit
        self.sizes = [_start_sizes(self.responses[r.sample_time, r.linear]) for r in self.records]
        self.n_starts = sum(map(len, self.sizes))
        self.k = len(structure.unknowns)
        self.scale = np.concatenate([[u.size for u in structure.unknowns], *self.sizes]).astype(float)
        self.at: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        low = np.concatenate(
            [[u.low for u in self.structure.unknowns], np.full(self.n_starts, -1e3) * self.scale[self.k :]]
        )
        high = np.concatenate(
            [[u.high for u in self.structure.unknowns], np.full(self.n_starts, 1e3) * self.scale[self.k :]]
        )
        return low / self.scale, high / self.scale

    def _evaluate(self, scaled: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        if self.at is not None and np.array_equal(self.at[0], scaled):
            return self.at
        values, k, noise = scaled * self.scale, self.k, self.fitter.noise
        rows, slopes, first = [], [], k
        for record, sizes in zip(self.records, self.sizes, strict=True):
            response = self.responses[record.sample_time, record.linear]
            own = slice(first, first + len(sizes))
            first += len(sizes)
            y, Y = response.sensitivities(record, values[:k], values[own])
            white = noise.whiten(np.where(record.valid, record.observed - y, 0.0), record.valid).ravel()
            J = np.zeros((len(white), len(scaled)))
            W = noise.whiten(Y, record.valid).reshape(len(white), Y.shape[2])
            J[:, :k], J[:, own] = -W[:, :k], -W[:, k:]
            rows.append(white)
            slopes.append(J * self.scale)
        self.n_readings = sum(map(len, rows))
        prior = [(i, u) for i, u in enumerate(self.structure.unknowns) if u.sd]
        rows.append(np.array([(values[i] - u.nominal) / u.sd for i, u in prior]))
        P = np.zeros((len(prior), len(scaled)))
        for row, (i, u) in enumerate(prior):
            P[row, i] = self.scale[i] / u.sd
        slopes += [P, np.eye(len(scaled))[k:]]
        rows.append(scaled[k:])
        self.at = (
            scaled.copy(),
            _finite(np.concatenate(rows)),
            np.nan_to_num(np.vstack(slopes), posinf=0.0, neginf=0.0),
        )
        return self.at

    def residual(self, scaled: np.ndarray) -> np.ndarray:
        return self._evaluate(scaled)[1]

    def slopes(self, scaled: np.ndarray) -> np.ndarray:
        return self._evaluate(scaled)[2]

    def result(self, values: np.ndarray) -> Fit:
        _, rows, J = self._evaluate(values / self.scale)
        starts = np.split(values[self.k :], np.cumsum([len(s) for s in self.sizes])[:-1])
        readings = rows[: self.n_readings]
        usable = sum(int(self.fitter.noise.usable(r.valid).sum()) for r in self.records)
        return Fit(
            self.structure, values[: self.k], tuple(starts), float(readings @ readings), usable, rows, J / self.scale,
            float(rows[self.n_readings :] @ rows[self.n_readings :]),
        )  # fmt: skip
