"""What is another in each record: zeros of sensors that are set anew or drift between runs, drifts, a jump in one of the runs.

Each takes a part of whatever is missing in a record. It is tried where that part is most of what is left of a reading, beyond one mean
of all records.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.diagnosis.settings import SEARCH
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.record_states import StatesProblem, place_of_told
from ctrlgen.estimation.settings import STATISTICS
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Record, Recording


class Left(NamedTuple):
    """What is left of a reading in one run: the `time` (n,) [s] and the residual `e` (n,) [SI] where it was read, and when the last part of
    its file begins [s]."""

    time: np.ndarray
    e: np.ndarray
    last_part: float

    @property
    def off_mean(self) -> np.ndarray:
        """The residual about its mean (n,) [SI]."""
        return self.e - self.e.mean()


class Part(NamedTuple):
    """The `share` of the squares of what is left that a law takes away, and where it acts [SI]: its numbers by name."""

    share: float
    numbers: Mapping[str, float]


NONE = Part(0.0, {})


def may_differ(cause: Hypothesis, recording: Recording) -> bool:
    """Whether the records of a recording may tell a cause that is another in each: of readings in time in two runs or more, as the parts
    of one file have one zero and one drift; a jump may be in one part of a file."""
    moved = [r for r in recording.records if r.role != "rest"]
    several = len(moved) if cause.prior.moments else len({_file(r) for r in moved})
    return recording.kind == "series" and several > 1


def _file(record: Record) -> str:
    return record.file or record.name


def fit_of_each_record(trials: Trials, current: CandidateModel) -> tuple[CandidateModel, ...]:
    """Each law that is another in each record, at every reading of which it takes away most of what is left, and at all of these at once,
    beside `current`, or in the place of what it has there."""
    open_ = [h for h in trials.screen.hypotheses if h.prior.of_each_record and h.beside(_kept(h, current)) is not None]
    if not open_:
        return ()
    left = left_in_runs(trials.fitter, current.fit)
    sets: list[list[tuple[Hypothesis, Part]]] = []
    for effect in dict.fromkeys(h.effect for h in open_):
        part_of = PARTS.get(effect, of_means)
        parts = [(h, part_of(left.get(f"reading.{h.at}", []))) for h in open_ if h.effect == effect]
        apart = [(h, part) for h, part in parts if part.share >= SEARCH.least_of_each_record]
        sets += [[one] for one in apart] + ([apart] if len(apart) > 1 else [])
    fitted = trials.each(lambda branch, causes: branch.tried(_with(current.fit, causes), causes[-1][0]), sets)
    return tuple(t for found in fitted for t in found)


def left_in_runs(fitter: Fitter, fit: Fit) -> dict[str, list[Left]]:
    """By channel what a fit leaves in each run, of the records to fit and those held out. The parts of one file are one run."""
    runs = [r for r in fitter.recording.records if r.role != "rest"]
    left = [r.observed - fitter.predict(fit, r) for r in runs]
    found: dict[str, list[Left]] = {}
    for i, channel in enumerate(fitter.recording.channels):
        of_run: dict[str, list[Left]] = {}
        for e, r in zip(left, runs, strict=True):
            read = r.valid[:, i] & np.isfinite(e[:, i])
            of_run.setdefault(_file(r), []).append(Left(r.time[read], e[read, i], float(r.time[0])))
        found[channel] = [run for run in map(_joined, of_run.values()) if len(run.e)]
    return found


def _joined(parts: Sequence[Left]) -> Left:
    """The parts of one file as one run."""
    time, e = (np.concatenate([getattr(part, name) for part in parts]) for name in ("time", "e"))
    return Left(time, e, max(part.last_part for part in parts))


def of_means(runs: Sequence[Left]) -> Part:
    """What a mean of each run takes away of the squares about their mean: sum_r n_r (m_r - m)^2 / sum (e - m)^2."""
    if len(runs) < 2:
        return NONE
    every = np.concatenate([run.e for run in runs])
    whole = float(np.sum((every - every.mean()) ** 2))
    between = sum(len(run.e) * float(run.e.mean() - every.mean()) ** 2 for run in runs)
    return Part(between / whole if whole > 0 else 0.0, {})


def of_lines(runs: Sequence[Left]) -> Part:
    """What a line through each run takes away of the squares about its mean."""
    whole = sum(float(run.off_mean @ run.off_mean) for run in runs)
    taken = 0.0
    for run in runs:
        since = run.time - run.time.mean()
        taken += float(since @ run.e) ** 2 / max(float(since @ since), 1e-300)
    return Part(taken / whole if whole > 0 else 0.0, {})


def of_one_step(runs: Sequence[Left]) -> Part:
    """What a jump at one moment of one run takes away of the squares about the mean of each, and that moment; none where what is left comes
    there slowly, or goes on in a further part of the file, which tells the jump as well."""
    whole = sum(float(run.off_mean @ run.off_mean) for run in runs)
    best = NONE
    for run in runs:
        n = len(run.e)
        near = max(SEARCH.fewest_beside_jump, round(SEARCH.beside_jump * n))
        if n <= 2 * near:
            continue
        before = np.arange(1, n)
        taken = np.cumsum(run.off_mean)[:-1] ** 2 * n / (before * (n - before))
        k = int(np.argmax(taken)) + 1
        jump = run.e[k:].mean() - run.e[:k].mean()
        close = run.e[k : k + near].mean() - run.e[max(k - near, 0) : k].mean()
        share = float(taken[k - 1]) / whole if whole > 0 else 0.0
        if share > best.share and close / jump >= SEARCH.sharp_jump and run.time[k] > run.last_part:
            best = Part(
                share, {"moment": float(run.time[k - 1 : k + 1].mean()), "rise": float(run.time[k] - run.time[k - 1])}
            )
    return best


PARTS: Mapping[str, Callable[[Sequence[Left]], Part]] = {
    "drift_per_record": of_lines,
    "sensor_step_per_record": of_one_step,
}
"""By law what it takes away where no mean does it."""


def told_in_records(fitter: Fitter, fit: Fit, cause: Hypothesis) -> dict[str, tuple[float, float]]:
    """The `told_state` of a cause in each record that moves and shows it, by the record's name, and how far its 95 % interval reaches to
    either side [SI] under the errors of the fit. Of records with one name also the time at which each begins."""
    found = {}
    runs = [r for r in fitter.recording.records if r.role != "rest"]
    often = Counter(r.name for r in runs)
    for record in runs:
        simulator = fitter.simulator(fit.structure, record)
        place = place_of_told(simulator, cause)
        states = fitter.begun(fit, record)[0]
        problem = StatesProblem(simulator, fitter.error, fit.theta, record, np.zeros(len(states)))
        J = problem.evaluate(states / problem.sd)[1]
        if not J[: -problem.k, place].any():  # it ends before the moment at which the law acts
            continue
        reach = float(problem.sd[place] * np.sqrt(np.linalg.pinv(J.T @ J)[place, place]))
        begun = f" from {record.time[0]:g} s" if often[record.name] > 1 else ""
        found[record.name + begun] = float(states[place]), STATISTICS.z_95 * reach
    return found


def _kept(cause: Hypothesis, current: CandidateModel) -> list[Hypothesis]:
    """The causes of a model that stay beside this one: not those in whose place it comes."""
    return [other for other in current.causes if not _in_place(cause, other)]


def _in_place(cause: Hypothesis, other: Hypothesis) -> bool:
    """Whether a cause comes in the place of another one of the same reading: of another form of its physics; one with a zero of its own, in
    that of a constant."""
    if other.location != cause.location:
        return False
    another_form = cause.form_of is not None and other.form_of == cause.form_of and other != cause
    return another_form or (other.prior.constant and any(state.name == "zero" for state in cause.law.states))


def _with(fit: Fit, causes: Sequence[tuple[Hypothesis, Part]]) -> Structure:
    """The structure with the causes, begun where their parts act, without those in whose place they come."""
    structure = fit.restarted
    for cause, part in causes:
        for k in reversed(range(len(structure.causes))):
            if _in_place(cause, structure.causes[k]):
                structure = structure.without(k)
        channel = cause.channel_on(structure.device)
        start = {cause.law.amplitude().name: 1.0}
        for p in cause.law.params:
            if p.name in part.numbers:
                start[p.name] = float(np.clip(part.numbers[p.name], *cause.bounds(p, channel)))
        structure = structure.with_cause(cause, start)
    return structure
