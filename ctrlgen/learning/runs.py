"""Recordings -> the runs of one path: their drives, and what was measured in each repetition.

Each record is a run, or of a closed path as many as it holds whole periods; records in a row that were driven alike are one run with
more repetitions. A record of something else is refused: another rate, other rows, drives that do not belong to the path.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.units import show
from ctrlgen.learning.implied_pose import ImpliedPose
from ctrlgen.learning.lifted import Lifted
from ctrlgen.learning.steady_drift import drift_of, without_drift
from ctrlgen.recordings.plausibility import with_plausibility
from ctrlgen.recordings.reader import load_recordings
from ctrlgen.recordings.recording import Record, Recording
from ctrlgen.recordings.validation import MissingSamples

SAME_DRIVE = 1e-3  # of a drive's range, within a record: digits of a file, noise of a measured drive
ALIKE = 3e-6  # of it, between records: more may be a step that was learnt
RATE = 0.1  # sample times by which a run's rows may drift from the path's
FEWEST_MEASURED = 20  # samples of a run at which a channel must have been read, or all
WIDEST_GAP = 0.1  # of the run, between samples that were read
SETTLED = 4.0  # times the variance between periods, by which the first may differ from the others before it is left out


@dataclass(frozen=True, eq=False)
class Run:
    """The same drives (n, n_u) [SI], as often as they were repeated: readings `y` (m, n, n_y) of the followed signal, NaN where there is
    none; `names` of the records, how many first `unsettled` periods were left out, how many `unread`
    ones, and the deviations (n, n_y), in typical sizes, of
    which it can say nothing because its zero or clock was taken out (`hidden_parts`)."""

    names: tuple[str, ...]
    drive: np.ndarray
    y: np.ndarray
    unsettled: int = 0
    unread: int = 0
    hidden: tuple[np.ndarray, ...] = ()

    @property
    def name(self) -> str:
        """The names of its records, separated by commas."""
        return ", ".join(self.names)


@dataclass(frozen=True, eq=False)
class Runs:
    """All runs in their order. `noise` (n_y,) [SI] is stated by the recording, NaN where it is not; `observed` (n_y,): the channel was
    read. `notes`: what reading them marked."""

    runs: tuple[Run, ...]
    noise: np.ndarray
    observed: np.ndarray
    notes: tuple[str, ...]


def load_runs(paths: Sequence[Path | str], lifted: Lifted, implied: ImpliedPose) -> Runs:
    """The runs in the recordings at `paths`, each a recording.toml or its folder, in this order, with the poses `implied` by their
    readings; a steady drift within a record is taken out. Raises InputError with every fault."""
    recording = with_plausibility(load_recordings(paths, lifted.model, hold_out=False), lifted.model)
    source = str(paths[0]) if len(paths) == 1 else "recordings"
    records = [record for record in recording.records if record.role != "rest"]
    places, faults, drifting = _places(recording, lifted), list[Fault](), list[str]()
    noise = np.array([np.nan if p is None else recording.noise[p] or np.nan for p in places], float)
    if lifted.static != (recording.kind == "poses"):
        what = (
            "a row of separate equilibria: record its settled poses"
            if lifted.static
            else "a motion in time: record a series"
        )
        raise InputError(source, [Fault("kind", f"{recording.kind!r} does not fit the scenario, which is {what}")])
    if all(place is None for place in places):
        name = lifted.solution.scenario.file.follow
        what = f"has no reading of the followed {name}; add {name}.{lifted.signal.channels[0]} or reading.{lifted.signal.channels[0]}"
        raise InputError(source, [Fault("columns", what)])
    runs, copies = list[Run](), _copies(records)
    for record in (record for record in records if record.name not in copies):
        try:
            run, drift = _run(record, places, lifted, noise)
        except ValueError as error:
            faults.append(Fault(record.name, str(error)))
            continue
        if implied.late.any():
            run = replace(run, y=in_time(run, lifted, implied.late))
        runs.append(replace(run, y=implied.pose(run.y, run.drive)))
        drifting += _drifting(run, drift, lifted)
    if faults:
        raise InputError(source, faults)
    if not runs:
        raise InputError(source, [Fault("record", 'none is a run: all have role = "rest"')])
    observed = np.array([p is not None for p in places])
    notes = [note for note in recording.notes if not isinstance(note, MissingSamples)]
    notes += [
        f"{run.name}: the first period differs from the others by more than they from each other; it had not settled and is left out."
        for run in runs
        if run.unsettled
    ]
    notes += [
        f"{run.name}: {run.unread} of {run.unread + run.unsettled + len(run.y)} repetitions left out, not read for too long to be bridged."
        for run in runs
        if run.unread
    ]
    notes += [
        f"{name}: holds the readings of {of} to the last bit and is left out: a copy says nothing more of the noise."
        for name, of in copies.items()
    ]
    notes += drifting
    return Runs(tuple(runs), noise, observed, tuple(notes))


def _drifting(run: Run, drift: np.ndarray, lifted: Lifted) -> list[str]:
    """A note of the drift (n_y,) [SI] a period that was taken out of a run."""
    signal = lifted.signal
    of = [f"{c} by {show(d, u)}" for c, d, u in zip(signal.channels, drift, signal.units, strict=True) if d]
    what = (
        f"{run.name}: its readings drift steadily in each period, {', '.join(of)}; taken out from the first sample on."
    )
    return [f"{what} Sensor or stage: let both warm up."] if of else []


def merged(runs: Runs, lifted: Lifted) -> Runs:
    """Runs in a row that were driven alike are one run with more repetitions."""
    joined = list[Run]()
    for run in runs.runs:
        if joined and _alike(joined[-1].drive, run.drive, lifted):
            last = joined[-1]
            y = np.concatenate([last.y, run.y])
            unsettled, unread = last.unsettled + run.unsettled, last.unread + run.unread
            joined[-1] = Run((*last.names, *run.names), last.drive, y, unsettled, unread, (*last.hidden, *run.hidden))
        else:
            joined.append(run)
    return replace(runs, runs=tuple(joined))


def _places(recording: Recording, lifted: Lifted) -> list[int | None]:
    """The column of each followed channel: that of the signal itself, or of its reading; None where it was not read."""
    follow, places = lifted.solution.scenario.file.follow, list[int | None]()
    for channel in lifted.signal.channels:
        names = [name for name in (f"{follow}.{channel}", f"reading.{channel}") if name in recording.channels]
        places.append(recording.channels.index(names[0]) if names else None)
    return places


def _alike(a: np.ndarray, b: np.ndarray, lifted: Lifted) -> bool:
    return bool(np.all(np.abs(a - b) <= ALIKE * _range(lifted)))


def _range(lifted: Lifted) -> np.ndarray:
    """(n_u,) what the path's own drives move through, at least a share of the largest."""
    u = lifted.solution.drive
    return np.maximum(np.ptp(u, axis=0), SAME_DRIVE * np.abs(u).max())


def _run(record: Record, places: Sequence[int | None], lifted: Lifted, noise: np.ndarray) -> tuple[Run, np.ndarray]:
    """A record folded into repetitions of the path, and the drift (n_y,) [SI] a period that was taken out; `noise` (n_y,) [SI] of it where
    that is stated. Raises ValueError with what is wrong."""
    n, every = lifted.n, _every(record, lifted)
    if record.linear and not record.either and not lifted.static:
        raise ValueError(
            'between_samples = "linear", but a player holds each drive until the next sample; record it so, or leave the key out'
        )
    rows = len(record.drive) // every
    m = rows // n if lifted.closed or lifted.static else min(1, rows // n)
    if not m:
        raise ValueError(
            f"has {number_of(len(record.drive), 'row')}, which is less than one run: {number_of(n, 'sample')} of the path"
            + (f", {every} rows each" if every > 1 else "")
        )
    used = record.drive[: m * n * every].reshape(m, n, every, -1)
    allowed = SAME_DRIVE * _range(lifted)
    if not np.all(np.ptp(used, axis=2) <= allowed):
        raise ValueError(
            f"its drives change within a sample of the path, which is {every} rows: it is of another path, or must begin at a sample, "
            "by `rows`"
        )
    periods = used.mean(axis=2)
    drive = periods.mean(axis=0)
    if not np.all(np.abs(periods - drive) <= allowed):
        k, i = np.argwhere(np.abs(periods - drive).max(axis=0) > allowed)[0]
        name = lifted.model.signals["drive"].channels[i]
        raise ValueError(
            f"its drives do not repeat after {number_of(n, 'sample')} (drive.{name} at sample {k}); "
            "cut it by `rows` so that each record is one run"
        )
    observed = record.observed[: m * n * every : every].reshape(m, n, -1)
    y = np.stack([np.full((m, n), np.nan) if p is None else observed[:, :, p] for p in places], axis=2)
    for channel, p, values in zip(lifted.signal.channels, places, np.moveaxis(y, 2, 0), strict=True):
        if p is not None and (fault := _too_few(np.isfinite(values).any(axis=0), lifted)):
            raise ValueError(f"{channel} {fault}")
    drift, unsettled = np.zeros(len(places)), 0
    if lifted.closed:
        drift = drift_of(y, noise)
        y = without_drift(y, drift)
    whole = np.array([_is_whole(of, places, lifted) for of in y])
    if not whole.any():  # read here and there in each, and everywhere in all
        whole[:] = True
    if lifted.closed and whole[0]:
        unsettled = first_differs(y[whole])
    return Run((record.name,), drive, y[whole][unsettled:], unsettled, int(np.sum(~whole))), drift


def _is_whole(y: np.ndarray, places: Sequence[int | None], lifted: Lifted) -> bool:
    """Whether a repetition (n, n_y) was read so that what lies between its readings can be bridged. A straight line over half a period,
    or zero over a whole one, would count as what repeats."""
    return not any(p is not None and _too_few(np.isfinite(of), lifted) for p, of in zip(places, y.T, strict=True))


def _copies(records: Sequence[Record]) -> dict[str, str]:
    """The records whose readings, under the same drives, are those of an earlier one to the last bit, with its name: no repetitions, which
    would halve the noise."""
    found: dict[str, str] = {}
    for j, record in enumerate(records):
        for other in records[:j]:
            same = record.drive.shape == other.drive.shape and np.array_equal(record.drive, other.drive)
            if same and np.array_equal(record.observed, other.observed, equal_nan=True):
                found[record.name] = other.name
                break
    return found


def _every(record: Record, lifted: Lifted) -> int:
    """Rows of the record in one sample of the path. Raises ValueError where that is no whole number."""
    if lifted.static:
        return 1
    rows = lifted.sample_time / record.sample_time
    every = max(1, round(rows))
    if abs(rows / every - 1) * lifted.n > RATE:
        path_rate, record_rate = (show(1 / t, "Hz") for t in (lifted.sample_time, record.sample_time))
        raise ValueError(
            f"was recorded at {record_rate}, the path runs at {path_rate}; record at that rate or a whole multiple, or resample it so"
        )
    return every


def _too_few(measured: np.ndarray, lifted: Lifted) -> str:
    """What is wrong with the samples (n,) at which a channel was read; empty where they are enough."""
    read = np.flatnonzero(measured)
    if len(read) < min(FEWEST_MEASURED, lifted.n):
        return f"was read at {len(read)} of {number_of(lifted.n, 'sample')}; {min(FEWEST_MEASURED, lifted.n)} or more are needed"
    if lifted.static:
        return "" if len(read) == lifted.n else f"was not read at pose {int(np.flatnonzero(~measured)[0])}"
    gaps = (
        np.diff(np.append(read, read[0] + lifted.n))
        if lifted.closed
        else np.diff(np.concatenate([[0], read, [lifted.n - 1]]))
    )
    if gaps.max() > WIDEST_GAP * lifted.n:
        return f"was not read for {number_of(gaps.max(), 'sample')} in a row; at most {int(WIDEST_GAP * lifted.n)} can be bridged"
    return ""


def first_differs(y: np.ndarray) -> int:
    """1 where the first of three or more periods differs from the others more than noise, and so was not settled; else 0."""
    if len(y) < 3:
        return 0
    others = y[1:]
    spread, first = others.var(axis=0, ddof=1), (y[0] - others.mean(axis=0)) ** 2
    both = np.isfinite(first)  # samples read in every period
    seen = both.any(axis=0)
    expected = np.where(both, spread, 0.0).sum(axis=0) * (1 + 1 / len(others))
    return int(np.any(np.where(both, first, 0.0).sum(axis=0)[seen] > SETTLED * expected[seen]))


def root_mean_square(values: np.ndarray) -> float:
    """Of all values, whatever their channel."""
    return float(np.sqrt(np.mean(values**2)))


def errors(run: Run, lifted: Lifted) -> tuple[np.ndarray, np.ndarray]:
    """Followed minus commanded in each repetition (m, n, n_y), between samples that were read by a straight line, zero in channels
    without a reading; and the share (n_y,) of the samples that were read."""
    e = run.y - lifted.solution.command
    known = np.isfinite(e)
    share = known.mean(axis=(0, 1))
    return _bridged(e, known, lifted), np.where(share > 0, share, 1.0)


def in_time(run: Run, lifted: Lifted, late: np.ndarray) -> np.ndarray:
    """(m, n, n_y) the readings of a run that come `late` (n_y,) [s], at the moments that they are of: cubic between samples. They stay
    unread where they were."""
    command, n, h = lifted.solution.command, lifted.n, lifted.sample_time
    known = np.isfinite(run.y)
    y = _bridged(run.y - command, known, lifted) + command
    ahead = min(n, int(np.ceil(np.abs(late).max() / h)) + 4)  # samples of the neighbouring periods that a cubic needs
    moved = np.empty(y.shape)
    for j, of in enumerate(y):
        around = np.vstack([of[-ahead:], of, of[:ahead]]) if lifted.closed else of
        k = (np.arange(len(around)) - (ahead if lifted.closed else 0)) * h
        for i in range(y.shape[2]):
            at = np.clip(np.arange(n) * h + late[i], k[0], k[-1])
            moved[j, :, i] = CubicSpline(k, around[:, i])(at)
    return np.where(known, moved, np.nan)


def _bridged(e: np.ndarray, known: np.ndarray, lifted: Lifted) -> np.ndarray:
    """Values (m, n, n_y) with straight lines over what is not `known`, zero in channels without a reading."""
    n, k = lifted.n, np.arange(lifted.n)
    period = n if lifted.closed else None
    for repetition, of in zip(e, known, strict=True):
        for i in range(e.shape[2]):
            read = np.flatnonzero(of[:, i])
            if 0 < len(read) < n:
                repetition[:, i] = np.interp(k, read, repetition[read, i], period=period)
            elif not len(read):
                repetition[:, i] = 0.0
    return e
