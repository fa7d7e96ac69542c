"""S2 Appendix A: an eddy-current sensor calibrated against a Michelson interferometer, from simulated records.

The sensor's voltage is regressed on the distance that the fringes of the photodiode's signal tell.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import pi, sqrt

import numpy as np

from ctrlgen.physics.sensor_models import Interferometer, Sensor

CLUSTERS = 10  # of a recording, between which sensor noise counts as uncorrelated


@dataclass(frozen=True)
class CalibrationRun:
    """Voltages of sensor and photodiode, sampled together at `rate` [Hz] while the target moves in one direction."""

    sensor: np.ndarray
    photodiode: np.ndarray
    rate: float


@dataclass(frozen=True)
class Fringes:
    """Sample numbers `at` of the photodiode's extrema, in order, and the numbers of bright and dark ones."""

    at: np.ndarray
    bright: int
    dark: int

    def distance(self, wavelength: float) -> float:
        """S2 eq. (A.1): (m + n - 1) lambda/4, from the first to the last extremum [m]."""
        return (self.bright + self.dark - 1) * wavelength / 4


@dataclass(frozen=True)
class Slope:
    """Sensitivity of one recording [m/V], its standard uncertainty, and the rms of the fit's residual [V]."""

    sensitivity: float
    sd: float
    residual: float


@dataclass(frozen=True)
class SensitivityStatistics:
    """Statistics of repeated recordings as in S2 Table A.1. Sensitivities in m/V."""

    slopes: tuple[Slope, ...]

    @property
    def mean(self) -> float:
        """Mean sensitivity."""
        return float(np.mean([s.sensitivity for s in self.slopes]))

    @property
    def sd(self) -> float:
        """Standard deviation of the sensitivity of one recording, with N - 1."""
        return float(np.std([s.sensitivity for s in self.slopes], ddof=1))

    @property
    def sd_of_mean(self) -> float:
        """Standard uncertainty of `mean`, sd/sqrt(N). S2 does not print it."""
        return self.sd / sqrt(len(self.slopes))

    @property
    def max_deviation(self) -> float:
        """S2 eq. (A.3), as a fraction."""
        return max_deviation(self.mean, self.sd)


def max_deviation(mean: float, sd: float) -> float:
    """S2 eq. (A.3): 2 sigma/mean. Two standard deviations of single recordings: one in twenty lies beyond."""
    return 2 * sd / mean


def move(distance: float, speed: float, rate: float) -> np.ndarray:
    """Displacement of the motorised stage at constant speed, sampled [m]."""
    return np.arange(0, round(distance / speed * rate) + 1) * speed / rate


def record(
    sensor: Sensor,
    interferometer: Interferometer,
    distance: float,
    speed: float,
    rng: np.random.Generator,
    temperature: float | None = None,
) -> CalibrationRun:
    """One calibration run: the target moves `distance` [m] at `speed` [m/s] away from the sensor."""
    d = move(distance, speed, sensor.adc.rate)
    phase = replace(interferometer, phase=rng.uniform(0, 2 * pi))
    return CalibrationRun(sensor.read(d, rng, temperature), phase.read(d, rng, sensor.adc), sensor.adc.rate)


def find_fringes(photodiode: np.ndarray) -> Fringes:
    """Extrema of the fringe signal, each midway between two crossings of the mid level.

    A crossing counts once the signal has passed the level by a quarter of its amplitude, so that noise makes no fringe.
    The signal does not tell the direction of motion. Raises ValueError where fewer than three extrema are found.
    """
    low, high = np.percentile(photodiode, [2, 98])
    middle, margin = (low + high) / 2, (high - low) / 8
    state = np.where(photodiode > middle + margin, 1, np.where(photodiode < middle - margin, -1, 0))
    decided = np.flatnonzero(state)
    flips = np.flatnonzero(np.diff(state[decided])) if decided.size else np.array([], dtype=int)
    crossings = []
    for last, first in zip(decided[flips], decided[flips + 1], strict=True):
        between = np.arange(last, first + 1)
        # A straight line through the steep part: noise averages, and the crossing falls between samples.
        slope, level = np.polyfit(between - last, photodiode[between] - middle, 1)
        crossings.append(last + np.clip(-level / slope, 0, first - last))
    if len(crossings) < 4:
        raise ValueError(
            f"{len(crossings)} half fringes in the photodiode's signal are too few, 4 are needed; "
            "move the mirror by at least two wavelengths"
        )
    at = (np.array(crossings[1:]) + np.array(crossings[:-1])) / 2
    signs = state[decided[flips + 1]][:-1]
    return Fringes(at, int(np.sum(signs > 0)), int(np.sum(signs < 0)))


def calibrate_sensor(recording: CalibrationRun, wavelength: float) -> Slope:
    """Sensitivity from one recording: sensor voltage at each extremum against the distance counted in fringes.

    Voltage is regressed on distance, because the voltage is the noisy one. The uncertainty is cluster-robust: residuals
    may be correlated within 1/CLUSTERS of the recording, because sensor noise is slow. A recording must last a hundred
    correlation times of that noise: one of three seconds underestimates the uncertainty by half.
    """
    fringes = find_fringes(recording.photodiode)
    d = np.arange(fringes.at.size) * wavelength / 4
    edges = (fringes.at[1:] + fringes.at[:-1]) / 2
    # The voltage at an extremum is the mean over the samples around it: between fringes the motion is nearly linear.
    sums = np.concatenate([[0.0], np.cumsum(recording.sensor)])
    first, last = np.ceil(edges[:-1]).astype(int), np.ceil(edges[1:]).astype(int)
    volts = (sums[last] - sums[first]) / (last - first)
    centre = (first + last - 1) / 2
    d = np.interp(centre, fringes.at, d)
    x = d - d.mean()
    slope = float(x @ volts / (x @ x))
    residual = volts - volts.mean() - slope * x
    parts = np.array_split(x * residual, CLUSTERS)
    spread = sqrt(sum(float(part.sum()) ** 2 for part in parts) * CLUSTERS / (CLUSTERS - 2)) / float(x @ x)
    sensitivity = 1 / slope
    return Slope(sensitivity, spread * sensitivity**2, float(np.sqrt(residual @ residual / (residual.size - 2))))


def sensitivity_statistics(recordings: Sequence[CalibrationRun], wavelength: float) -> SensitivityStatistics:
    """Statistics over repeated recordings. Raises ValueError for fewer than two."""
    if len(recordings) < 2:
        raise ValueError("a standard deviation needs at least two recordings")
    return SensitivityStatistics(tuple(calibrate_sensor(recording, wavelength) for recording in recordings))
