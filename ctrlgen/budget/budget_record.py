"""What budget.json holds of an error budget, key by key."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from ctrlgen.budget.contributors import BudgetLine, Group
from ctrlgen.budget.error_budget import TOLERANCE, Agreement, ErrorBudget
from ctrlgen.budget.limits import Safety
from ctrlgen.core.to_digits import to_digits
from ctrlgen.core.units import difference, from_si, show, shown_difference_unit
from ctrlgen.reporting.result_file import ChannelGroup, Keys, Number, Origin, origin


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
    share: float = Field(
        description="By how much the variance of the group, its mean along the path over all its channels, falls without it; of "
        "contributors that are independent the shares of a group add up to 1."
    )
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


def budget_record(budget: ErrorBudget) -> BudgetRecord:
    """Plain numbers in the stated units; nothing that changes from run to run with one seed."""
    solution = budget.solution
    scenario, stated = solution.scenario, budget.uncertainties
    finer = {} if budget.model_difference is None else budget.model_difference.finer.inputs
    inputs = {**scenario.digest, **{name: read.sha256 for name, read in (*stated.inputs.items(), *finer.items())}}
    return BudgetRecord(
        **origin(inputs, budget.seed if budget.draws else None, budget.notes),
        scenario=scenario.name,
        title=scenario.file.title,
        device=solution.model.name,
        signal=scenario.file.follow,
        samples=len(solution.command),
        coverage_factor=budget.factor,
        groups=[_group(budget, g) for g in budget.groups],
        contributors=[_contributor(budget, line, rank) for rank, line in enumerate(budget.lines, 1)],
        model_difference=_model_difference(budget),
        draws=budget.draws,
        agreement=[_agreement(a) for a in budget.agreements],
        reasons=list(budget.reasons),
        probability=budget.probability,
        limits=[_safety(budget, s) for s in budget.safeties],
        broken=budget.broken,
        band=_by_channel(budget, budget.combined),
    )


def _group(budget: ErrorBudget, g: Group) -> GroupEntry:
    signal = budget.solution.model.signals[budget.solution.scenario.file.follow]
    return GroupEntry(
        name=g.name,
        unit=g.unit,
        channels=[signal.channels[i] for i in g.channels],
        combined_peak=g.shown(budget.peak(g)),
        combined_rms=g.shown(budget.rms(g)),
        band95=g.shown(budget.factor * budget.peak(g)),
    )


def _contributor(budget: ErrorBudget, line: BudgetLine, rank: int) -> ContributorEntry:
    effects = [
        ByGroup(
            group=g.name,
            sensitivity=g.shown(line.sensitivity[g.name]),
            peak=g.shown(line.peak[g.name]),
            rms=g.shown(line.rms[g.name]),
            share=line.shares[g.name],
            combined_if_halved=g.shown(line.halved[g.name]),
            second_order=g.shown(line.alone[g.name]) if budget.draws else None,
        )
        for g in budget.groups
    ]
    return ContributorEntry(
        rank=rank,
        name=line.name,
        called=line.called,
        sd=line.sd,
        source=line.source,
        per=line.per,
        share=line.share,
        effects=effects,
    )


def _model_difference(budget: ErrorBudget) -> ModelDifferenceEntry | None:
    """How the finer model moves; None without one."""
    if budget.model_difference is None:
        return None
    effects = [
        DifferenceByGroup(group=g.name, peak=g.shown(budget.difference_peak(g)), rms=g.shown(budget.difference_rms(g)))
        for g in budget.groups
    ]
    return ModelDifferenceEntry(
        kind="model difference",
        device=budget.model_difference.finer.model.name,
        effects=effects,
        deviation=_by_channel(budget, budget.model_difference.deviation),
    )


def _by_channel(budget: ErrorBudget, values: np.ndarray) -> dict[str, list[float]]:
    """'channel [unit]' -> its column of (n, channels) [SI], in the unit of its group."""
    channels = budget.solution.model.signals[budget.solution.scenario.file.follow].channels
    return {
        f"{channels[i]} [{g.unit}]": difference(values[:, i], g.unit).tolist()
        for g in budget.groups
        for i in g.channels
    }


def _agreement(a: Agreement) -> AgreementEntry:
    return AgreementEntry(
        group=a.group.name,
        linear=a.group.shown(a.linear),
        drawn=a.group.shown(a.drawn),
        difference=a.difference,
        difference_of_interval=a.difference_of_interval,
        mean=a.group.shown(a.mean),
        tolerance=TOLERANCE,
        passed=a.passed,
    )


def _safety(budget: ErrorBudget, s: Safety) -> SafetyEntry:
    unit, solution = s.limit.unit, budget.solution
    return SafetyEntry(
        limit=s.limit.name,
        label=s.limit.label,
        channel=s.channel,
        side=s.side,
        sample=s.sample,
        time_s=float(solution.trace.time[s.sample]) if solution.scenario.sample_time else None,
        unit=unit,
        bound=float(from_si(s.bound, unit)),
        margin_unit=shown_difference_unit(unit),
        margin=float(difference(s.margin, unit)),
        sd=float(difference(s.sd, unit)),
        margin_at_probability=float(difference(s.kept, unit)),
        margin_drawn=None if s.drawn is None else float(difference(s.drawn, unit)),
        probability=s.probability,
        kept=s.kept >= 0,
    )


def safety_sentence(s: Safety, probability: float) -> str:
    """Such as 'actuator temperature keeps ≤ 550 degC with 99.9 %: margin 3.1 K'."""
    unit, likely = s.limit.unit, f"{100 * probability:.10g} %"
    bound = f"{'≥' if s.side == 'lower' else '≤'} {show(s.bound, unit, 5)}"
    left = f"{to_digits(abs(difference(s.kept, unit)), 3)} {shown_difference_unit(unit)}"
    if s.kept >= 0:
        return f"{s.limit.label} keeps {bound} with {likely}: margin {left}"
    does = f"it does with {to_digits(100 * s.probability, 3)} %"
    return f"{s.limit.label} does not keep {bound} with {likely}: short by {left}; {does}"
