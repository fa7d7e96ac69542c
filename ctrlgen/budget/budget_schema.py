"""What budget.json holds, key by key; `ctrlgen/reporting/schemas/budget.schema.json` is written from it."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from ctrlgen.reporting.result_file import ChannelGroup, Keys, Number, Origin


class GroupEntry(ChannelGroup):
    """Channels of the followed signal with one kind of unit, and what all contributors make of them together."""

    combined_peak: float = Field(description="Largest combined standard uncertainty of a channel along the path.")
    combined_rms: float = Field(description="Root mean square along the path, of the channel with the largest.")
    band95: float = Field(
        description="Half width of the 95 % band where it is widest: coverage_factor times combined_peak."
    )


class ByGroup(Keys):
    """Effect of one contributor on one group, in the unit of the group."""

    group: str = Field(description="Name of the group.")
    sensitivity: float = Field(
        description="Largest deviation of a channel along the path for one step `per` of the contributor."
    )
    peak: float = Field(description="Largest standard uncertainty that it causes in a channel along the path.")
    rms: float = Field(description="Root mean square along the path, of the channel with the largest.")
    combined_if_halved: float = Field(
        description="Largest combined standard uncertainty if its sd and those of all ranks before were half."
    )
    second_order: Number = Field(
        description="What the second order of its own adds at one standard deviation; null without draws."
    )


class ContributorEntry(Keys):
    """One line of the budget."""

    rank: int = Field(description="1 for what to measure or tighten next.")
    name: str = Field(description="Path of the number, surroundings, or drive.gain, drive.converter and so on.")
    called: str = Field(description="The same with the name, or kind, of its table where that stands in a list.")
    sd: str = Field(description="Stated standard deviation.")
    source: str = Field(description="Where it comes from.")
    per: str = Field(description="Step for which the sensitivity is given: 1 K, 1 %, 1 LSB.")
    share: float = Field(
        description="By how much the variance, its mean along the path over all channels of a group, falls without it; of the group "
        "in which it counts most."
    )
    effects: list[ByGroup] = Field(description="One entry a group.")


class DifferenceByGroup(Keys):
    """How far a finer model moves from the described one in one group, in the unit of the group."""

    group: str = Field(description="Name of the group.")
    peak: float = Field(description="Largest deviation of a channel along the path, without its sign.")
    rms: float = Field(description="Root mean square along the path, of the channel with the largest.")


class ModelDifferenceEntry(Keys):
    """The same drives on a finer model of the device: known with its sign, and not combined with what is uncertain."""

    kind: Literal["model difference"] = Field(description="Sets it apart from the contributors.")
    device: str = Field(description="Name of the finer model.")
    effects: list[DifferenceByGroup] = Field(description="One entry a group.")
    deviation: dict[str, list[float]] = Field(
        description="Finer model minus described one at every sample, signed, by 'channel [unit]', in the unit of its group."
    )


class AgreementEntry(Keys):
    """First order (GUM) against Monte Carlo on the nonlinear model (GUM supplement 1), for one group."""

    group: str = Field(description="Name of the group.")
    linear: float = Field(description="Largest combined standard uncertainty to first order, at the compared samples.")
    drawn: float = Field(description="Largest standard deviation of the draws.")
    difference: float = Field(description="Largest relative difference of the standard deviation along the path.")
    difference_of_interval: float = Field(
        description="Largest relative difference of the half width of the 95 % interval."
    )
    mean: float = Field(description="Largest mean deviation of the draws.")
    tolerance: float = Field(description="Difference within which both agree.")
    passed: bool = Field(description="Whether they do.")


class SafetyEntry(Keys):
    """One bound of a limit where it is least safe along the path."""

    limit: str = Field(description="Name of the limit.")
    label: str = Field(description="The limited quantity in words.")
    channel: str = Field(description="Channel that is least safe.")
    side: Literal["lower", "upper"] = Field(description="Which bound.")
    sample: int = Field(description="Sample at which it is.")
    time_s: Number = Field(description="Time of that sample [s]; null for settled poses.")
    unit: str = Field(description="Unit of the bound.")
    bound: float = Field(description="The bound.")
    margin_unit: str = Field(description="Unit of the three margins and of sd; K for a temperature.")
    margin: float = Field(description="Margin of the device as described.")
    sd: float = Field(description="Its standard uncertainty.")
    margin_at_probability: float = Field(
        description="What is left of the margin at the chosen probability; negative where it is not kept."
    )
    margin_drawn: Number = Field(description="The same by the draws; null where they are too few.")
    probability: float = Field(description="Probability with which the bound is kept at that sample, to first order.")
    kept: bool = Field(description="Whether the bound is kept at the chosen probability.")


class BudgetRecord(Origin):
    """Result of `ctrlgen budget`: what everything uncertain does to the pose along a path, and to its limits."""

    scenario: str = Field(description="Name of the scenario.")
    title: str = Field(description="Title of the scenario file.")
    device: str = Field(description="Name of the device.")
    signal: str = Field(description="The followed signal.")
    samples: int = Field(description="Samples of the path.")
    coverage_factor: float = Field(description="k of the 95 % band.")
    groups: list[GroupEntry] = Field(description="Translations, rotations, channels of other units.")
    contributors: list[ContributorEntry] = Field(description="In the order of what to measure or tighten next.")
    model_difference: ModelDifferenceEntry | None = Field(description="Of a finer model; null where none is given.")
    draws: int = Field(description="Draws of the Monte Carlo; 0 where it was left out.")
    agreement: list[AgreementEntry] = Field(description="One entry a group; empty without draws.")
    reasons: list[str] = Field(description="Why first order and draws differ; empty where they agree.")
    probability: float = Field(description="Probability at which limits are judged, at each sample.")
    limits: list[SafetyEntry] = Field(description="One entry a bound.")
    broken: Number = Field(
        description="Share of the draws that break a limit anywhere on the path; null without draws."
    )
    band: dict[str, list[float]] = Field(
        description="Combined standard uncertainty at every sample, by 'channel [unit]', in the unit of its group."
    )
