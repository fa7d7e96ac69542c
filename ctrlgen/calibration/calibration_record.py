"""What constants.json holds of a calibration, key by key."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from ctrlgen.budget.error_budget import ErrorBudget
from ctrlgen.calibration.calibrate import CalibratedConstant, Calibration, ReadingError
from ctrlgen.calibration.constants_files import device_hash
from ctrlgen.core.units import difference, from_si
from ctrlgen.reporting.result_file import Keys, Number, Origin, origin

Budgets = tuple[ErrorBudget, ErrorBudget] | None  # before and after


class ConstantEntry(Keys):
    """One constant of the specimen."""

    name: str = Field(description="Name in the C structure.")
    path: str = Field(description="Path of the number in the device file.")
    unit: str = Field(description="Unit of every number of this entry but those in SI.")
    value: float = Field(description="Value for this specimen.")
    value_si: float = Field(description="The same in SI, as constants.h has it.")
    interval95: tuple[float, float] = Field(
        description="95 % interval within the bounds; the bounds where not determined."
    )
    sd_si: float = Field(
        description="Standard deviation in SI; of a constant that is not determined that of its bounds."
    )
    default: float = Field(description="Value in the device file.")
    bounds: tuple[float, float] = Field(description="Between which the controller accepts it.")
    determined: bool = Field(description="Whether the recording determines it; else value is the default.")
    remark: str = Field(description="Why it is not determined, or that it lies at a bound; empty otherwise.")


class ChannelEntry(Keys):
    """Error of the model at one channel on held-out records."""

    channel: str = Field(description="Name of the channel.")
    unit: str = Field(description="Unit of the three numbers.")
    before: float = Field(description="Root mean square with the numbers of the device file.")
    after: float = Field(description="The same with the constants of this specimen.")
    noise: float = Field(description="Standard deviation of the channel's noise.")


class PathEntry(Keys):
    """What the constants do to the error budget of the scenario, for one kind of unit."""

    group: str = Field(description="translation, rotation, or 'in' a unit of another kind.")
    unit: str = Field(description="Unit of the two numbers.")
    before: float = Field(
        description="Largest combined standard uncertainty along the path with the constants known by their bounds."
    )
    after: float = Field(description="The same with the constants of this specimen.")


class CalibrationRecord(Origin):
    """Result of `ctrlgen calibrate`: the run-time constants of one specimen."""

    device: str = Field(description="Name of the device.")
    device_hash: str = Field(
        description="First 32 bits of the SHA-256 of its description, hexadecimal, as in the C header."
    )
    recording: str = Field(description="Title of the recording.")
    constants: list[ConstantEntry] = Field(description="In the order of the C structure.")
    correlation: list[list[Number]] = Field(description="Coefficients of correlation of their deviations.")
    channels: list[ChannelEntry] = Field(description="One entry an observed channel.")
    scenario: str | None = Field(description="Scenario of the budgets; null without --scenario.")
    budget: list[PathEntry] = Field(description="One entry a kind of unit; empty without --scenario.")


def calibration_record(calibration: Calibration, budgets: Budgets = None) -> CalibrationRecord:
    """Plain numbers in the stated units; of a scenario where there are `budgets`."""
    inputs = {name: read.sha256 for name, read in calibration.inputs.items()}
    if budgets is not None:
        inputs |= budgets[0].solution.scenario.digest
    sds = np.sqrt(np.diag(calibration.covariance))
    return CalibrationRecord(
        **origin(inputs, None, calibration.notes),
        device=calibration.device.name,
        device_hash=f"{device_hash(calibration):08x}",
        recording=calibration.recording.title,
        constants=[_constant(row) for row in calibration.constants],
        correlation=(calibration.covariance / np.outer(sds, sds)).tolist(),
        channels=[_channel(error) for error in calibration.errors],
        scenario=None if budgets is None else budgets[0].solution.scenario.name,
        budget=[] if budgets is None else _path(*budgets),
    )


def _constant(row: CalibratedConstant) -> ConstantEntry:
    c = row.constant

    def shown(si: float) -> float:
        return float(from_si(si, c.unit))

    return ConstantEntry(
        name=c.name,
        path=c.path,
        unit=c.unit,
        value=shown(row.value),
        value_si=row.value,
        interval95=(shown(row.interval[0]), shown(row.interval[1])),
        sd_si=row.sd,
        default=shown(c.default),
        bounds=(shown(c.low), shown(c.high)),
        determined=row.determined,
        remark=row.remark,
    )


def _channel(error: ReadingError) -> ChannelEntry:
    before, after, noise = (float(difference(v, error.unit)) for v in (error.before, error.after, error.noise))
    return ChannelEntry(channel=error.channel, unit=error.unit, before=before, after=after, noise=noise)


def _path(before: ErrorBudget, after: ErrorBudget) -> list[PathEntry]:
    return [
        PathEntry(group=g.name, unit=g.unit, before=g.shown(before.peak(g)), after=g.shown(after.peak(g)))
        for g in before.groups
    ]
