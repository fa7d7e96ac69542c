"""Experiment design: the drive that best discriminates between models that this recording cannot tell apart.

T-optimality with refitted rivals, linearised. With Delta (N,) the difference of two rivals' whitened readings and
J (N, k) the sensitivities of the rival that is refitted to the other's prediction,

    separation^2 = min over delta of |Delta - J delta|^2

over this recording and the new one together; of the two directions the smaller, in standard deviations.

Source: A. C. Atkinson, V. V. Fedorov, Biometrika 62 (1975) 57.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from pydantic import Field

from ctrlgen.diagnosis.evidence.excitation_signals import admissible, pose_sets, time_series
from ctrlgen.diagnosis.selection.candidate_model import SearchResult
from ctrlgen.diagnosis.settings import EXPERIMENT
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.least_squares import initial_state_sd
from ctrlgen.recordings.recording import Record
from ctrlgen.reporting.result_file import FiniteOrNull, Keys


class CandidateExperimentEntry(Keys):
    """One drive that was considered."""

    kind: str = Field(description="Form of the drive.")
    description: str = Field(description="The drive in words.")
    strength: float = Field(description="Amplitude as a share of the drive's range.")
    separation: float = Field(description="Separation of the rivals with it [standard deviations].")


class NextExperimentEntry(Keys):
    """The drive that discriminates best between models that this recording cannot tell apart."""

    discriminates_between: tuple[str, str] = Field(description="The two models, by their causes.")
    reason: str = Field(description="Why these two.")
    description: str = Field(description="The drive in words.")
    kind: str = Field(description="Form of the drive.")
    strength: float = Field(description="Amplitude as a share of the drive's range.")
    samples: int = Field(description="Length of the drive.")
    sample_time: FiniteOrNull = Field(description="[s]; null for settled poses.")
    separation_now: FiniteOrNull = Field(description="Separation by this recording [standard deviations].")
    separation_after: FiniteOrNull = Field(description="Separation by both recordings [standard deviations].")
    settles: bool = Field(description="Whether separation_after decides between them.")
    candidates: list[CandidateExperimentEntry] = Field(description="All drives considered, the best first.")


@dataclass(frozen=True, eq=False)
class Experiment:
    """The best drive to discriminate between two rivals.

    rivals: the two models by their causes. reason: why these two.
    before, after: separation [standard deviations] by this recording, and with the new one.
    candidates: all drives considered, the best first. proposed: the best drive as a record without readings.
    files: the content of each file of the folder next_experiment/.
    """

    rivals: tuple[str, str]
    reason: str
    before: float
    after: float
    candidates: tuple[CandidateExperimentEntry, ...]
    proposed: Record
    files: dict[str, str] = field(default_factory=dict)

    @property
    def settles(self) -> bool:
        """Whether the separation with the new recording decides between them."""
        return self.after >= EXPERIMENT.settles

    def record(self) -> NextExperimentEntry:
        """The entry of the experiment in diagnosis.json."""
        best = self.candidates[0]
        return NextExperimentEntry(
            discriminates_between=self.rivals,
            reason=self.reason,
            description=best.description,
            kind=best.kind,
            strength=best.strength,
            samples=len(self.proposed.drive),
            sample_time=self.proposed.sample_time,
            separation_now=self.before,
            separation_after=self.after,
            settles=self.settles,
            candidates=list(self.candidates),
        )


def next_experiment(search: SearchResult, explained: bool, seed: int = 0) -> Experiment | None:
    """The drive that best discriminates between the chosen model and its rivals or, where the recording stays unexplained,
    between the two models that came closest; None where there is no such pair, or no admissible drive."""
    fitter, (pairs, reason) = search.fitter, _open(search, explained)
    if not pairs:
        return None
    return max(
        (experiment for a, b in pairs if (experiment := separate(fitter, a, b, reason, seed)) is not None),
        key=lambda e: -e.before,
        default=None,
    )


def _open(search: SearchResult, explained: bool) -> tuple[list[tuple[Fit, Fit]], str]:
    """Pairs of fits between which the recording does not decide, and why these."""
    rivals = [t for rows in search.rivals for t in rows]
    chosen = search.chosen.fit
    if rivals:
        return [(chosen, t.fit) for t in rivals[: EXPERIMENT.most_rivals]], "both explain this recording equally well"
    if explained or not search.rounds or search.rounds[-1].before.fit is not chosen:
        return [], ""
    tried: dict[str, Fit] = {}
    # the last round accepted none of its candidates
    for trial in search.rounds[-1].candidates:
        tried.setdefault(trial.cause.effect if trial.cause else "", trial.fit)
    closest = [*list(tried.values())[: EXPERIMENT.suspects], chosen][: EXPERIMENT.suspects]
    pairs = [(closest[0], closest[1])] if len(closest) == EXPERIMENT.suspects else []
    return pairs, "neither explains this recording; they come closest"


def separate(fitter: Fitter, a: Fit, b: Fit, reason: str, seed: int = 0) -> Experiment | None:
    """The excitation signal that best separates two fits; None where none is admissible. `seed` draws the signals."""
    template = max(fitter.fit_records, key=lambda r: len(r.time))
    poses = template.poses
    n, n_u = (
        min(len(template.time), EXPERIMENT.most_poses if poses else EXPERIMENT.most_samples),
        template.drive.shape[1],
    )
    family = pose_sets(n, n_u, seed) if poses else time_series(n, n_u, 1 / template.sample_time, seed)
    first = 0.0 if poses else max(r.time[-1] for r in fitter.recording.records) + template.sample_time
    simulator = fitter.simulator(a.structure, template)
    now = [_Sums.present(fitter, *pair) for pair in ((a, b), (b, a))]
    rows = []
    for shape in family:
        given = admissible(shape, simulator, a.theta, template, first)
        if given is None:
            continue
        record, strength = given
        both = [s.plus(fitter, *pair, record).separation for s, pair in zip(now, ((a, b), (b, a)), strict=True)]
        if np.all(np.isfinite(both)):
            entry = CandidateExperimentEntry(
                kind=shape.kind, description=shape.description, strength=strength, separation=min(both)
            )
            rows.append((entry, record))
    if not rows:
        return None
    rows.sort(key=lambda row: -row[0].separation)
    best, record = rows[0]
    before = min(s.separation for s in now)
    return Experiment((_named(a, b), _named(b, a)), reason, before, best.separation, tuple(r[0] for r in rows), record)


def _named(fit: Fit, other: Fit) -> str:
    """The causes that `other` does not have."""
    causes = [c for c in fit.structure.causes if c not in other.structure.causes]
    return " and ".join(f"{c.effect} at {c.location}" for c in causes) or "the device without it"


@dataclass(frozen=True, eq=False)
class _Sums:
    """N = J'J, g = J'Delta, s = |Delta|^2 over some records, initial states projected out."""

    N: np.ndarray
    g: np.ndarray
    s: float

    @property
    def separation(self) -> float:
        """Norm of Delta after the best refit within J [standard deviations]; NaN where the motion diverged."""
        if not (np.isfinite(self.N).all() and np.isfinite(self.g).all()):
            return float("nan")
        d = np.sqrt(np.maximum(np.diag(self.N), 1e-300))
        taken = (self.g / d) @ np.linalg.pinv(self.N / np.outer(d, d), rcond=1e-12) @ (self.g / d)
        return float(np.sqrt(max(self.s - float(taken), 0.0)))

    @classmethod
    def present(cls, fitter: Fitter, truth: Fit, refitted: Fit) -> _Sums:
        """The sums over the records to fit. Prior rows of the refitted model keep its parameters near their stated values."""
        n = sum(r.valid.size for r in fitter.fit_records)
        delta = np.zeros(len(refitted.residual))
        delta[:n] = refitted.residual[:n] - truth.residual[:n]
        return cls._of(-refitted.J, delta, len(refitted.theta))

    def plus(self, fitter: Fitter, truth: Fit, refitted: Fit, record: Record) -> _Sums:
        """The sums with one more `record`."""
        simulator = fitter.simulator(refitted.structure, record)
        y, slopes = simulator.sensitivities(record, refitted.theta)
        other = fitter.simulator(truth.structure, record)
        delta = fitter.noise.whiten(other.simulate(record, truth.theta) - y, record.valid).ravel()
        J = fitter.noise.whiten(slopes, record.valid).reshape(len(delta), -1)
        sizes = initial_state_sd(simulator)
        prior = np.hstack([np.zeros((len(sizes), len(refitted.theta))), np.diag(1 / sizes)])
        new = _Sums._of(np.vstack([J, prior]), np.concatenate([delta, np.zeros(len(sizes))]), len(refitted.theta))
        return _Sums(self.N + new.N, self.g + new.g, self.s + new.s)

    @classmethod
    def _of(cls, J: np.ndarray, delta: np.ndarray, k: int) -> _Sums:
        theta, start = J[:, :k], J[:, k:]
        if start.shape[1]:
            q = np.linalg.qr(start / np.maximum(np.linalg.norm(start, axis=0), 1e-300))[0]
            theta, delta = theta - q @ (q.T @ theta), delta - q @ (q.T @ delta)
        return cls(theta.T @ theta, theta.T @ delta, float(delta @ delta))
