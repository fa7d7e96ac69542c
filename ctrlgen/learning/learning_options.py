"""Options of `ctrlgen.learning.learn`: how far a step goes, and when there is nothing more to learn."""

from __future__ import annotations

from dataclasses import dataclass

from ctrlgen.devices.usual_deviation import ASSUMED_SCALE


@dataclass(frozen=True)
class LearningOptions:
    """How the next drives are chosen from the runs so far."""

    first_step: float = 0.2
    """Share of the largest drive by which the first step may change any. Judgement: what the device answers is not known yet."""
    mismatch: float = 0.1
    """Share of a change by which the device may answer otherwise than described, until runs have shown it. Judgement."""
    least_mismatch: float = 0.01
    """The least that is taken of what they show: so few runs know it no better. Judgement."""
    worse: float = 3.0
    """Standard errors by which a run must be worse than the best one for the step to be lowered: one-sided p = 0.1 %."""
    first_worth: float = 0.999
    """Share of the error below which the first run after the first is to be predicted. Its step is small on purpose and shows what the
    device answers, so that nearly any is worth running."""
    worth: float = 0.9
    """Share of the error below which a later run is to be predicted to be worth running. Judgement."""
    coverage_factor: float = 1.96
    """Half width of the two-sided 95 % interval of a normal variable, in standard deviations."""
    most_stalls: int = 3
    """Runs in a row without a better one after which no further is tried. The step is an eighth by then."""
    most_halvings: int = 6
    """Halvings of a step that would break a limit. Less than a sixty-fourth of a step shows nothing."""
    slow: float = 0.1
    """Share of the frequencies within which the error of a path is taken to lie where it is to be said how many repetitions tell it."""
    sensor_scale: float = ASSUMED_SCALE
    """Standard deviation of the scale of each channel that is read, where nothing is stated."""
    sensor_clock: float = 0.5
    """Standard deviation, in samples, of the moments of the readings against those of the drives, where nothing is stated: two of it are
    the sample by which a log is late that writes a reading beside the next drive."""
    sensor_coverage: float = 2.0
    """Standard deviations up to which an error is left to the sensor: 95 %."""
