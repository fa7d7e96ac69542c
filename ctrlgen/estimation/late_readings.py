"""Readings that come late, of a simulation as a whole.

As states a delay, or a mean over a window, takes every sample within it; a recording that is simulated as a whole holds them already.
So where nothing else follows such a law (no law behind it, no loop that reads it) a simulation leaves it out of the model, and reads older
samples afterwards, by the polynomials of the law (`effects.delay`, `effects.moving_average`), whose states the C and everything else has.

What such a reading shows at first happened before the record. No model knows it: there a simulation is taken to be as wrong as it is
just afterwards, so that nothing is won and nothing lost by not knowing.

Rounding that is the last to act is left out too, and stays out: by the slopes of a staircase, which are zero, no fit could move any
number, and `estimation.noise` counts it as noise (B. Widrow, I. Kollar, Quantization Noise, 2008).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca
import numpy as np

from ctrlgen.devices import Device, DevicePhysics
from ctrlgen.effects import Apart, Between, Place, means, overlap
from ctrlgen.estimation.settings import SIMULATION
from ctrlgen.model.assembly import build_model
from ctrlgen.model.discretisation import settling_time
from ctrlgen.model.effect_terms import channels, in_loop
from ctrlgen.model.model import Model
from ctrlgen.recordings.recording import Record


def effects_apart(
    device: Device, physics: DevicePhysics, free: Collection[str] = (), clock: bool = True
) -> tuple[int, ...]:
    """The places in the file of the effects that can be left out of the model of a recording, whose numbers `free` are fitted; of one
    without a `clock` none that looks back."""
    if in_loop(physics):
        return ()
    sensors = {k: e for k, e in enumerate(device.effect) if e.place is Place.SENSOR}

    def last(k: int, unless: Collection[int] = ()) -> bool:
        law = device.effect[k]
        behind = [e for j, e in sensors.items() if e.order >= law.order and j != k and j not in unless]
        return not any(overlap(e.at, law.at) for e in behind)

    fixed = {k for k in sensors if not any(path.startswith(f"effect[{k}].") for path in free)}
    apart = {k for k, e in sensors.items() if e.in_steps and k in fixed and last(k)}
    for k in sorted(sensors, key=lambda k: sensors[k].order, reverse=True):  # one behind another may be too
        if sensors[k].apart and clock and last(k, apart):
            apart.add(k)
    return tuple(sorted(apart))


def settling_time_of(device: Device) -> float:
    """Time [s] in which a device settles, without its delays, whose many states change once a sample and have no rate."""
    apart = [k for k, law in enumerate(device.effect) if law.apart]
    return settling_time(build_model(device, sample_time=SIMULATION.settling_sample_time, apart=apart))


class Signals(NamedTuple):
    """A reading y (n, ...) at every sample with its rate and second rate, None where the motion gives none."""

    y: np.ndarray
    rate: np.ndarray | None = None
    second: np.ndarray | None = None


@dataclass(frozen=True)
class LateReading:
    """A reading that is late, or a mean over a window: its `row` among the channels, the rows of its rate and second rate (none where the
    motion gives none, or behind another such law), how it is read, how far back [s], a number or the place of one among the free numbers,
    and by which share of that a slow reading comes late."""

    row: int
    rates: tuple[int, ...]
    how: Apart
    fixed: float
    free: int | None
    late_by: float

    def reach(self, p: np.ndarray) -> float:
        """How far back it is read [s] with the free numbers p."""
        return self.fixed if self.free is None else float(p[self.free])

    def age(self, p: np.ndarray) -> float:
        """By how much a slow reading comes late [s] with the free numbers p."""
        return self.late_by * self.reach(p)

    def read(self, values: np.ndarray, p: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
        """The reading of all rows `values` (n, rows, ...) and its derivative by how far back it is read."""
        signals = Signals(values[:, self.row], *(values[:, row] for row in self.rates))
        return READ[self.how](signals, self.reach(p), h)


def late_readings(
    model: Model, apart: Sequence[int], free: Sequence[str], observed: Sequence[str]
) -> tuple[list[LateReading], ca.SX]:
    """The channels `observed` that the effects left out read late, one behind another in their order, and the rates (m,) that they need
    beside the channels."""
    late: list[LateReading] = []
    rates: list[ca.SX] = []
    device = model.device
    effects = sorted(((device.effect[k], k) for k in apart if device.effect[k].apart), key=lambda of: of[0].order)
    if not effects:
        return late, ca.SX(0, 1)
    sensors = channels(device.physics(device.values()), Place.SENSOR)
    names, units = [c.name for c in sensors], {c.name: c.unit for c in sensors}
    for law, k in effects:
        assert law.apart is not None
        amplitude = law.amplitude().name
        path = f"effect[{k}].{amplitude}"
        for row, channel in enumerate(observed):
            name = channel.removeprefix("reading.")
            if name == channel or not means(law.at, name, units[name]):
                continue
            seen = model.law_inputs(Place.SENSOR, names.index(name), None, {}, law.order)
            behind = any(r.row == row for r in late)
            needed = () if behind else (seen.rate, seen.second_rate)[: RATES[law.apart]]
            new = [model.closed(rate) for rate in needed if rate is not None]
            places = tuple(len(observed) + len(rates) + i for i in range(len(new)))
            rates += new
            fixed, place = law.values[amplitude].si, free.index(path) if path in free else None
            late.append(LateReading(row, places, law.apart, fixed, place, law.late_by))
    return late, ca.vertcat(ca.SX(0, 1), *rates)


class _Samples(NamedTuple):
    """What a reading back by D samples takes, of every row: the samples `y` from the second one before its oldest on, how many lie
    within D, the present slope (times h), and the polynomial to w beyond the oldest of these, `near`."""

    y: np.ndarray
    whole: int
    slope: np.ndarray
    w: float
    near: np.ndarray
    between: Between


def _samples(s: Signals, D: float, h: float) -> _Samples:
    """Before the first sample y goes on as it begins for a sample, and is constant before that."""
    n, whole = len(s.y), int(np.floor(D))
    first = whole + 2  # samples before the first, the earliest of which slopes alone read
    begin = s.y[:1] - s.y[1:2] if n > 1 else 0 * s.y[:1]
    y = np.concatenate([np.repeat(s.y[:1] + begin, first, axis=0), s.y])

    def at(values: np.ndarray, back: int) -> np.ndarray:
        return values[first - back : first - back + n]

    near, old, second = at(y, whole), at(y, whole + 1), None
    if s.rate is None:
        present = at(y, 0) - at(y, 1)
        slope, older = (at(y, whole - 1) - old) / 2 if whole else present, (near - at(y, whole + 2)) / 2
    else:
        rate = h * np.concatenate([np.repeat(s.rate[:1], first, axis=0), s.rate])
        present, slope, older = at(rate, 0), at(rate, whole), at(rate, whole + 1)
    if s.second is not None:
        second = at(h**2 * np.concatenate([np.zeros((first, *s.second.shape[1:])), s.second]), whole + 1)
    return _Samples(y, whole, present, D - whole, near, Between(near, old, slope, older, second))


@np.errstate(over="ignore", invalid="ignore")  # of a simulation that runs away
def read_late(s: Signals, age: float, h: float) -> tuple[np.ndarray, np.ndarray]:
    """y(t - age) at every sample of h [s], and its derivative by the age; linear in the signals."""
    r = _samples(s, min(age / h, float(len(s.y))), h)
    return r.near + r.between.change(r.w), r.between.change_by(r.w) / h


@np.errstate(over="ignore", invalid="ignore")
def read_mean(s: Signals, window: float, h: float) -> tuple[np.ndarray, np.ndarray]:
    """The mean of y from t - window to t at every sample of h [s], and its derivative by the window; linear in the signals."""
    D = min(window / h, float(len(s.y)))
    r = _samples(s._replace(second=None), D, h)
    mean = r.near + r.between.mean_change(r.w)
    if not r.whole:
        return mean, r.between.mean_change_by(r.w) / h
    ends = (s.y + r.near) / 2 + (r.slope - r.between.slope) / 12
    mean = (sums_of_neighbours(r.y[2:], r.whole + 1) - ends + r.w * mean) / D
    return mean, (r.near + r.between.change(r.w) - mean) / (D * h)


def sums_of_neighbours(values: np.ndarray, count: int) -> np.ndarray:
    """The sum of each `count` neighbours along the first axis, of no value beside them: of the end of one block of so many and the
    beginning of the next. A difference of sums from the first value on would lose the digits of these."""
    n, rest = len(values), values.shape[1:]
    blocks = np.concatenate([values, np.zeros((-n % count, *rest))]).reshape(-1, count, *rest)
    begun = np.cumsum(blocks, axis=1).reshape(-1, *rest)
    ended = np.cumsum(blocks[:, ::-1], axis=1)[:, ::-1].reshape(-1, *rest)
    first = np.arange(n - count + 1)
    total = ended[first]
    inside = first % count > 0
    total[inside] += begun[first[inside] + count - 1]
    return total


READ = {Apart.LATE: read_late, Apart.MEAN: read_mean}
RATES = {Apart.LATE: 2, Apart.MEAN: 1}
"""Derivatives of the reading by time that each takes, where the motion gives them."""


def read_afterwards(
    late: Sequence[LateReading],
    record: Record,
    p: np.ndarray,
    values: np.ndarray,
    slopes: np.ndarray | None = None,
    by_free: bool = True,
) -> None:
    """Replaces each reading that is late among the rows `values` (n, rows), and in their derivatives `slopes` (n, rows, m), of which the
    first are those by the free numbers where these are asked for, by what is read of it: as wrong, where that was before the record, as
    just afterwards."""
    h = record.sample_time
    for reading in late:
        read, by_reach = reading.read(values, p, h)
        if slopes is not None:
            of_read = reading.read(slopes, p, h)[0]
            if reading.free is not None and by_free:
                of_read[:, reading.free] += by_reach
            slopes[:, reading.row] = of_read
        values[:, reading.row] = read
    for row in {reading.row for reading in late}:
        reach = sum(reading.reach(p) for reading in late if reading.row == row)
        unknown, behind = unknown_samples(reach, h, len(values))
        read, observed, valid = values[:, row], record.observed[:, row], record.valid[:, row]
        wrong = np.where(valid[behind], observed[behind] - read[behind], 0.0)
        read[unknown] = np.where(valid[unknown], observed[unknown] - wrong, read[behind])
        if slopes is not None:
            slopes[unknown, row] = slopes[behind, row]


def unknown_samples(reach: float, h: float, n: int) -> tuple[np.ndarray, np.ndarray]:
    """The samples of n that show what was before the record, which nobody knows, and for each the one as far behind their end.

    None where they would be half of the record.
    """
    count = int(np.ceil(reach / h))
    unknown = np.arange(count if 2 * count < n else 0)
    return unknown, 2 * count - unknown


class LateSlopes:
    """`read_late`, or another way to read, of small changes of a reading, (n, m) block by block of samples; none before the first block."""

    def __init__(self, reach: float, h: float, how: Apart = Apart.LATE) -> None:
        self.reach, self.h, self.how = reach, h, how
        self.kept = int(np.floor(reach / h)) + 2
        self.past: np.ndarray | None = None

    def late(self, changes: np.ndarray) -> np.ndarray:
        """The changes (n, m) of the next block as they are read."""
        past = np.zeros((self.kept, changes.shape[1])) if self.past is None else self.past
        known = np.concatenate([past, changes])
        self.past = known[-self.kept :]
        return READ[self.how](Signals(known), self.reach, self.h)[0][self.kept :]
