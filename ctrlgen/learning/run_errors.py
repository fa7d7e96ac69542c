"""Errors of all runs over frequency, what of them is the sensor's, and what follows: base, prediction, when there is nothing left."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ctrlgen.budget.contributors import groups_of
from ctrlgen.core.to_digits import to_digits
from ctrlgen.learning.hidden_parts import along, orthonormal, told, without
from ctrlgen.learning.learning_options import LearningOptions
from ctrlgen.learning.lifted import Lifted
from ctrlgen.learning.repeatability import LAMBDA, Repeated, Spectrum
from ctrlgen.learning.response import Change, Response, response
from ctrlgen.learning.runs import Runs, errors
from ctrlgen.learning.sensor_budget import SensorBudget


@dataclass(frozen=True, eq=False)
class RunResult:
    """One run: mean error (n, n_y) [SI] over its repetitions and, by group, its root mean square length `rms`, that of its standard
    error `noise`, what of it is `repeating`, rms^2 = repeating^2 + noise^2, with its `least` and `most` at 95 %, and the repeating error
    that was `predicted` from the runs before; None for the first run. `cost` is the weighted sum of its squares, without the noise in it,
    `cost_se` its standard error."""

    name: str
    repeats: int
    drive: np.ndarray
    error: np.ndarray
    rms: dict[str, float]
    noise: dict[str, float]
    repeating: dict[str, float]
    least: dict[str, float]
    most: dict[str, float]
    predicted: dict[str, float] | None
    cost: float
    cost_se: float


class RunErrors:
    """Errors of all runs over frequency, and what follows from them; scaled by the typical size of each channel."""

    def __init__(self, lifted: Lifted, runs: Runs, options: LearningOptions) -> None:
        self.options = options
        self.lifted, self.runs, self.observed = lifted, runs.runs, runs.observed
        self.scale = np.array(lifted.signal.scale)
        self.weights = 1 / self.scale
        self.groups = groups_of(lifted.signal)
        self.spectrum = Spectrum(lifted.n, lifted.closed)
        self.y = [lifted.run(run.drive) for run in self.runs]
        self.repeated = list[Repeated]()
        for run in self.runs:
            e, share = errors(run, lifted)
            self.repeated.append(self.spectrum.repeated(e / self.scale, runs.noise / self.scale, share))
        self.hidden = [orthonormal(run.hidden, self.spectrum) for run in self.runs]
        models = [self.spectrum.coefficients(y / self.scale) for y in self.y]
        self.repeated = told(self.repeated, models, self.hidden)

    @property
    def base(self) -> int:
        """The run with the least error, without the noise in it."""
        best = 0
        for j in range(1, len(self.runs)):
            now, then = self._compared(best, j)
            best = j if then[0] < now[0] else best
        return best

    def is_worse(self, j: int, base: int) -> bool:
        """Whether run j is worse than run `base` beyond the noise of both."""
        now, then = self._compared(base, j)
        return then[0] - now[0] > self.options.worse * np.sqrt(now[1] + then[1])

    def _compared(self, *pair: int) -> list[tuple[float, float]]:
        """Sum of squares of the errors of two runs and its variance, without what one of them hides."""
        Q = self._hidden_by(*pair)
        return [without(self.repeated[j], Q).energy(np.ones(len(self.scale))) for j in pair]

    def _hidden_by(self, *pair: int) -> np.ndarray:
        """(k, n, n_y) an orthonormal basis, of coefficients, of what one of two runs hides."""
        return orthonormal([part for j in pair for part in self.runs[j].hidden], self.spectrum)

    def leave_to(self, sensor: SensorBudget) -> np.ndarray:
        """(n, n_y) [SI] what of the error that the base run read is the sensor's; taken out of every run.

        Of the base run and not of the described drives: what was learnt so far has left an error that the sensor may feign alone."""
        base = self.base
        c, se = self.repeating(base)
        kept = self.spectrum.shrinkage(c, se, self.repeated[base].freedom)
        moved = self.y[base] - self.lifted.solution.command
        left = sensor.of_sensor(self.spectrum.samples(kept * c) * self.scale + moved * self.observed)
        off = self.spectrum.coefficients(left / self.scale)
        read = c + self.spectrum.coefficients(moved * self.observed / self.scale)
        off = off + along(self.hidden[base], read - off)  # no step in what this run does not tell
        self.repeated = [replace(r, mean=r.mean - off) for r in self.repeated]
        return left

    def notes(self) -> list[str]:
        """What a reader should know of the noise."""
        alone = [run.name for run, r in zip(self.runs, self.repeated, strict=True) if r.repeats == 1]
        if not alone:
            return []
        return [
            f"{', '.join(alone)}: one repetition alone cannot tell what repeats; its noise is taken from the recording's stated noise, or "
            "from its highest frequencies. Record several periods or runs with the same drives."
        ]

    def repetitions(self, j: int) -> list[str]:
        """How many repetitions tell what repeats of run j from its noise, where most of it is not told yet."""
        r, ones = self.repeated[j], np.ones(len(self.scale))
        total, variance = r.energy(ones)
        passed = float(np.sum(self._left(j)[0] ** 2))
        hidden, unsure = total - passed, self.options.coverage_factor * float(np.sqrt(variance))
        known = hidden > unsure
        error = hidden if known else max(total, 0.0) + unsure
        if r.repeats == 1 or passed > error or np.sum(r.se**2) < error:
            return []
        slow = np.sum(r.se[self.spectrum.share <= self.options.slow] ** 2)
        times, ratio = LAMBDA * slow / error, np.sqrt(np.sum(r.se**2) / error)
        if times <= 1:
            return []
        size = "what repeats" if known else "the most that may repeat"
        return [
            f"{self.runs[j].name}: the noise of its mean is {to_digits(ratio, 2)} times {size}; "
            f"about {int(np.ceil(r.repeats * times))} repetitions tell it ({r.repeats} so far)."
        ]

    def result(self, j: int) -> RunResult:
        """One run with its error beside the predicted one."""
        run, r = self.runs[j], self.repeated[j]
        predicted = None if j == 0 else self.predicted(j - 1, run.drive, self.mismatch(j))[0]
        cost, variance = r.energy(np.ones(len(self.scale)))
        bounds = {how: self._bounded(r, sign) for how, sign in (("repeating", 0), ("least", -1), ("most", 1))}
        return RunResult(
            name=run.name,
            repeats=r.repeats,
            drive=run.drive,
            error=self.spectrum.samples(r.mean) * self.scale,
            rms=self._rms(r.mean**2),
            noise=self._rms(r.se**2),
            predicted=predicted,
            cost=cost,
            cost_se=float(np.sqrt(variance)),
            **bounds,
        )

    def _bounded(self, r: Repeated, sign: int) -> dict[str, float]:
        """Root mean square length [SI] by group of what repeats: the estimate, or an end of its 95 % interval."""
        bounds = {}
        for g in self.groups:
            si = np.where(np.isin(np.arange(len(self.scale)), g.channels), self.scale**2, 0.0)
            total, variance = r.energy(si)
            total += sign * self.options.coverage_factor * float(np.sqrt(variance))
            bounds[g.name] = float(np.sqrt(max(total, 0.0) / self.lifted.n))
        return bounds

    def _rms(self, squares: np.ndarray) -> dict[str, float]:
        """Root mean square length [SI] by group, from squares of scaled coefficients (n, n_y)."""
        si = squares * self.scale**2
        return {g.name: float(np.sqrt(np.sum(si[:, g.channels]) / self.lifted.n)) for g in self.groups}

    def _left(self, j: int) -> tuple[np.ndarray, np.ndarray]:
        """The error of run j as far as it stands out of the noise, coefficients (n, n_y), and its variance."""
        r = self.repeated[j]
        factor = self.spectrum.shrinkage(r.mean, r.se, r.freedom)
        return factor * r.mean, factor * r.se**2

    def predicted(self, j: int, u: np.ndarray, mismatch: float) -> tuple[dict[str, float], np.ndarray]:
        """The repeating rms error by group of a run under `u`, from run j; and the error itself (n, n_y) [SI]."""
        left, variance = self._left(j)
        moved = self.spectrum.coefficients((self.lifted.run(u) - self.y[j]) / self.scale) * self.observed
        squares = (left + moved) ** 2 + variance + (mismatch * moved) ** 2
        return self._rms(squares), self.spectrum.samples(left + moved) * self.scale

    def mismatch(self, count: int) -> float:
        """The share of a change by which the device answers otherwise, as far as the first `count` runs show it."""
        answer, options = self.response(count), self.options
        if answer is None:
            return options.mismatch
        return float(np.clip(np.sqrt(answer.unexplained), options.least_mismatch, 1.0))

    def response(self, count: int) -> Response | None:
        """What the changes among the first `count` runs say."""
        n, changes = self.lifted.n, list[Change]()
        for j in range(1, count):
            Q = self._hidden_by(j - 1, j)
            a, b = (without(self.repeated[i], Q) for i in (j - 1, j))
            sd = np.sqrt(np.sum(a.se**2 + b.se**2, axis=0) / n) * self.scale
            y = self.spectrum.samples(b.mean - a.mean) * self.scale
            hidden = np.array([self.spectrum.samples(q) for q in Q]).reshape(-1, n, len(self.scale))
            changes.append(Change(self.runs[j - 1].drive, self.runs[j].drive, y, sd, self.observed, hidden))
        return response(self.lifted, changes)

    def repeating(self, base: int) -> tuple[np.ndarray, np.ndarray]:
        """What repeats beyond the model under the drives of run `base`: coefficients (n, n_y) and their standard error, from all runs."""
        mismatch = self.mismatch(len(self.runs))
        total, weight = np.zeros(self.repeated[0].mean.shape), np.zeros(self.repeated[0].mean.shape)
        for r, y in zip(self.repeated, self.y, strict=True):
            c = r.mean + self.spectrum.coefficients((self.lifted.solution.command - y) / self.scale)
            apart = self.spectrum.coefficients((y - self.y[base]) / self.scale)
            w = 1 / (r.se**2 + mismatch**2 * self.spectrum.pooled(apart**2) + np.finfo(float).tiny ** 0.5)
            total, weight = total + w * c, weight + w
        return total / weight * self.observed, 1 / np.sqrt(weight)

    def most(self, now: np.ndarray) -> np.ndarray:
        """(n_u,) how far a drive may move: the first time, when it is not known what the device answers, a little."""
        largest, first_step = np.abs(now).max(axis=0), self.options.first_step
        return (first_step if len(self.runs) == 1 else 1.0) * np.maximum(largest, first_step * largest.max())

    def nothing_left(self, base: int, left_to_sensor: np.ndarray) -> str:
        """Why nothing is left to learn; empty where there is. `left_to_sensor` (n, n_y) [SI] was taken out of every run."""
        if self._left(base)[0][:, self.observed].any():
            return ""
        r = self.repeated[base]
        read = r.mean + self.spectrum.coefficients(left_to_sensor / self.scale)
        if self.spectrum.shrinkage(read, r.se, r.freedom)[:, self.observed].any():
            return "what is left of the error may be the sensor's"
        return "what is left of the error is not distinguishable from noise"

    def stalled(self, base: int) -> str:
        """Why no further step is tried."""
        most = self.options.most_stalls
        return f"{most} runs in a row were not better than {self.runs[base].name}, although the step was lowered"

    def not_worth(self, base: int, u: np.ndarray) -> str:
        """Why a run under `u` is not worth running; empty where it is."""
        then, _ = self.predicted(base, u, self.mismatch(len(self.runs)))
        left, variance = self._left(base)
        now = self._rms(left**2 + variance)
        worth = self.options.first_worth if len(self.runs) == 1 else self.options.worth
        if any(then[g] < worth * now[g] for g in now if now[g]):
            return ""
        return "no more improvement is predicted: the limits leave none, or the device answers too differently from its description"
