"""What a sensor may feign of a motion, and how far an error that it read is believed to be the stage's.

A reading that is wrong by its scale, its zero or its clock shows an error that the stage does not have, and drives that take it away
spoil the true motion. In the span of what the sensor may feign, G with columns of so many standard deviations each, G = U w V', a
deviation that was read has the coordinates c = U'd; the true one lies within w of it. Of each coordinate

    a = sign(c) min(|c|, 2 max(|c| - w, 0))

is taken for the stage's: the most that leaves the stage no worse than it was, |d - a| <= |d|, whatever the sensor is within its budget. The
rest is left to the sensor. Outside the span the reading is believed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ctrlgen.budget.sensor_statement import SensorStatement
from ctrlgen.core.units import show_difference
from ctrlgen.learning.implied_pose import ImpliedPose
from ctrlgen.learning.learning_options import LearningOptions
from ctrlgen.learning.lifted import Lifted

ASSUMED = "assumed: nothing is stated"


@dataclass(frozen=True)
class Feigned:
    """One thing that may be wrong with the sensor: its standard deviation in words, where that comes from, and the deviation (n, n_y)
    [SI] of the reading that one standard deviation of it makes along the path."""

    name: str
    sd: str
    source: str
    deviation: np.ndarray


@dataclass(frozen=True)
class SensorBudget:
    """What the sensor may feign: `lines`, each to `coverage` standard deviations, and the typical size `scale` (n_y,) of its channels."""

    lines: tuple[Feigned, ...]
    coverage: float
    scale: np.ndarray

    def may_feign(self) -> np.ndarray:
        """(n, n_y) [SI] the largest deviation that is the sensor's at each sample, all lines together: root of the sum of squares."""
        return self.coverage * np.sqrt(sum(line.deviation**2 for line in self.lines))

    def of_sensor(self, deviation: np.ndarray) -> np.ndarray:
        """(n, n_y) [SI] what of a `deviation` that was read is left to the sensor."""
        columns = [line.deviation / self.scale for line in self.lines if line.deviation.any()]
        if not columns:
            return np.zeros(deviation.shape)
        G = self.coverage * np.stack([column.ravel() for column in columns], axis=1)
        U, w, _ = np.linalg.svd(G, full_matrices=False)
        c = U.T @ (deviation / self.scale).ravel()
        believed = np.sign(c) * np.minimum(np.abs(c), 2 * np.maximum(np.abs(c) - w, 0.0))
        return (U @ (c - believed)).reshape(deviation.shape) * self.scale


def sensor_budget(
    lifted: Lifted, implied: ImpliedPose, stated: SensorStatement, observed: np.ndarray, options: LearningOptions
) -> SensorBudget:
    """What the sensor of a run of the path may feign in the channels that were `observed` (n_y,): numbers of its laws by the device file,
    scale, zero and clock as `stated`, or, where nothing is, as `options` assume."""
    drive, signal = lifted.solution.drive, lifted.signal
    y = lifted.run(drive) * observed
    lines = list[Feigned]()
    with_scale = set[int]()
    for number, deviation in zip(implied.numbers, implied.deviations(drive), strict=True):
        with_scale |= set(number.channels)
        name = f"{number.path} ({number.kind})"
        sd = show_difference(number.sd, number.unit, 3)
        lines.append(Feigned(name, sd, "the device file", deviation * observed))
    for i, channel in enumerate(signal.channels):
        unit = np.where(np.arange(len(signal.channels)) == i, 1.0, 0.0)
        scale = stated.scale
        if observed[i] and not (scale is None and i in with_scale):
            share = options.sensor_scale if scale is None else scale.sd
            source = ASSUMED if scale is None else scale.source
            if share:
                lines.append(Feigned(f"scale of {channel}", f"{100 * share:.3g} %", source, share * y * unit))
        zero = stated.zero.get(channel)
        if observed[i] and zero is not None:
            lines.append(Feigned(f"zero of {channel}", zero.text, zero.source, zero.sd * np.ones(y.shape) * unit))
    clock = _clock(lifted, stated, options)
    if clock is not None:
        seconds, text, source = clock
        lines.append(Feigned("clock", text, source, -seconds * rate_of(lifted, y)))
    return SensorBudget(tuple(lines), options.sensor_coverage, np.array(signal.scale))


def _clock(lifted: Lifted, stated: SensorStatement, options: LearningOptions) -> tuple[float, str, str] | None:
    """Standard deviation [s] of the moments of the readings, in words, and its source; None where no time passes, or it is zero."""
    if lifted.static:
        return None
    if stated.clock is not None:
        return stated.clock.sd, stated.clock.text, stated.clock.source
    share = options.sensor_clock
    return (share * lifted.sample_time, f"{share:g} samples", ASSUMED) if share else None


def rate_of(lifted: Lifted, y: np.ndarray) -> np.ndarray:
    """(n, n_y) [SI/s] by central differences: how fast a signal (n, n_y) along the path changes."""
    if lifted.closed:
        return (np.roll(y, -1, axis=0) - np.roll(y, 1, axis=0)) / (2 * lifted.sample_time)
    return np.gradient(y, lifted.sample_time, axis=0)
