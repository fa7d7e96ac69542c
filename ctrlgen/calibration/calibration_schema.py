"""What constants.json holds, key by key; `ctrlgen/reporting/schemas/constants.schema.json` is written from it."""

from __future__ import annotations

from pydantic import Field

from ctrlgen.reporting.result_file import Keys, Number, Origin


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
