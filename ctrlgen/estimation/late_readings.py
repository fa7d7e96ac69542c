"""Readings that come late, of a simulation as a whole.

As states a delay takes every sample within it; a recording that is simulated as a whole holds them already. So where nothing
follows the delay (no law behind it, no loop that reads it) a simulation leaves it out of the model, and reads older samples
afterwards, by the polynomials of `effects.delay`, whose states the C and everything else has.

What such a reading shows at first happened before the record. No model knows it: there a simulation is taken to be as wrong as it is
just afterwards, so that nothing is won and nothing lost by not knowing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca
import numpy as np

from ctrlgen.devices import Device, DevicePhysics
from ctrlgen.effects import Place, is_group, means
from ctrlgen.estimation.settings import SIMULATION
from ctrlgen.model.assembly import build_model
from ctrlgen.model.discretisation import settling_time
from ctrlgen.model.effect_terms import channels, in_loop
from ctrlgen.model.model import Model


def effects_apart(device: Device, physics: DevicePhysics) -> tuple[int, ...]:
    """The places in the file of the effects that can be left out of the model of a recording."""
    if in_loop(physics):
        return ()
    sensors = [e for e in device.effect if e.place is Place.SENSOR]

    def last(k: int) -> bool:
        law = device.effect[k]
        behind = [e for e in sensors if e.order > law.order or (e.order == law.order and e is not law)]
        return not any(is_group(e.at) or is_group(law.at) or e.at == law.at for e in behind)

    return tuple(k for k, law in enumerate(device.effect) if law.apart and last(k))


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
    if not apart:
        return [], ca.SX(0, 1)
    device = model.device
    sensors = channels(device.physics(device.values()), Place.SENSOR)
    names, units = [c.name for c in sensors], {c.name: c.unit for c in sensors}
    late: list[LateReading] = []
    rates: list[ca.SX] = []
    for k in apart:
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
