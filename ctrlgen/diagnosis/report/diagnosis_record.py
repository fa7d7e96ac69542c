"""What diagnosis.json holds, key by key; `ctrlgen/reporting/schemas/diagnosis.schema.json` is written from it.

What the analyses state stands with them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field, WithJsonSchema

from ctrlgen.diagnosis.evidence.detectability import DetectabilityEntry
from ctrlgen.diagnosis.evidence.diagnosis_result import Diagnosis
from ctrlgen.diagnosis.evidence.experiment_design import NextExperimentEntry
from ctrlgen.diagnosis.evidence.residual_location import ResidualLocations
from ctrlgen.diagnosis.report.answer import notes_of, sentence
from ctrlgen.diagnosis.report.narrative import implausible_notes
from ctrlgen.diagnosis.report.shares_sentences import noise_of, shares_sentences
from ctrlgen.diagnosis.selection.attribution import ShareEntry
from ctrlgen.diagnosis.selection.cause_entry import Cause
from ctrlgen.diagnosis.selection.finding_region import RegionEntry
from ctrlgen.diagnosis.selection.findings import ChanceEntry, ChannelErrorEntry, Finding, Role, SupportEntry, WorthEntry
from ctrlgen.diagnosis.selection.precedence import why_alike
from ctrlgen.diagnosis.selection.search_history import RoundEntry, search_history
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.diagnosis.shares.shares_record import FractionEntry, SharesEntry, table_record
from ctrlgen.reporting.result_file import Keys, Number, Origin, origin

# 95 %
Interval = tuple[Number, Number]


class EstimateEntry(Keys):
    """A number with its 95 % interval."""

    value: Number = Field(description="Estimate.")
    ci95: Interval = Field(
        description="95 % interval, which holds what one more of the laws still suspected would move the number by; both ends equal "
        "the value where it was not estimated but read from the data."
    )
    unit: str = Field(description="Unit of value and interval; 1 without one.")


class AttributionEntry(Keys):
    """How much of the mismatch the findings take away together."""

    explained: Number = Field(description="Share of the mismatch that all findings take away, of energy.")
    rest: ShareEntry | None = Field(description="Share that is left; null where there is no mismatch to share.")
    left: dict[str, Number] = Field(
        description="Share of the mismatch of each channel that is left; channels that show none are left out."
    )
    held_out: bool = Field(description="Whether the shares are of the held-out records, else of those to fit.")


class AlternativeEntry(Cause):
    """Another cause that explains the recording equally well."""

    reason: str = Field(description="Why both explain it alike, and what would tell them apart.")


class FindingEntry(Cause):
    """One cause that the device file leaves out."""

    role: Annotated[Role, WithJsonSchema({"enum": list(Role), "type": "string"})] = Field(
        description="cause; minor: above the noise and below a hundredth of the mismatch; part: it takes away nothing itself, and the "
        "cause that it serves needs it; unseen: only the records to fit can show it."
    )
    serves: Cause | None = Field(description="The cause that needs it, where its role is part.")
    share: ShareEntry | None = Field(
        description="Share of the mismatch that it takes away, from its Shapley value; null where it was read from the data, or may "
        "be zero."
    )
    support: SupportEntry | None = Field(
        description="What the model-free shares say of it; null where they say nothing of its family."
    )
    chance: ChanceEntry | None = Field(description="Chance that luck found it; null where it was read from the data.")
    worth: dict[str, WorthEntry] = Field(description="What it is worth, by channel.")
    parameters: dict[str, EstimateEntry] = Field(description="Parameters of the effect, by name.")
    region: RegionEntry | None = Field(description="Where it acts; null where it acts everywhere.")
    terms: list[dict[str, EstimateEntry]] = Field(
        description="Parameters of further terms of the same law at the same place, such as harmonics."
    )
    in_each_record: dict[str, EstimateEntry] = Field(
        description="What it is in each record, by the record's name, where it is another one there, such as the zero of a sensor."
    )
    size_untold: bool = Field(
        description="Whether the intervals of all its sizes hold that at which it is off: something acts there, which need not be this."
    )
    alternatives: list[AlternativeEntry] = Field(
        description="Other causes that explain the recording equally well in its place."
    )
    source: str = Field(description="Publication of the effect's law.")


class SpikesEntry(Keys):
    """Isolated outliers of one channel: faults of its sensor, which count for nothing else."""

    count: int = Field(description="How many.")
    samples: int = Field(description="Among so many samples.")
    per_thousand: Number = Field(description="In a thousand samples.")
    size: Number = Field(description="Median magnitude [unit].")
    unit: str = Field(description="Unit of size.")
    in_noise: Number = Field(description="Size in standard deviations of the noise; null where that is not known.")


class EmpiricalTermEntry(Keys):
    """A smoother of what no law reaches, as an effect in device.next.toml; it names no cause."""

    effect: str = Field(description="Name of the effect: empirical_position, empirical_speed or empirical_history.")
    at: str = Field(description="Component of the pose to which it is added.")
    of: str = Field(description="Axis of whose motion it is a function.")
    channel: str = Field(description="Reading that it corrects.")
    function_of: str = Field(description="Kind of the model-free shares that it holds.")
    share: float = Field(description="Of the energy left in the channel on the held-out records what it takes away.")
    rms_before: float = Field(description="Error there without it [unit].")
    rms_after: float = Field(description="Error there with it [unit].")
    unit: str = Field(description="Unit of the errors.")


class DiagnosisRecord(Origin):
    """Result of `ctrlgen diagnose`: what a recording shows that the device file leaves out."""

    verdict: Annotated[Verdict, WithJsonSchema({"enum": list(Verdict), "type": "string"})] = Field(
        title="Verdict", description="The answer in one word."
    )
    sentence: str = Field(description="The answer in a sentence: cause, size, share, what is left.")
    implausible: list[str] = Field(
        description="What of the recording cannot be of the device as it is stated: a unit, a rate."
    )
    findings: list[FindingEntry] = Field(
        description="Causes that the device file leaves out, the most important first."
    )
    attribution: AttributionEntry = Field(description="What the findings take away together, and the rest.")
    shares: SharesEntry | None = Field(
        description="How much of the residual is a function of what; null where the records are too short."
    )
    empirical_terms: list[EmpiricalTermEntry] = Field(description="What device.next.toml holds beside the findings.")
    residual_location: ResidualLocations = Field(description="Where the residual is large, before and after.")
    held_out: dict[str, ChannelErrorEntry] = Field(description="Errors on the held-out records, by channel.")
    spikes: dict[str, SpikesEntry] = Field(
        description="Isolated outliers by channel; channels without any are left out."
    )
    detectability: DetectabilityEntry = Field(description="What this recording could have shown besides.")
    next_experiment: NextExperimentEntry | None = Field(description="Null where no drive would decide anything.")
    search_history: list[RoundEntry] = Field(description="Rounds of the search.")


@dataclass(frozen=True)
class Provenance:
    """What a diagnosis was made from: SHA-256 of its input files by name, and the seed."""

    inputs: dict[str, str]
    seed: int


def diagnosis_record(diagnosis: Diagnosis, provenance: Provenance) -> DiagnosisRecord:
    """What diagnosis.json holds: nothing that changes from run to run."""
    d = diagnosis
    return DiagnosisRecord(
        **origin(provenance.inputs, provenance.seed, notes_of(d)),
        verdict=d.verdict,
        sentence=sentence(d),
        implausible=implausible_notes(d),
        findings=[_finding_entry(f) for f in d.findings],
        attribution=AttributionEntry(
            explained=d.attribution.explained,
            rest=d.attribution.rest,
            left={channel: shares[-1] for channel, shares in d.attribution.channels.items()},
            held_out=d.attribution.held_out,
        ),
        shares=shares_record(d),
        empirical_terms=[
            EmpiricalTermEntry(
                effect=t.effect.kind,
                at=t.effect.at,
                of=t.effect.of or "",
                channel=t.channel,
                function_of=t.kind.value,
                share=t.share,
                rms_before=t.rms_before,
                rms_after=t.rms_after,
                unit=t.unit,
            )
            for t in d.empirical_terms
        ],
        residual_location=location_record(d),
        held_out=d.held_out,
        spikes={s.channel: SpikesEntry.model_validate(s, from_attributes=True) for s in d.spikes},
        detectability=d.detectability,
        next_experiment=None if d.next_experiment is None else d.next_experiment.record(),
        search_history=search_history(d.search),
    )


def _finding_entry(finding: Finding) -> FindingEntry:
    """A finding with the reason of each alternative."""
    given = {name: getattr(finding, name) for name in FindingEntry.model_fields}
    given["alternatives"] = [
        AlternativeEntry(
            effect=other.effect, location=other.location, of=other.of, reason=why_alike(finding.cause, other)
        )
        for other in finding.alternatives
    ]
    return FindingEntry.model_validate(given, from_attributes=True)


def location_record(diagnosis: Diagnosis) -> ResidualLocations:
    """Where the residual is; with what the unknown input depends on that would explain what is left, where there is one."""
    location, force = diagnosis.residual_location, diagnosis.unmodelled_force
    if force is None:
        return location
    after = location.after.model_copy(update={"unmodelled_force": force.record()})
    return ResidualLocations(before=location.before, after=after)


def shares_record(diagnosis: Diagnosis) -> SharesEntry | None:
    """The model-free shares before and after, in the recording's units, with the families of laws and what follows."""
    shares, recording = diagnosis.shares, diagnosis.recording
    if shares is None:
        return None
    units, noise = dict(zip(recording.channels, recording.units, strict=True)), noise_of(diagnosis)
    reached = {c.channel: shares.reached(c.channel) for c in shares.before.channels}
    return SharesEntry(
        statements=shares_sentences(diagnosis),
        reached={channel: FractionEntry(value=r.share, ci95=r.ci95) for channel, r in reached.items()},
        before=table_record(shares.before, units, noise),
        after=table_record(shares.after, units, noise),
    )
