"""The largest path that can be repeated at a frequency, and its set-points, which the exact inverse confirms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy

from ctrlgen.budget.robust import solve
from ctrlgen.core.errors import Fault, InputError, SolverError
from ctrlgen.core.to_digits import to_digits
from ctrlgen.core.units import Quantity, from_si, written_unit
from ctrlgen.path_timing.feasibility import Followed
from ctrlgen.path_timing.optimum import Optimiser, Optimum
from ctrlgen.trajectory.paths import Circle
from ctrlgen.trajectory.solution import Solution

SMALLEST = 1e-3  # of the path: below, it is no longer the same
LARGEST = 1e3
CLOSE = 1e-3  # of a scale, to which it is found
FEWEST = 4  # samples of a period
MOST = 20_000  # samples of a period: each scale that is tried is followed through all of them
MOST_SHRUNK = 6  # times that a path is made smaller, by twice as much each time, until its set-points keep all limits
IMPOSSIBLE = 10.0  # periods, as their logarithm, for a path that cannot be followed


@dataclass(frozen=True)
class Repetition:
    """What can be repeated at a `frequency` [Hz]: the largest `scale` of the path about its middle with the best law of time, and
    `even` at even speed; None where no scale can. `diameter` [SI] and `unit` of a circle as stated. `sampled` is the scale whose
    set-points were confirmed, whole samples cost a little, and `solution` these set-points as a scenario with its drives; None where
    no set-points were found."""

    frequency: float
    scale: float | None
    even: float | None
    diameter: float | None
    unit: str
    sampled: float | None
    solution: Solution | None

    def size(self, scale: float | None) -> float | None:
        """The diameter in its unit at a scale; None where there is none."""
        return None if scale is None or self.diameter is None else float(from_si(self.diameter * scale, self.unit))


def check_frequency(rate: Quantity, frequency: Quantity) -> None:
    """Raises InputError for a frequency whose period has too few or too many samples at the sample `rate`."""
    samples = rate.si / frequency.si
    if samples < FEWEST:
        what = f"leaves {to_digits(samples, 3)} samples for a period at {rate.text}; give a higher --sample-rate or a lower frequency"
    elif samples > MOST:
        what = f"is {samples:.6g} samples for a period at {rate.text}, more than {MOST}; give a lower --sample-rate"
    else:
        return
    raise InputError("--frequency", [Fault(frequency.text, what)])


def at_frequency(
    followed: Followed,
    optimiser: Optimiser,
    frequency: Quantity,
    known: Optimum,
    progress: Callable[[str], None] = lambda _: None,
) -> Repetition:
    """The largest scales at a `frequency`, with set-points; `known` is the optimum at the scale 1."""
    period, h = 1 / frequency.si, followed.sample_time
    n = int(period / h * (1 + 1e-9))

    def behind(log_scale: float) -> float:
        """The logarithm of the shortest time over the period."""
        try:
            duration = optimiser.along(followed.curve.scaled(float(np.exp(log_scale))), sampled=False).duration
        except SolverError:
            return IMPOSSIBLE
        return float(np.log(duration / period))

    def at_even_speed(scale: float) -> bool:
        curve = followed.curve.scaled(scale)
        share = curve.evenly(n)
        return len(share) - 1 <= period / h * (1 + 1e-9) and replace(followed, curve=curve).keeps(share)

    best = crossing(behind, float(np.log(known.duration / period)))
    even = largest(at_even_speed) if followed.may_be_even else None
    path = followed.curve.scenario.file.path
    diameter = path.diameter if isinstance(path, Circle) else None
    unit = written_unit(diameter.text) if diameter else ""
    progress(f"set-points at {frequency.text}")
    sampled, share = (None, None) if best is None else _set_points(followed, optimiser, n, best)
    if even is not None and even > (sampled or 0.0):
        sampled, share = even, followed.curve.scaled(even).evenly(n)
    solution = None
    if share is not None and sampled is not None:
        title = f"{followed.curve.scenario.file.title}: {to_digits(sampled)} times as large, {frequency.text}"
        scaled = replace(followed, curve=followed.curve.scaled(sampled))
        solution = solve(scaled.scenario(share, title, "repeated"), followed.model, progress)
    return Repetition(frequency.si, best, even, diameter.si if diameter else None, unit, sampled, solution)


def _set_points(
    followed: Followed, optimiser: Optimiser, n: int, best: float
) -> tuple[float | None, np.ndarray | None]:
    """The largest scale found, up to `best`, at which set-points by the fastest law of time keep all limits in `n` intervals, and the
    shares of these; None where there are none."""
    known: dict[float, np.ndarray] = {}

    def holds(scale: float) -> bool:
        curve = followed.curve.scaled(scale)
        try:
            optimum = optimiser.along(curve)
        except SolverError:
            return False
        spare = n - (len(optimum.samples(followed.sample_time)) - 1)
        while spare >= 0:
            share = optimum.samples(followed.sample_time, spare)
            if len(share) - 1 <= n:  # each smooth piece takes whole samples
                if replace(followed, curve=curve).keeps(share):
                    known[scale] = share
                return scale in known
            spare -= 1
        return False

    fails, less = best / (1 - CLOSE), CLOSE
    for _ in range(MOST_SHRUNK + 1):
        scale = fails * (1 - less)
        if holds(scale):
            break
        fails, less = scale, 2 * less
    else:
        return None, None
    while fails - scale > CLOSE * scale * (1 + 1e-9):
        middle = (fails + scale) / 2
        fails, scale = (fails, middle) if holds(middle) else (middle, scale)
    return scale, known[scale]


def crossing(behind: Callable[[float], float], at_one: float) -> float | None:
    """The scale at which `behind` (log scale) is zero, as it is `at_one` at the scale 1; None where it is above zero at all."""
    step, here, value = float(np.log(2)) * (1 if at_one <= 0 else -1), 0.0, at_one
    while np.log(SMALLEST) < here + step < np.log(LARGEST):
        there = behind(here + step)
        if (there <= 0) != (value <= 0):
            root = scipy.optimize.brentq(behind, *sorted((here, here + step)), xtol=CLOSE / 4)
            return float(np.exp(root - CLOSE / 4))  # on the safe side
        here, value = here + step, there
    return float(np.exp(here)) if value <= 0 else None


def largest(holds: Callable[[float], bool]) -> float | None:
    """Near the largest scale at which something holds; None where it does at none."""
    scale, growth = 1.0, 2.0 if holds(1.0) else 0.5
    while (growth > 1) == holds(scale * growth):
        scale *= growth
        if not SMALLEST < scale < LARGEST:
            return scale if growth > 1 else None
    held, fails = sorted((scale, scale * growth))
    while fails - held > CLOSE * held:
        middle = float(np.sqrt(fails * held))
        fails, held = (fails, middle) if holds(middle) else (middle, held)
    return held
