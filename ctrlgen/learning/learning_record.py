"""What learning.json holds of the runs of a path and of the next one, key by key."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from ctrlgen.budget.contributors import Group
from ctrlgen.core.units import difference, from_si
from ctrlgen.learning.learn import Learning
from ctrlgen.learning.run_errors import RunResult
from ctrlgen.reporting.result_file import ChannelGroup, Keys, Number, Origin, origin


class RunError(Keys):
    """The error of one run in one group: root mean square length along the path, in the unit of the group."""

    group: str = Field(description="Name of the group.")
    measured: float = Field(description="Of the mean over all repetitions.")
    noise: float = Field(description="Of the standard error of that mean.")
    repeating: float = Field(description="What of the measured error repeats: measured^2 = repeating^2 + noise^2.")
    repeating_least: float = Field(description="Lower end of its 95 % interval.")
    repeating_most: float = Field(description="Upper end of its 95 % interval.")
    predicted: Number = Field(description="What was predicted of it from the runs before; null for the first run.")


class RunEntry(Keys):
    """One run: the same drives, as often as they were repeated."""

    name: str = Field(description="The records that it was read from.")
    repetitions: int = Field(description="How often it was repeated.")
    best: bool = Field(description="Whether it is the one that is gone on from.")
    errors: list[RunError] = Field(description="One entry a group.")


class ActuatorEntry(Keys):
    """How one actuator answered from run to run."""

    drive: str = Field(description="Its channel.")
    gain: Number = Field(
        description="Observed change of the signal over the predicted one; null where it did not move."
    )
    standard_error: Number = Field(description="Of the gain.")


class PredictedEntry(Keys):
    """What the next run will show in one group."""

    group: str = Field(description="Name of the group.")
    repeating: float = Field(description="Predicted root mean square length of the error that repeats.")


class SensorEntry(Keys):
    """One thing that may be wrong with the sensor."""

    name: str = Field(description="What it is.")
    sd: str = Field(description="Its standard deviation.")
    source: str = Field(description="Where that comes from.")


class SensorError(Keys):
    """What the sensor may feign in one group: root mean square length along the path, in the unit of the group."""

    group: str = Field(description="Name of the group.")
    may_feign: float = Field(description="All lines together, to the coverage of the budget.")
    left: float = Field(description="What of the readings is left to the sensor and not corrected.")


class LearningRecord(Origin):
    """Result of `ctrlgen learn`: the runs so far, and the drives of the next one."""

    scenario: str = Field(description="Name of the scenario.")
    title: str = Field(description="Title of the scenario file.")
    device: str = Field(description="Name of the device.")
    signal: str = Field(description="The followed signal.")
    not_read: list[str] = Field(description="Channels without a reading: the model alone keeps them on the path.")
    groups: list[ChannelGroup] = Field(description="Translations, rotations, channels of other units.")
    runs: list[RunEntry] = Field(description="All runs in their order.")
    actuators: list[ActuatorEntry] = Field(description="One entry a drive; empty with a single run.")
    unexplained: Number = Field(
        description="Share of the change from run to run that the device as described leaves unexplained; null with a single run."
    )
    stop: str = Field(description="Why there is nothing more to learn; empty where there is a next run.")
    step: float = Field(description="Share of the full step that is taken; lowered after runs that were worse.")
    predicted: list[PredictedEntry] = Field(description="One entry a group, of the next run.")
    sensor: list[SensorEntry] = Field(description="What may be wrong with the sensor.")
    sensor_errors: list[SensorError] = Field(description="One entry a group: what the sensor may feign of it.")
    largest_change: dict[str, float] = Field(
        description="Largest change of each drive from the best run to the next one, by 'channel [unit]'."
    )
    drives: dict[str, list[float]] = Field(description="The next drives at every sample, by 'channel [unit]'.")


def learning_record(learning: Learning) -> LearningRecord:
    """Plain numbers in the stated units; nothing that changes from call to call."""
    scenario, m, upcoming = learning.solution.scenario, learning.solution.model, learning.next.drive
    signal, drive = m.signals[scenario.file.follow], m.signals["drive"]
    change = np.abs(upcoming - learning.runs[learning.base].drive).max(axis=0)
    columns = [(f"{c} [{u}]", u) for c, u in zip(drive.channels, drive.units, strict=True)]
    answer = learning.response
    return LearningRecord(
        **origin(learning.inputs, None, learning.notes),
        scenario=scenario.name,
        title=scenario.file.title,
        device=m.name,
        signal=scenario.file.follow,
        not_read=[c for c, seen in zip(signal.channels, learning.observed, strict=True) if not seen],
        groups=[
            ChannelGroup(name=g.name, unit=g.unit, channels=[signal.channels[i] for i in g.channels])
            for g in learning.groups
        ],
        runs=[
            RunEntry(
                name=run.name,
                repetitions=run.repeats,
                best=k == learning.base,
                errors=[_error(run, g) for g in learning.groups],
            )
            for k, run in enumerate(learning.runs)
        ],
        actuators=[]
        if answer is None
        else [
            ActuatorEntry(drive=c, gain=_finite(gain), standard_error=_finite(se))
            for c, gain, se in zip(drive.channels, answer.gain, answer.se, strict=True)
        ],
        unexplained=None if answer is None else answer.unexplained,
        stop=learning.stop,
        step=learning.step,
        predicted=[
            PredictedEntry(group=g.name, repeating=g.shown(learning.predicted[g.name])) for g in learning.groups
        ],
        sensor=[SensorEntry(name=line.name, sd=line.sd, source=line.source) for line in learning.sensor.lines],
        sensor_errors=[
            SensorError(
                group=g.name,
                may_feign=g.shown(learning.of_group(learning.sensor.may_feign(), g)),
                left=g.shown(learning.of_group(learning.left_to_sensor, g)),
            )
            for g in learning.groups
        ],
        largest_change={name: float(difference(v, u)) for (name, u), v in zip(columns, change, strict=True)},
        drives={name: from_si(v, u).tolist() for (name, u), v in zip(columns, upcoming.T, strict=True)},
    )


def _error(run: RunResult, g: Group) -> RunError:
    return RunError(
        group=g.name,
        measured=g.shown(run.rms[g.name]),
        noise=g.shown(run.noise[g.name]),
        repeating=g.shown(run.repeating[g.name]),
        repeating_least=g.shown(run.least[g.name]),
        repeating_most=g.shown(run.most[g.name]),
        predicted=None if run.predicted is None else g.shown(run.predicted[g.name]),
    )


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
