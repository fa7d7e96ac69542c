"""Experiment design: the drive that best discriminates between models that this recording cannot tell apart.

T-optimality with refitted rivals, linearised. With Delta (N,) the difference of two rivals' whitened readings and
J (N, k) the sensitivities of the rival that is refitted to the other's prediction,

    separation^2 = min over delta of |Delta - J delta|^2

over this recording and the new one together; of the two directions the smaller, in standard deviations.

Every drive that is considered can be done: it stays within the range, rate and band that the records hold (`drive_envelope.py`). Where
none of them decides, the best one is recorded several times, which adds the squares; or a drive goes as far as the device file
allows, or an imposed motion back as well.

Source: A. C. Atkinson, V. V. Fedorov, Biometrika 62 (1975) 57.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from pydantic import Field

from ctrlgen.core.units import difference
from ctrlgen.diagnosis.evidence.drive_envelope import DriveEnvelope, fastest, free_drives, occupied_band
from ctrlgen.diagnosis.evidence.excitation_signals import admissible, pose_sets, time_series
from ctrlgen.diagnosis.evidence.experiment_sums import Prediction, Sums
from ctrlgen.diagnosis.evidence.other_readings import OtherReadingEntry, OtherReadings, other_readings
from ctrlgen.diagnosis.selection.search_result import SearchResult
from ctrlgen.diagnosis.settings import EXPERIMENT
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.model.model import Model
from ctrlgen.recordings.recording import Record
from ctrlgen.reporting.result_file import FiniteOrNull, Keys


class CandidateExperimentEntry(Keys):
    """One drive that was considered."""

    kind: str = Field(description="Form of the drive.")
    description: str = Field(description="The drive in words.")
    strength: float = Field(description="Amplitude as a share of the drive's range.")
    separation: float = Field(description="Separation of the rivals with it [standard deviations].")


class ProposedDriveEntry(Keys):
    """What a proposed drive asks of one drive of the device, and what was recorded of it."""

    drive: str = Field(description="Name of the drive.")
    unit: str = Field(description="Unit of the numbers.")
    range: tuple[float, float] = Field(description="Smallest and largest value [unit].")
    rate: FiniteOrNull = Field(description="Largest change by time [unit/s]; null for settled poses.")
    band: FiniteOrNull = Field(
        description="Frequency below which 99 % of the energy of its changes lies [Hz]; null for settled poses."
    )
    recorded_range: tuple[float, float] = Field(description="The same of what was recorded.")
    recorded_rate: FiniteOrNull = Field(description="The same of what was recorded, or the device's stated limit.")
    recorded_band: FiniteOrNull = Field(description="The same of what was recorded.")


class AlternativeEntry(Keys):
    """What decides where no drive does that was seen to be possible; one of `repeats` and `beyond`."""

    repeats: int | None = Field(description="How often the proposed drive has to be recorded.")
    beyond: CandidateExperimentEntry | None = Field(
        description="A drive beyond what was recorded: within the limits that the device file states, or a motion the other way."
    )
    drives: list[ProposedDriveEntry] = Field(description="What it asks of each drive.")
    separation_after: float = Field(description="Separation of the rivals with it [standard deviations].")


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
    drives: list[ProposedDriveEntry] = Field(description="What the best drive asks of each drive of the device.")
    alternative: AlternativeEntry | None = Field(
        description="What decides where the best drive does not; null where nothing does."
    )
    other_readings: list[OtherReadingEntry] = Field(
        description="Where a cause of the sensor and one of the device explain alike: the same poses read otherwise, what decides first."
    )


@dataclass(frozen=True, eq=False)
class Experiment:
    """The best drive to discriminate between two rivals.

    rivals: the two models by their causes. reason: why these two.
    before, after: separation [standard deviations] by this recording, and with the new one.
    candidates: all drives considered, the best first. proposed: the best drive as a record without readings.
    drives: what the best asks of each drive. alternative: what decides where the best does not, None where nothing does.
    files: the content of each file of the folder next_experiment/. readings: what a second sensor or a turned specimen decides, None where
    no doubt is between sensor and device.
    """

    rivals: tuple[str, str]
    reason: str
    before: float
    after: float
    candidates: tuple[CandidateExperimentEntry, ...]
    proposed: Record
    drives: tuple[ProposedDriveEntry, ...] = ()
    alternative: AlternativeEntry | None = None
    files: dict[str, str] = field(default_factory=dict)
    readings: OtherReadings | None = None

    @property
    def settles(self) -> bool:
        """Whether the separation with the new recording decides between them."""
        return self.after >= EXPERIMENT.settles

    @property
    def offered(self) -> bool:
        """Whether the drive is worth recording: it settles the doubt, once or repeated."""
        return self.settles or (self.alternative is not None and self.alternative.repeats is not None)

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
            drives=list(self.drives),
            alternative=self.alternative,
            other_readings=[] if self.readings is None else list(self.readings.entries),
        )


def next_experiment(search: SearchResult, explained: bool, seed: int = 0) -> Experiment | None:
    """The drive that best discriminates between the chosen model and its rivals or, where the recording stays unexplained,
    between the two models that came closest; None where there is no such pair, or no admissible drive."""
    fitter, (pairs, reason) = search.fitter, _open(search, explained)
    if not pairs:
        return None
    best = max(
        (experiment for a, b in pairs if (experiment := separate(fitter, a, b, reason, seed)) is not None),
        key=lambda e: -e.before,
        default=None,
    )
    return None if best is None else replace(best, readings=other_readings(search, best.proposed))


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
    records, model = fitter.recording.records, fitter.simulator(a.structure, fitter.fit_records[0]).model
    recorded = DriveEnvelope.recorded(records, model)
    contest = _Contest.between(fitter, a, b)
    rows = contest.ranked(recorded, seed)
    if not rows:
        return None
    best, record = rows[0]
    return Experiment(
        (_named(a, b), _named(b, a)),
        reason,
        contest.before,
        best.separation,
        tuple(r[0] for r in rows),
        record,
        drives=_asked(record, recorded, model),
        alternative=None if best.separation >= EXPERIMENT.settles else contest.alternative(rows[0], recorded, seed),
    )


Row = tuple[CandidateExperimentEntry, Record]


@dataclass(frozen=True, eq=False)
class _Contest:
    """Two fits and the sums over what is recorded already, with either of them as the truth."""

    fitter: Fitter
    pairs: tuple[tuple[Fit, Fit], ...]
    now: tuple[Sums, ...]

    @classmethod
    def between(cls, fitter: Fitter, a: Fit, b: Fit) -> _Contest:
        pairs = ((a, b), (b, a))
        return cls(fitter, pairs, tuple(Sums.present(fitter, *pair) for pair in pairs))

    @property
    def before(self) -> float:
        """Separation by the recording [standard deviations]."""
        return min(s.separation for s in self.now)

    def ranked(self, envelope: DriveEnvelope, seed: int) -> list[Row]:
        """Every drive within the `envelope` that keeps the device's limits, the one that separates best first."""
        fitter, fit = self.fitter, self.pairs[0][0]
        template = max(fitter.fit_records, key=lambda r: len(r.time))
        simulator = fitter.simulator(fit.structure, template)
        n, poses = len(template.time), template.poses
        first = 0.0 if poses else max(r.time[-1] for r in fitter.recording.records) + template.sample_time
        family = (
            pose_sets(min(n, EXPERIMENT.most_poses), template.drive.shape[1], seed)
            if poses
            else time_series(
                min(n, EXPERIMENT.most_samples), envelope, template.sample_time, seed, free_drives(simulator.model)
            )
        )
        rows: list[Row] = []
        for shape in family:
            given = admissible(shape, simulator, fit.theta, template, first, envelope)
            if given is None:
                continue
            record, strength = given
            a, b = (Prediction.of(fitter, fit, record) for fit in self.pairs[0])
            there, back = self.now
            both = [there.plus(fitter, a, b, record).separation, back.plus(fitter, b, a, record).separation]
            if np.all(np.isfinite(both)):
                entry = CandidateExperimentEntry(
                    kind=shape.kind, description=shape.description, strength=strength, separation=min(both)
                )
                rows.append((entry, record))
        return sorted(rows, key=lambda row: -row[0].separation)

    def alternative(self, best: Row, recorded: DriveEnvelope, seed: int) -> AlternativeEntry | None:
        """What decides although the `best` recorded drive does not: the same several times, or one beyond the recorded range."""
        entry, record = best
        model = self.fitter.simulator(self.pairs[0][0].structure, record).model
        gained, wanted = entry.separation**2 - self.before**2, EXPERIMENT.settles**2 - self.before**2
        if gained * EXPERIMENT.most_repeats >= wanted:
            repeats = math.ceil(wanted / gained)
            return AlternativeEntry(
                repeats=repeats,
                beyond=None,
                drives=list(_asked(record, recorded, model)),
                separation_after=math.sqrt(self.before**2 + repeats * gained),
            )
        wider = recorded.widened(model)
        rows = self.ranked(wider, seed) if wider is not None else []
        if not rows or rows[0][0].separation < EXPERIMENT.settles:
            return None
        farther, record = rows[0]
        return AlternativeEntry(
            repeats=None,
            beyond=farther,
            drives=list(_asked(record, recorded, model)),
            separation_after=farther.separation,
        )


def _asked(record: Record, recorded: DriveEnvelope, model: Model) -> tuple[ProposedDriveEntry, ...]:
    """What a proposed `record` asks of each drive, beside what was recorded of it."""
    signal, h = model.signals["drive"], record.sample_time
    timed = not record.poses and len(record.drive) > 1
    rate, band = (fastest(record.drive, h), occupied_band(record.drive, h)) if timed else (recorded.rate, recorded.band)

    def shown(values: Sequence[float], unit: str) -> tuple[float, float]:
        low, high = (float(difference(v, unit)) for v in values)
        return low, high

    return tuple(
        ProposedDriveEntry(
            drive=channel,
            unit=unit,
            range=shown((record.drive[:, i].min(), record.drive[:, i].max()), unit),
            rate=float(difference(rate[i], unit)),
            band=float(band[i]),
            recorded_range=shown((recorded.low[i], recorded.high[i]), unit),
            recorded_rate=float(difference(recorded.rate[i], unit)),
            recorded_band=float(recorded.band[i]),
        )
        for i, (channel, unit) in enumerate(zip(signal.channels, signal.units, strict=True))
    )


def _named(fit: Fit, other: Fit) -> str:
    """The causes that `other` does not have."""
    causes = [c for c in fit.structure.causes if c not in other.structure.causes]
    return " and ".join(f"{c.effect} at {c.location}" for c in causes) or "the device without it"
