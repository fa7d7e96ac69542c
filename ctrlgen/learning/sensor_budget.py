"""What a sensor may feign of a motion, and how far an error that it read is believed to be the stage's.

A reading that is wrong by its scale, its zero or its clock shows an error that the stage does not have, and drives that take it away
spoil the true motion. With g_i what line i makes of the reading at its largest, the sensor's part of a deviation d is sum b_i g_i with
|b_i| <= 1, and what is taken for the stage's is the a nearest to d of those that leave the stage no worse than it was, |t - a| <= |t| for
every t = d - sum b_i g_i that may be true:

    min |d - a|  subject to  1/2 |a|^2 + sum_i |g_i . a| <= a . d

Its solution is d less the nearest sum of lines within nu, a = d - sum b_i g_i with |b_i| <= nu and the least nu in 0..1 that keeps the
condition. Of one line w = |g| that is a = min(|d|, 2 max(|d| - w, 0)). The rest is left to the sensor. Outside the span of the g_i the
reading is believed. No basis of that span enters: where lines are of one size, as the scales of a circle are, no basis is marked out.
"""

from __future__ import annotations

from dataclasses import dataclass
from sys import maxsize

import numpy as np
from scipy.optimize import brentq, lsq_linear

from ctrlgen.budget.sensor_statement import SensorStatement
from ctrlgen.core.to_digits import to_digits
from ctrlgen.core.units import show_difference
from ctrlgen.learning.implied_pose import ImpliedPose
from ctrlgen.learning.learning_options import LearningOptions
from ctrlgen.learning.lifted import Lifted

ASSUMED = "assumed: nothing is stated"
ROUNDING = 1e-12
"""Of a deviation, above what sums of some hundred samples round to."""


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
        Q, R = np.linalg.qr(self.coverage * np.stack([column.ravel() for column in columns], axis=1))
        d = Q.T @ (deviation / self.scale).ravel()
        return (Q @ (d - believed(d, R))).reshape(deviation.shape) * self.scale


def believed(d: np.ndarray, G: np.ndarray) -> np.ndarray:
    """(m,) what of a deviation `d` (m,) is the stage's for sure where columns of G (m, k), each times -1 to 1, may be the sensor's."""
    size = float(np.linalg.norm(d))
    return size * _of_one(d / size, G / size) if size else d


def _of_one(d: np.ndarray, G: np.ndarray) -> np.ndarray:
    """The same of a d of length one, by which the least squares stop."""

    def beyond(nu: float) -> np.ndarray:
        return d - nu * (G @ lsq_linear(nu * G, d, (-1, 1), method="bvls", max_iter=maxsize).x) if nu else d

    def worse(nu: float) -> float:
        """By how much the stage may be worse, times |a|; none where not above zero."""
        a = beyond(nu)
        return float(a @ a / 2 + np.abs(G.T @ a).sum() - a @ d)

    if worse(0.0) <= 0:
        return d
    if np.linalg.norm(beyond(1.0)) <= ROUNDING:  # all of it may be the sensor's
        return np.zeros(d.shape)
    return beyond(brentq(worse, 0.0, 1.0, xtol=ROUNDING))


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
                lines.append(Feigned(f"scale of {channel}", f"{to_digits(100 * share, 3)} %", source, share * y * unit))
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
