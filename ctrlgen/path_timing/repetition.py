"""The largest path that can be repeated at a frequency."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ctrlgen.core.errors import Fault, InputError, SolverError
from ctrlgen.core.units import Quantity, from_si, written_unit
from ctrlgen.path_timing.confirmed import Followed
from ctrlgen.path_timing.optimum import Optimiser, Optimum
from ctrlgen.trajectory.paths import Circle

SMALLEST = 1e-3  # of the path: below, it is no longer the same
LARGEST = 1e3
CLOSE = 1e-3  # of a scale, to which it is found
FEWEST = 4  # samples of a period


@dataclass(frozen=True)
class Repetition:
    """What can be repeated at a `frequency` [Hz]: the largest `scale` of the path about its middle with the best law of time, and
    `even` at even speed; None where no scale can. `diameter` [SI] and `unit` of a circle as stated."""

    frequency: float
    scale: float | None
    even: float | None
    diameter: float | None
    unit: str

    def size(self, scale: float | None) -> float | None:
        """The diameter in its unit at a scale; None where there is none."""
        return None if scale is None or self.diameter is None else float(from_si(self.diameter * scale, self.unit))


def at_frequency(followed: Followed, optimiser: Optimiser, frequency: Quantity, known: Optimum) -> Repetition:
    """The largest scales at a `frequency`. Raises InputError for one that samples cannot show."""
    period, h = 1 / frequency.si, followed.sample_time
    if period < FEWEST * h:
        what = f"leaves {period / h:.3g} samples for a period at {followed.rate.text}; give a higher --sample-rate or a lower frequency"
        raise InputError("--frequency", [Fault(frequency.text, what)])
    n = int(period / h * (1 + 1e-9))

    def by_best_law(scale: float) -> bool:
        try:
            return optimiser.along(followed.curve.scaled(scale), sampled=False).duration <= period
        except SolverError:
            return False

    def at_even_speed(scale: float) -> bool:
        curve = followed.curve.scaled(scale)
        share = curve.evenly(n)
        return len(share) - 1 <= period / h * (1 + 1e-9) and replace(followed, curve=curve).keeps(share)

    begin = 1.0 if known.duration <= period else None
    best = _largest(by_best_law, begin)
    even = None if followed.model.inertial and not followed.curve.closed else _largest(at_even_speed, None)
    path = followed.curve.scenario.file.path
    diameter = path.diameter if isinstance(path, Circle) else None
    unit = written_unit(diameter.text) if diameter else ""
    return Repetition(frequency.si, best, even, diameter.si if diameter else None, unit)


def _largest(holds: Callable[[float], bool], held: float | None) -> float | None:
    """Near the largest scale at which something holds, as it does at `held`; None where it does at none."""
    fails = None
    if held is None:
        scale = 1.0
        while not holds(scale):
            fails, scale = scale, scale / 2
            if scale < SMALLEST:
                return None
        held = scale
    while fails is None:
        if held * 2 > LARGEST:
            return held
        if holds(held * 2):
            held *= 2
        else:
            fails = held * 2
    while fails - held > CLOSE * held:
        middle = float(np.sqrt(fails * held))
        fails, held = (fails, middle) if holds(middle) else (middle, held)
    return held
