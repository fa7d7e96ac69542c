"""Readings that come late, of a simulation as a whole.

As states a delay takes every sample within it; a recording that is simulated as a whole holds them already. So where nothing
follows the delay (no law behind it, no loop that reads it) a simulation leaves it out of the model, and reads older samples
afterwards, by the polynomials of `effects.delay`, whose states the C and everything else has.

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
from ctrlgen.effects import Place, means, overlap
from ctrlgen.estimation.settings import SIMULATION
from ctrlgen.model.assembly import build_model
from ctrlgen.model.discretisation import settling_time
from ctrlgen.model.effect_terms import channels, in_loop
from ctrlgen.model.model import Model


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
    rounding = {k for k, e in sensors.items() if e.in_steps and k in fixed and last(k)}
    late = {k for k, e in sensors.items() if e.apart and clock and last(k, rounding)}
    return tuple(sorted(rounding | late))


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
    """A reading that is late: its `row` among the channels, the rows of its rate and second rate (none where the motion gives none),
    and its age [s], a number or the place of one among the free numbers."""

    row: int
    rates: tuple[int, int] | None
    fixed: float
    free: int | None

    def age(self, p: np.ndarray) -> float:
        """[s] with the free numbers p."""
        return self.fixed if self.free is None else float(p[self.free])

    def signals(self, values: np.ndarray) -> Signals:
        """The reading's signals of all rows `values` (n, rows, ...)."""
        return Signals(values[:, self.row], *(values[:, row] for row in self.rates or ()))


def late_readings(
    model: Model, apart: Sequence[int], free: Sequence[str], observed: Sequence[str]
) -> tuple[list[LateReading], ca.SX]:
    """The channels `observed` that are late by the effects left out, and the rates (m,) that they need beside the channels."""
    late: list[LateReading] = []
    rates: list[ca.SX] = []
    if not any(model.device.effect[k].apart for k in apart):
        return late, ca.SX(0, 1)
    device = model.device
    sensors = channels(device.physics(device.values()), Place.SENSOR)
    names, units = [c.name for c in sensors], {c.name: c.unit for c in sensors}
    for k in (k for k in apart if device.effect[k].apart):
        law, amplitude = device.effect[k], device.effect[k].amplitude().name
        path = f"effect[{k}].{amplitude}"
        for row, channel in enumerate(observed):
            name = channel.removeprefix("reading.")
            if name == channel or not means(law.at, name, units[name]):
                continue
            seen = model.law_inputs(Place.SENSOR, names.index(name), None, {}, law.order)
            places = None
            if seen.rate is not None and seen.second_rate is not None:
                places = (len(observed) + len(rates), len(observed) + len(rates) + 1)
                rates += [model.closed(seen.rate), model.closed(seen.second_rate)]
            fixed, place = law.values[amplitude].si, free.index(path) if path in free else None
            late.append(LateReading(row, places, fixed, place))
    return late, ca.vertcat(ca.SX(0, 1), *rates)


@np.errstate(over="ignore", invalid="ignore")  # of a simulation that runs away
def read_late(s: Signals, age: float, h: float) -> tuple[np.ndarray, np.ndarray]:
    """y(t - age) at every sample of h [s], and its derivative by the age; linear in the signals.

    Before the first sample y goes on as it begins for a sample, and is constant before that.
    """
    n, D = len(s.y), min(age / h, float(len(s.y)))
    whole = int(np.floor(D))
    w, first = D - whole, whole + 2  # samples before the first, the earliest of which slopes alone read
    begin = s.y[:1] - s.y[1:2] if n > 1 else 0 * s.y[:1]
    y = np.concatenate([np.repeat(s.y[:1] + begin, first, axis=0), s.y])

    def at(values: np.ndarray, back: int) -> np.ndarray:
        return values[first - back : first - back + n]

    near, old = at(y, whole), at(y, whole + 1)
    if s.rate is None or s.second is None:
        newer = at(y, whole - 1) if whole else near
        slope, older = (newer - old) / (2 if whole else 1), (near - at(y, whole + 2)) / 2
    else:
        rate = h * np.concatenate([np.repeat(s.rate[:1], first, axis=0), s.rate])
        slope, older = at(rate, whole), at(rate, whole + 1)
    gap, turn = old - near + slope, slope - older
    fourth = 0.0
    if s.rate is not None and s.second is not None:
        second = h**2 * np.concatenate([np.zeros((first, *s.second.shape[1:])), s.second])
        fourth = (at(second, whole + 1) + 6 * gap - 4 * turn) / 2
    third = turn - 2 * gap - 2 * fourth
    square = gap - third - fourth
    late = near + w * (w * (square + w * (third + w * fourth)) - slope)
    by_w = w * (2 * square + w * (3 * third + w * 4 * fourth)) - slope
    return late, by_w / h


def unknown_samples(age: float, h: float, n: int) -> tuple[np.ndarray, np.ndarray]:
    """The samples of n that show what was before the record, which nobody knows, and for each the one as far behind their end.

    None where they would be half of the record.
    """
    count = int(np.ceil(age / h))
    unknown = np.arange(count if 2 * count < n else 0)
    return unknown, 2 * count - unknown


class LateSlopes:
    """`read_late` of small changes of a reading, (n, m) block by block of samples; none before the first block."""

    def __init__(self, age: float, h: float) -> None:
        self.age, self.h = age, h
        self.kept = int(np.floor(age / h)) + 2
        self.past: np.ndarray | None = None

    def late(self, changes: np.ndarray) -> np.ndarray:
        """The changes (n, m) of the next block as they are read."""
        past = np.zeros((self.kept, changes.shape[1])) if self.past is None else self.past
        known = np.concatenate([past, changes])
        self.past = known[-self.kept :]
        return read_late(Signals(known), self.age, self.h)[0][self.kept :]
