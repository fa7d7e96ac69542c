"""From the runs so far to the next drives: iterative learning with the device's own sensitivities, stateless from call to call.

What a run shows beyond the model, d_j = y_j - y(u_j), is what physics as described does not explain but repeats. The next drives are
those with which the model plus d follow the command, as near as the limits allow (`ctrlgen.learning.norm_optimal`); d is taken from all
runs, each weighted by its noise and by how far its drives are from the best ones, and only where it stands out of the noise.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ctrlgen.budget.contributors import Group, groups_of
from ctrlgen.budget.robust import solve
from ctrlgen.core.errors import Fault, InputError, SolverError
from ctrlgen.core.tabular import Column, Reported, Tabular
from ctrlgen.learning.learning_options import LearningOptions
from ctrlgen.learning.lifted import Lifted
from ctrlgen.learning.norm_optimal import Wanted, next_drives
from ctrlgen.learning.repeatability import Repeated, Spectrum
from ctrlgen.learning.response import Change, Response, response
from ctrlgen.learning.runs import Runs, check_belongs, errors, load_runs
from ctrlgen.model.simulation import trace
from ctrlgen.recordings.recorded_files import recording_files, sha256
from ctrlgen.trajectory.inverse.violations import Before, violations
from ctrlgen.trajectory.scenario import Scenario, load_scenario, model_of
from ctrlgen.trajectory.solution import Solution, closest_margins

DEFAULT = LearningOptions()


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


@dataclass(frozen=True, eq=False, repr=False)
class Learning(Tabular, Reported):
    """The runs so far and the next one. `solution` is of the scenario as described. `base`, the run that is gone on from; `step`, the
    share of the full step that is taken; `stop`, why there is nothing more to learn, empty where there is: then `next` plays the drives of
    the base run. `repeating` (n, n_y) [SI] is what repeats beyond the model, `kept` (n, n_y) the factor of each of its coefficients over
    frequency. `predicted` rms of the next run by group."""

    solution: Solution
    groups: tuple[Group, ...]
    runs: tuple[RunResult, ...]
    observed: tuple[bool, ...]
    base: int
    step: float
    stop: str
    response: Response | None
    repeating: np.ndarray
    kept: np.ndarray
    spectrum: Spectrum
    next: Solution
    predicted: dict[str, float]
    predicted_error: np.ndarray
    inputs: dict[str, str]
    notes: tuple[str, ...]

    def facts(self) -> dict[str, object]:
        """What it is, in a few words."""
        return {
            "scenario": self.solution.scenario.file.title,
            "runs": len(self.runs),
            "next": self.stop or f"a step of {100 * self.step:.3g} %",
        }

    def columns(self) -> tuple[Column, ...]:
        """A row a run: its error along the path, that of noise, and what of it repeats, root mean square by group."""
        by_group = (
            Column(f"{what} {g.name}", g.unit, [g.shown(getattr(run, what)[g.name]) for run in self.runs])
            for g in self.groups
            for what in ("rms", "noise", "repeating")
        )
        return (Column("run", "", [run.name for run in self.runs]), *by_group)


def learn(
    scenario: Scenario | Path | str,
    recordings: Path | str | Sequence[Path | str],
    *,
    options: LearningOptions = DEFAULT,
    progress: Callable[[str], None] = lambda _: None,
) -> Learning:
    """The next drives of a scenario from recorded runs of it, all of them so far in their order; `options`: how far a step goes, and when
    there is nothing more to learn.

    Raises InputError for recordings that are not of this path, and where the device answers changes of its drives otherwise than described;
    Unreachable, SolverError. Sources: S. Gunnarsson, M. Norrloef, Automatica 37 (2001) 2011; J. van Zundert, T. Oomen,
    Mechatronics 54 (2018) 62; T. T. Cai, Ann. Statist. 27 (1999) 898.
    """
    scenario = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
    paths = [recordings] if isinstance(recordings, Path | str) else list(recordings)
    progress("symbolic model")
    model = model_of(scenario)
    solution = solve(scenario, model, progress)
    lifted = Lifted(solution)
    progress("recorded runs")
    runs = load_runs(paths, lifted)
    source = str(paths[0]) if len(paths) == 1 else "recordings"
    check_belongs(runs, lifted, source)
    read = {name: sha256(path) for name, path in recording_files(paths)}
    return learn_from(lifted, runs, source, {**scenario.digest, **read}, options, progress)


def learn_from(
    lifted: Lifted,
    runs: Runs,
    source: str,
    inputs: dict[str, str],
    options: LearningOptions = DEFAULT,
    progress: Callable[[str], None] = lambda _: None,
) -> Learning:
    """The same as `learn`, from runs that have been read."""
    job = _Job(lifted, runs, options)
    progress("answer of the device")
    answer = job.response(len(job.runs))
    if answer is not None and answer.reasons:
        raise InputError(source, [Fault(where, what) for where, what in answer.reasons.items()])
    results = tuple(job.result(j) for j in range(len(job.runs)))
    base = int(np.argmin([r.cost for r in results]))
    worse = [
        r
        for r in results[base + 1 :]
        if r.cost - results[base].cost > options.worse * np.hypot(r.cost_se, results[base].cost_se)
    ]
    step = 0.5 ** len(worse)
    progress("next drives")
    c, se = job.repeating(base)
    kept = job.spectrum.shrinkage(c, se, job.repeated[base].freedom)
    repeating = job.spectrum.samples(kept * c) * job.scale
    stop = job.nothing_left(base) or (job.stalled(base) if len(results) - 1 - base >= options.most_stalls else "")
    now, u = results[base].drive, results[base].drive
    if not stop:
        u = _step(lifted, Wanted(lifted.solution.command - repeating, job.weights, now), step, job.most(now), options)
        stop = job.not_worth(base, u)
        u = now if stop else u
    predicted, error = job.predicted(base, u, job.mismatch(len(results)))
    notes = list(runs.notes) + job.notes()
    return Learning(
        solution=lifted.solution,
        groups=job.groups,
        runs=results,
        observed=tuple(map(bool, runs.observed)),
        base=base,
        step=step,
        stop=stop,
        response=answer,
        repeating=repeating,
        kept=kept,
        spectrum=job.spectrum,
        next=as_solution(lifted, u),
        predicted=predicted,
        predicted_error=error,
        inputs=inputs,
        notes=tuple(notes),
    )


def _step(lifted: Lifted, wanted: Wanted, share: float, most: np.ndarray, options: LearningOptions) -> np.ndarray:
    """`share` of the way to the next drives, less where a drive would move by more than `most` (n_u,), or a limit would be broken that the
    drives of now keep. Raises SolverError."""
    full = next_drives(lifted, wanted)
    share = min(share, float(np.min(most / np.maximum(np.abs(full - wanted.now).max(axis=0), 1e-300))))
    broken_now = {v.limit.name for v in _broken(lifted, wanted.now)}
    for _ in range(options.most_halvings):
        u = wanted.now + share * (full - wanted.now)
        if {v.limit.name for v in _broken(lifted, u)} <= broken_now:
            return u
        share /= 2
    raise SolverError("the limits leave no room for a next run; look at the margins of the drives so far")


def _broken(lifted: Lifted, u: np.ndarray) -> list[Any]:
    S, m = lifted.states(u), lifted.model
    x, z = np.split(S, [m.x.numel()], axis=1)
    before = None if lifted.static else Before(lifted.held(u), lifted.sample_time)
    return violations(m, x, z, u, before=before)


def as_solution(lifted: Lifted, u: np.ndarray) -> Solution:
    """The drives (n, n_u) as a solution whose command is what the model does under them, for the player and the margins."""
    m, solution, v = lifted.model, lifted.solution, lifted.held(u)
    x, z = np.split(lifted.states(u), [m.x.numel()], axis=1)
    along = trace(m, solution.trace.time, x, z, u)
    if not lifted.static:
        reached = trace(m, solution.trace.time, x, z, v)
        along.signals.update({role: reached.signals[role] for role in ("displacement", "pose", "reading")})
    before = None if lifted.static else Before(v, lifted.sample_time)
    margins = tuple(closest_margins(m, x, z, u, before))
    command = along.signals[solution.scenario.file.follow]
    return replace(solution, command=command, trace=along, drive=u, margins=margins, between_samples=None)


class _Job:
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

    def notes(self) -> list[str]:
        """What a reader should know of the noise."""
        alone = [run.name for run, r in zip(self.runs, self.repeated, strict=True) if r.repeats == 1]
        if not alone:
            return []
        return [
            f"{', '.join(alone)}: one repetition alone cannot tell what repeats; its noise is taken from the recording's stated noise, or "
            "from its highest frequencies. Record several periods or runs with the same drives."
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
            a, b = self.repeated[j - 1], self.repeated[j]
            sd = np.sqrt(np.sum(a.se**2 + b.se**2, axis=0) / n) * self.scale
            y = self.spectrum.samples(b.mean - a.mean) * self.scale
            changes.append(Change(self.runs[j - 1].drive, self.runs[j].drive, y, sd, self.observed))
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

    def nothing_left(self, base: int) -> str:
        """Why nothing is left to learn; empty where there is."""
        left, _ = self._left(base)
        return "" if left[:, self.observed].any() else "what is left of the error is not distinguishable from noise"

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
