"""Steps 2 and 7: the free numbers of a structure from the records to fit, by damped least squares.

min |W (y - y(p))|^2 + sum ((p - p_0)/sd)^2: W whitens with the noise, the second sum holds the device's own numbers
within what is stated of them. Every parameter of every cause is fitted jointly with them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ctrlgen.devices import Device
from ctrlgen.diagnosis.estimation.checkpoint import Checkpoint, key_of
from ctrlgen.diagnosis.estimation.noise import Noise
from ctrlgen.diagnosis.estimation.simulator import Simulator
from ctrlgen.diagnosis.estimation.structure import Structure
from ctrlgen.diagnosis.settings import FIT, HELD_OUT_REFIT, STATISTICS
from ctrlgen.numerics.levenberg_marquardt import levenberg_marquardt
from ctrlgen.recordings.recording import Record, Recording


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted structure. `theta` the unknowns [SI], `initial_states` what each record to fit starts with; `chi2` of the
    readings alone, over `n` usable samples; `residual` and `J` the whitened residual and its slopes by the unknowns, then
    the starts: rows of the readings of records of `shapes` (samples, channels), then of the prior."""

    structure: Structure
    theta: np.ndarray
    initial_states: tuple[np.ndarray, ...]
    chi2: float
    n: int
    residual: np.ndarray
    J: np.ndarray
    penalty: float
    shapes: tuple[tuple[int, int], ...] = ()

    @property
    def objective(self) -> float:
        """What was minimised."""
        return self.chi2 + self.penalty

    @property
    def is_noise(self) -> bool:
        """Whether it leaves no more than noise."""
        return self.objective < self.n + STATISTICS.chance_excess * np.sqrt(2 * self.n)

    @cached_property
    def covariance(self) -> np.ndarray:
        """Of the unknowns [SI^2], from the slopes at the optimum."""
        scale = np.linalg.norm(self.J, axis=0)
        scale[scale == 0] = 1.0
        inverse = np.linalg.pinv((self.J / scale).T @ (self.J / scale), rcond=1e-14)
        k = len(self.theta)
        return (inverse / np.outer(scale, scale))[:k, :k]

    @cached_property
    def information_root(self) -> np.ndarray:
        """R (k, k) of the unknowns with |R dp|^2 = dp' C^-1 dp: what the readings say of them whatever the starts are."""
        k = len(self.theta)
        if self.J.shape[1] == k:
            return np.linalg.qr(self.J).R
        Q = np.linalg.qr(self.J[:, k:])[0]
        return np.linalg.qr(self.J[:, :k] - Q @ (Q.T @ self.J[:, :k])).R

    def values(self, cause: int) -> dict[str, float]:
        """The parameters of one cause [SI]."""
        found = dict(self.structure.starts[cause])
        for unknown, value in zip(self.structure.free_parameters, self.theta, strict=True):
            if unknown.cause == cause:
                found[unknown.name] = float(value)
        return found

    def nested_case(self, cause: int) -> str | None:
        """The effect that a cause may as well be, its law's nested case lies inside the 95 % interval."""
        hypothesis = self.structure.causes[cause]
        nested = hypothesis.prior.nested_case
        if nested is None:
            return None
        i = next(
            i for i, u in enumerate(self.structure.free_parameters) if u.cause == cause and u.name == nested.parameter
        )
        sd = np.sqrt(max(self.covariance[i, i], 0.0))
        return nested.effect if abs(self.theta[i] - nested.value) <= STATISTICS.z_95 * sd else None


class Fitter:
    """Fits structures to one recording with one noise model; keeps compiled responses, and optima in a `journal`."""

    def __init__(self, recording: Recording, noise: Noise, checkpoint: Checkpoint | None = None) -> None:
        self.recording, self.noise, self.checkpoint = recording, noise, checkpoint
        self.cache: dict = {}

    @property
    def fit_records(self) -> list[Record]:
        """The records to fit."""
        return [r for r in self.recording.records if r.role == "fit"]

    @property
    def held_out_records(self) -> list[Record]:
        """The records held out."""
        return [r for r in self.recording.records if r.role == "hold_out"]

    def fit(
        self,
        structure: Structure,
        theta: np.ndarray | None = None,
        steps: int = FIT.max_steps,
        nested: Fit | None = None,
    ) -> Fit:
        """The optimum from `theta`, or from the structure's own start.

        What ends above a fit `nested` in it began too far away: it begins again there, its new causes all but off, and once
        more with the device's own numbers as stated, which that fit may have bent to stand in for the new causes.
        """
        problem = _Problem(self, structure)
        begin = np.concatenate([structure.start if theta is None else theta, np.zeros(problem.n_starts)])
        found = self._optimum(problem, begin, steps)
        if nested is None or found.objective <= nested.objective:
            return found
        for i, u in enumerate(structure.free_parameters):
            if u.amplitude and structure.cause_of(u) not in nested.structure.causes:
                begin[i] = u.nominal + FIT.restart_amplitude * (begin[i] - u.nominal)
        begin[problem.k :] = np.concatenate(nested.initial_states)
        stated = np.concatenate([structure.start, np.zeros(problem.n_starts)])
        for i, u in enumerate(structure.free_parameters):
            if u.cause is None:
                stated[i] = u.nominal
        again = (self._optimum(problem, start, steps) for start in (begin, stated))
        return min(found, *again, key=lambda fit: fit.objective)

    def fit_described(self, device: Device) -> Fit:
        """The device as described; where that leaves far more than noise, begun a deviation beside each stated number too:
        what drifts, or saturates in a loop, bends too much for one start."""
        found = self.fit(Structure(device))
        if not self.noise.known.all() or found.objective < FIT.poor_start_rms**2 * found.n:
            return found
        for u in found.structure.free_parameters:
            for start in (u.nominal - u.sd, u.nominal + u.sd) if u.sd else ():
                found = min(
                    found, self.fit(Structure(device, nominal_starts={u.path: start})), key=lambda fit: fit.objective
                )
        return found

    def initial_objective(self, structure: Structure) -> float:
        """The objective where a fit of the structure begins."""
        problem = _Problem(self, structure)
        rows = problem.residual(problem.inner(np.concatenate([structure.start, np.zeros(problem.n_starts)])))
        return float(rows @ rows)

    def _optimum(self, problem: _Problem, begin: np.ndarray, steps: int) -> Fit:
        """From the journal, where it has been found before."""
        if self.checkpoint is None:
            return problem.result(levenberg_marquardt(problem, problem.inner(begin), steps))
        s, noise = problem.structure, self.noise
        valid = [int(r.valid.sum()) for r in self.recording.records]
        key = key_of(s.causes, s.starts, sorted(s.nominal_starts.items()), begin, steps, noise.sd, *noise.ar, valid)
        optimum = self.checkpoint.recall(key)
        if optimum is None:
            optimum = levenberg_marquardt(problem, problem.inner(begin), steps)
            self.checkpoint.keep(key, optimum)
        return problem.result(optimum)

    def predict(self, fit: Fit, record: Record) -> np.ndarray:
        """Readings (n, n_y) of a fitted structure on any record, started as the record itself says best."""
        simulator = fit.structure.simulators(self.recording, self.cache)[record.sample_time, record.linear]
        start = np.zeros(len(simulator.free_initial_states))
        if len(start) == 0:
            return simulator.simulate(record, fit.theta)
        sizes = start_sizes(simulator)
        y, slopes = simulator.sensitivities(record, fit.theta, start, by_free=False)  # close to linear in the start
        white = self._white(record, y)
        J = self.noise.whiten(slopes, record.valid).reshape(len(white), len(start)) * sizes
        if not (np.isfinite(white).all() and np.isfinite(J).all()):
            return y
        with_prior = np.vstack([J, np.eye(len(start))])
        step = np.linalg.lstsq(with_prior, np.concatenate([white, np.zeros(len(start))]), rcond=None)[0]
        for _ in range(HELD_OUT_REFIT.halvings):  # but not where something has to be crossed before anything moves
            found = simulator.simulate(record, fit.theta, sizes * step)
            left = self._white(record, found)
            if left @ left + step @ step <= white @ white:
                return found
            step = step / 4
        return y

    def _white(self, record: Record, y: np.ndarray) -> np.ndarray:
        return self.noise.whiten(np.where(record.valid, record.observed - y, 0.0), record.valid).ravel()

    def whitened_residual(self, fit: Fit, record: Record) -> np.ndarray:
        """The whitened residual (n, n_y) on any record; zero where a sample is not usable."""
        y = self.predict(fit, record)
        left = np.where(record.valid, record.observed - y, 0.0)
        return _finite(
            self.noise.whiten(
                np.clip(np.nan_to_num(left, nan=FIT.reading_limit), -FIT.reading_limit, FIT.reading_limit), record.valid
            )
        )

    def held_out_deviance(self, fit: Fit) -> float:
        """-2 ln of how likely the held-out records are, as the numbers are known from the records to fit.

        |r(p + dp)|^2 + dp' C^-1 dp + ln det(I + C J'J), see `as_known`: numbers that the records to fit leave open are not
        held against their structure, and earn it nothing. One step there says enough of a structure that does not nearly
        explain the records to fit.
        """
        moved, price, spread = self.refitted_to_held_out(
            fit, HELD_OUT_REFIT.max_steps if fit.objective < HELD_OUT_REFIT.nearly_noise * fit.n else 1
        )
        return self.held_out_squares(moved) + price + spread

    def refitted_to_held_out(self, fit: Fit, steps: int = 1) -> tuple[Fit, float, float]:
        """The fit with its numbers p moved to where the held-out records are most likely, as p is known from the records to
        fit, by at most so many steps of Gauss and Newton; the price dp' C^-1 dp; ln det(I + C J'J). C the covariance of p,
        r and J the whitened residual and its slopes there. The fit itself, at no price, where no step helps.
        """
        sd = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
        sd[~fit.J[:, : len(sd)].any(axis=0) | ~np.isfinite(sd)] = 0.0  # what nothing holds stays where it is
        if not sd.any():
            return fit, 0.0, 0.0
        unit = np.where(sd > 0, sd, 1.0)
        C = fit.covariance / np.outer(unit, unit) * np.outer(sd > 0, sd > 0)
        R, best = fit.information_root * sd, (fit, 0.0, 0.0)
        low, high = (np.array([getattr(u, end) for u in fit.structure.free_parameters]) for end in ("low", "high"))
        least = self.held_out_squares(fit)
        for k in range(steps):
            b, H = self._held_slopes(best[0], sd)
            spread = np.eye(len(sd)) + C @ H
            if not np.isfinite(spread).all() or not np.isfinite(b).all():
                break
            if k == 0:
                best = fit, 0.0, float(np.linalg.slogdet(spread)[1])
            begin = best[0].theta
            step = sd * np.linalg.solve(spread, C @ b - (begin - fit.theta) / unit)
            before = least
            for halved in range(HELD_OUT_REFIT.halvings if steps > 1 else 1):
                moved = replace(fit, theta=np.clip(begin + step / 2**halved, low, high))
                price = float(np.sum((R @ ((moved.theta - fit.theta) / unit)) ** 2))
                total = self.held_out_squares(moved) + price
                if total < least:
                    best, least = (moved, price, best[2]), total
                    break
            if not least < before - HELD_OUT_REFIT.settled:
                break
        return best

    def _held_slopes(self, fit: Fit, sd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """J'r and J'J of the held-out records, J by the numbers in units of `sd`."""
        b, H = np.zeros(len(sd)), np.zeros((len(sd), len(sd)))
        for record in self.held_out_records:
            simulator = fit.structure.simulators(self.recording, self.cache)[record.sample_time, record.linear]
            J = self.noise.whiten(simulator.sensitivities(record, fit.theta)[1][:, :, : len(sd)], record.valid) * sd
            J = J.reshape(-1, len(sd))
            b, H = b + J.T @ self.whitened_residual(fit, record).ravel(), H + J.T @ J
        return b, H

    def held_out_squares(self, fit: Fit) -> float:
        """What a fit leaves of the held-out records, whitened."""
        return sum(float(np.sum(self.whitened_residual(fit, r) ** 2)) for r in self.held_out_records)


def _finite(values: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(values), np.clip(values, -FIT.residual_limit, FIT.residual_limit), FIT.residual_limit)


def start_sizes(simulator: Simulator) -> np.ndarray:
    """How far a record may start from rest, by state [SI]."""
    m = simulator.model
    return FIT.start_size * np.concatenate([m.x_scale, m.z_scale])[list(simulator.free_initial_states)]


class _Problem:
    """Residual and slopes of one structure, in numbers of order one: `inner` ones.

    Times and speeds that shape a cause may lie anywhere in decades, and are searched by their logarithms.
    """

    def __init__(self, fitter: Fitter, structure: Structure) -> None:
        self.fitter, self.structure = fitter, structure
        self.simulators = structure.simulators(fitter.recording, fitter.cache)
        self.records = fitter.fit_records
        self.sizes = [start_sizes(self.simulators[r.sample_time, r.linear]) for r in self.records]
        self.n_starts = sum(map(len, self.sizes))
        self.k = len(structure.free_parameters)
        self.scale = np.concatenate([[u.size for u in structure.free_parameters], *self.sizes]).astype(float)
        self.prior = [(i, u) for i, u in enumerate(structure.free_parameters) if u.sd]
        self.at: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
        self.log = np.array(
            [
                u.cause is not None and not u.amplitude and (u.unit == "s" or u.unit.endswith("/s")) and u.low > 0
                for u in structure.free_parameters
            ]
            + [False] * self.n_starts,
            dtype=bool,
        )
        self.most = np.where(self.log, FIT.longest_log_step, np.inf)

    def inner(self, values: np.ndarray) -> np.ndarray:
        """Numbers of order one from SI."""
        found = values / self.scale
        found[self.log] = np.log(values[self.log])
        return found

    def outer(self, inner: np.ndarray) -> np.ndarray:
        """SI from numbers of order one."""
        found = inner * self.scale
        found[self.log] = np.exp(inner[self.log])
        return found

    def by_inner(self, values: np.ndarray) -> np.ndarray:
        """How SI numbers change with those of order one."""
        return np.where(self.log, values, self.scale)

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        low = np.concatenate(
            [
                [u.low for u in self.structure.free_parameters],
                np.full(self.n_starts, -FIT.start_reach) * self.scale[self.k :],
            ]
        )
        high = np.concatenate(
            [
                [u.high for u in self.structure.free_parameters],
                np.full(self.n_starts, FIT.start_reach) * self.scale[self.k :],
            ]
        )
        return self.inner(low), self.inner(high)

    def _records(self, values: np.ndarray) -> Iterator[tuple[Record, Simulator, np.ndarray, slice]]:
        """Each record with its response, what it starts with, and the places of that in the `values`."""
        first = self.k
        for record, sizes in zip(self.records, self.sizes, strict=True):
            own = slice(first, first + len(sizes))
            first += len(sizes)
            yield record, self.simulators[record.sample_time, record.linear], values[own], own

    def _white(self, record: Record, y: np.ndarray) -> np.ndarray:
        left = np.where(record.valid, record.observed - y, 0.0)
        return self.fitter.noise.whiten(
            np.clip(np.nan_to_num(left, nan=FIT.reading_limit), -FIT.reading_limit, FIT.reading_limit), record.valid
        ).ravel()

    def _joined(self, rows: list[np.ndarray], scaled: np.ndarray) -> np.ndarray:
        """The records' rows and those of the prior."""
        values = self.outer(scaled)
        off = [(values[i] - u.nominal) / u.sd for i, u in self.prior]
        return _finite(np.concatenate([*rows, off, scaled[self.k :]]))

    def residual(self, scaled: np.ndarray) -> np.ndarray:
        """The residual alone: a fraction of the work that its slopes take."""
        values = self.outer(scaled)
        motions = self._records(values)
        rows = [self._white(record, one.simulate(record, values[: self.k], start)) for record, one, start, _ in motions]
        return self._joined(rows, scaled)

    def evaluate(self, scaled: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residual and slopes."""
        if self.at is not None and np.array_equal(self.at[0], scaled):
            return self.at[1:]
        values, k = self.outer(scaled), self.k
        by_inner = self.by_inner(values)
        rows, slopes = [], []
        for record, simulator, start, own in self._records(values):
            y, Y = simulator.sensitivities(record, values[:k], start)
            rows.append(self._white(record, y))
            J = np.zeros((len(rows[-1]), len(scaled)))
            W = self.fitter.noise.whiten(np.clip(np.nan_to_num(Y), -FIT.reading_limit, FIT.reading_limit), record.valid)
            W = W.reshape(len(J), Y.shape[2])
            J[:, :k], J[:, own] = -W[:, :k], -W[:, k:]
            slopes.append(J * by_inner)
        P = np.zeros((len(self.prior), len(scaled)))
        for row, (i, u) in enumerate(self.prior):
            P[row, i] = self.scale[i] / u.sd
        slopes += [P, np.eye(len(scaled))[k:]]
        J = np.nan_to_num(np.vstack(slopes), posinf=0.0, neginf=0.0)
        self.at = scaled.copy(), self._joined(rows, scaled), J
        return self.at[1:]

    def result(self, inner: np.ndarray) -> Fit:
        """The fit at an optimum."""
        rows, J = self.evaluate(inner)
        values = self.outer(inner)
        n_readings = sum(r.observed.size for r in self.records)
        starts = np.split(values[self.k :], np.cumsum([len(s) for s in self.sizes])[:-1])
        readings = rows[:n_readings]
        usable = sum(int(self.fitter.noise.usable(r.valid).sum()) for r in self.records)
        return Fit(
            self.structure, values[: self.k], tuple(starts), float(readings @ readings), usable, rows,
            J / self.by_inner(values),
            float(rows[n_readings:] @ rows[n_readings:]), tuple(r.observed.shape for r in self.records),
        )  # fmt: skip
