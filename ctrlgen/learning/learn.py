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

from ctrlgen.budget.contributors import Group
from ctrlgen.budget.robust import solve
from ctrlgen.budget.sensor_statement import SensorStatement, stated_sensor
from ctrlgen.budget.uncertainty import FILE, UncertaintyFile
from ctrlgen.core.errors import Fault, InputError, SolverError
from ctrlgen.core.files import read_toml, validate
from ctrlgen.core.one_or_several import several
from ctrlgen.core.tabular import Column, Reported, Tabular
from ctrlgen.core.to_digits import to_digits
from ctrlgen.learning.implied_pose import ImpliedPose
from ctrlgen.learning.learning_options import LearningOptions
from ctrlgen.learning.lifted import Lifted
from ctrlgen.learning.norm_optimal import Wanted, next_drives
from ctrlgen.learning.path_check import check_belongs
from ctrlgen.learning.repeatability import Spectrum
from ctrlgen.learning.response import Response
from ctrlgen.learning.run_errors import RunErrors, RunResult
from ctrlgen.learning.run_gate import belonging, granted
from ctrlgen.learning.runs import Runs, load_runs, merged
from ctrlgen.learning.sensor_budget import SensorBudget, sensor_budget
from ctrlgen.model.simulation import trace
from ctrlgen.recordings.recorded_files import recording_files, sha256
from ctrlgen.trajectory.inverse.violations import Before, violations
from ctrlgen.trajectory.scenario import Scenario, load_scenario, model_of
from ctrlgen.trajectory.solution import Solution, closest_margins

DEFAULT = LearningOptions()


@dataclass(frozen=True, eq=False, repr=False)
class Learning(Tabular, Reported):
    """The runs so far and the next one. `solution` is of the scenario as described. `base`, the run that is gone on from; `step`, the
    share of the full step that is taken; `stop`, why there is nothing more to learn, empty where there is: then `next` plays the drives of
    the base run. `repeating` (n, n_y) [SI] is what repeats beyond the model, `kept` (n, n_y) the factor of each of its coefficients over
    frequency. `predicted` rms of the next run by group. `sensor`: what it may feign; `left_to_sensor` (n, n_y) [SI]: what of the readings
    is taken for its error, and in no error that is told here."""

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
    sensor: SensorBudget
    left_to_sensor: np.ndarray
    inputs: dict[str, str]
    notes: tuple[str, ...]

    def of_group(self, deviation: np.ndarray, group: Group) -> float:
        """Root mean square length along the path [SI] of a deviation (n, n_y) in one group."""
        return float(np.sqrt(np.mean(np.sum(deviation[:, group.channels] ** 2, axis=1))))

    def facts(self) -> dict[str, object]:
        """What it is, in a few words."""
        return {
            "scenario": self.solution.scenario.file.title,
            "runs": len(self.runs),
            "next": self.stop or f"a step of {to_digits(100 * self.step, 3)} %",
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
    paths = several(recordings)
    progress("symbolic model")
    model = model_of(scenario)
    solution = solve(scenario, model, progress)
    lifted = Lifted(solution)
    stated, files = _stated(scenario, lifted)
    learning = learn_recorded(lifted, stated, paths, options, progress)
    read = {name: sha256(path) for name, path in (*recording_files(paths), *files)}
    return replace(learning, inputs={**scenario.digest, **read})


def learn_recorded(
    lifted: Lifted,
    stated: SensorStatement,
    paths: Sequence[Path | str],
    options: LearningOptions = DEFAULT,
    progress: Callable[[str], None] = lambda _: None,
) -> Learning:
    """The same as `learn` for a path that has been solved, with what is `stated` of its sensor; without the digests of files."""
    progress("recorded runs")
    implied = ImpliedPose(lifted)
    runs = load_runs(paths, lifted, implied)
    source = str(paths[0]) if len(paths) == 1 else "recordings"
    check_belongs(runs, lifted, source)
    runs = replace(runs, notes=(*runs.notes, *granted(runs, lifted, stated)))
    runs = merged(belonging(runs, lifted, source), lifted)
    sensor = sensor_budget(lifted, implied, stated, runs.observed, options)
    return learn_from(lifted, runs, source, {}, options, progress, sensor)


def _stated(scenario: Scenario, lifted: Lifted) -> tuple[SensorStatement, list[tuple[str, Path]]]:
    """What uncertainty.toml beside the scenario states of the sensor, and the file where it does. Raises InputError."""
    path = scenario.path.parent / FILE
    section = validate(UncertaintyFile, read_toml(path), path).sensor if path.is_file() else None
    return stated_sensor(section, lifted.signal, path), [] if section is None else [(FILE, path)]


def learn_from(
    lifted: Lifted,
    runs: Runs,
    source: str,
    inputs: dict[str, str],
    options: LearningOptions = DEFAULT,
    progress: Callable[[str], None] = lambda _: None,
    sensor: SensorBudget | None = None,
) -> Learning:
    """The same as `learn`, from runs that have been read and belong together; without a budget of the `sensor` readings are believed."""
    job = RunErrors(lifted, runs, options)
    progress("answer of the device")
    answer = job.response(len(job.runs))
    if answer is not None and answer.reasons:
        raise InputError(source, [Fault(where, what) for where, what in answer.reasons.items()])
    sensor = sensor or SensorBudget((), options.sensor_coverage, job.scale)
    left_to_sensor = job.leave_to(sensor)
    results = tuple(job.result(j) for j in range(len(job.runs)))
    base = job.base
    step = 0.5 ** sum(job.is_worse(j, base) for j in range(base + 1, len(results)))
    progress("next drives")
    c, se = job.repeating(base)
    kept = job.spectrum.shrinkage(c, se, job.repeated[base].freedom)
    repeating = job.spectrum.samples(kept * c) * job.scale
    stop = job.nothing_left(base, left_to_sensor) or (
        job.stalled(base) if len(results) - 1 - base >= options.most_stalls else ""
    )
    now, u = results[base].drive, results[base].drive
    if not stop:
        u = _step(lifted, Wanted(lifted.solution.command - repeating, job.weights, now), step, job.most(now), options)
        stop = job.not_worth(base, u)
        u = now if stop else u
    predicted, error = job.predicted(base, u, job.mismatch(len(results)))
    notes = list(runs.notes) + job.notes() + job.repetitions(base)
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
        sensor=sensor,
        left_to_sensor=left_to_sensor,
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
