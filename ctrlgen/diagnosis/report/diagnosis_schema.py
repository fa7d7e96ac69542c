"""What diagnosis.json holds, key by key; `ctrlgen/reporting/schemas/diagnosis.schema.json` is written from it."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from ctrlgen.reporting.result_file import Keys, Number, Origin

Interval = tuple[Number, Number]  # 95 %
Verdict = Literal["consistent", "explained", "partly", "ambiguous", "unexplained"]


class EstimateEntry(Keys):
    """A number with its 95 % interval."""

    value: Number = Field(description="Estimate.")
    ci95: Interval = Field(
        description="95 % interval; both ends equal the value where it was not estimated but read from the data."
    )
    unit: str = Field(description="Unit of value and interval; 1 without one.")


class EffectAt(Keys):
    """An effect at a location."""

    effect: str = Field(description="Name of the effect, or 'parameter'.")
    location: str = Field(description="Place and channel, such as actuator:2X.")


class Cause(EffectAt):
    """An effect at a location, with its partner."""

    of: str | None = Field(description="The other channel of an effect between two; null for others.")


class ShareEntry(Keys):
    """A share of the mismatch."""

    value: Number = Field(description="Of the energy beyond the noise that the device as described leaves.")
    ci95: Interval = Field(description="95 % interval, by a bootstrap over blocks.")


class WorthEntry(Keys):
    """What a cause is worth in one channel, root mean square on the held-out records."""

    without: Number = Field(description="Error without the cause, the others refitted [unit].")
    with_it: Number = Field(description="Error with it [unit].")
    unit: str = Field(description="Unit of both.")


class AttributionEntry(Keys):
    """How much of the mismatch the findings take away together."""

    explained: Number = Field(description="Share of the mismatch that all findings take away, of energy.")
    rest: ShareEntry | None = Field(description="Share that is left; null where there is no mismatch to share.")
    held_out: bool = Field(description="Whether the shares are of the held-out records, else of those to fit.")


class FindingEntry(Cause):
    """One cause that the device file leaves out."""

    parameters: dict[str, EstimateEntry] = Field(description="Parameters of the effect, by name.")
    share: ShareEntry | None = Field(
        description="Share of the mismatch that it takes away: its Shapley value; null where it was read from the data."
    )
    worth: dict[str, WorthEntry] = Field(description="What it is worth, by channel.")
    alternatives: list[Cause] = Field(description="Other causes that explain the recording equally well in its place.")
    source: str = Field(description="Publication of the effect's law.")


class ChannelErrorEntry(Keys):
    """Root mean square error of one channel on the held-out records."""

    rms_before: Number = Field(description="Of the device as described, refitted within its stated uncertainty.")
    rms_after: Number = Field(description="With the findings.")
    noise_floor: Number = Field(description="Standard deviation of the noise; null where it is not known.")
    unit: str = Field(description="Unit of all four numbers.")
    uncertainty: Number = Field(
        description="Prediction uncertainty that the fitted parameters alone cause; null where it is not known."
    )


class FractionEntry(Keys):
    """A part of a residual's energy."""

    value: Number = Field(description="The share.")
    ci95: Interval = Field(description="95 % interval, by a bootstrap over blocks.")


class KindShareEntry(Keys):
    """What one kind of signal explains of a residual, in blocks that were not used."""

    kind: str = Field(description="Kind of signal.")
    share: Number = Field(description="Share of the energy that it explains alone, beside a constant.")
    ci95: Interval = Field(description="95 % interval of share.")
    additional: Number = Field(description="What it adds to the kinds selected before it, or beside them all.")
    selected: int | None = Field(description="Place in the forward selection from 1; null where it was not selected.")
    alike: list[str] = Field(description="Kinds that would have done as well in its place.")


class ChannelSharesEntry(Keys):
    """Of what the residual of one channel is a function."""

    rms: Number = Field(description="Root mean square of the residual [unit].")
    unit: str = Field(description="Unit of rms.")
    own_axes: list[str] = Field(description="Axes that the channel sees; others are other axes.")
    constant: Number = Field(description="Share of the mean.")
    numbers: Number = Field(description="Share that other values of the device's own free numbers would add.")
    kinds: list[KindShareEntry] = Field(description="By falling share, the residual's own past last.")
    total: Number = Field(
        description="All kinds, constant and numbers: the ceiling of any law that is a function of them."
    )
    total_ci95: Interval = Field(description="95 % interval of total.")
    rest: Number = Field(description="1 - total.")
    rest_own_past: Number = Field(description="What the residual's own past adds: memory without a name.")
    spikes: Number = Field(description="Share of samples left out as spikes.")
    periods: dict[str, Number] = Field(description="Period of a pitch [SI of the axis] and of a line [s].")


class FamilyShareEntry(Keys):
    """A family of laws."""

    family: str = Field(description="Its name.")
    share: Number = Field(description="Share that it could account for; a signal can speak for several families.")


class SharesTableEntry(Keys):
    """The model-free shares of one residual."""

    channels: dict[str, ChannelSharesEntry] = Field(description="By channel.")
    blocks: int = Field(description="Blocks of the cross-validation and of the intervals.")
    same_as: dict[str, str] = Field(description="Drives that are another signal, which stands for them.")
    families: list[FamilyShareEntry] = Field(
        description="Families of laws that could account for it, the largest first."
    )


class SharesEntry(Keys):
    """How much of a residual is a function of what, whatever the law."""

    statements: list[str] = Field(description="What follows, in sentences.")
    reached: dict[str, FractionEntry] = Field(
        description="Share of the residual before that the findings take away, by channel; total of before is its ceiling."
    )
    before: SharesTableEntry = Field(description="Of what the device as described leaves.")
    after: SharesTableEntry = Field(description="Of what the model with the findings leaves.")


class SpikesEntry(Keys):
    """Isolated outliers of one channel: faults of its sensor, which count for nothing else."""

    count: int = Field(description="How many.")
    samples: int = Field(description="Among so many samples.")
    per_thousand: Number = Field(description="In a thousand samples.")
    size: Number = Field(description="Median magnitude [unit].")
    unit: str = Field(description="Unit of size.")
    in_noise: Number = Field(description="Size in standard deviations of the noise; null where that is not known.")


class ResidualPartEntry(Keys):
    """The residual in one part of the recording."""

    label: str = Field(description="The part.")
    excess: Number = Field(description="Mean square of the whitened residual, less 1: 0 is noise alone.")
    ci95: Interval = Field(description="95 % interval of excess.")
    share: Number = Field(description="Share of the whole excess.")
    mean: Number = Field(description="Mean of the residual [unit].")
    mean_ci95: Interval = Field(description="95 % interval of mean.")
    unit: str = Field(description="Unit of mean.")
    n: int = Field(description="Samples.")


class FrequencyBandEntry(Keys):
    """The residual in one frequency band."""

    low: float = Field(description="Lower edge [Hz].")
    high: float = Field(description="Upper edge [Hz].")
    excess: Number = Field(description="Whitened power spectral density, less 1.")
    ci95: Interval = Field(description="95 % interval of excess.")
    coherence: Number = Field(description="Largest coherence of any reading's residual with any drive.")
    coherence_floor: Number = Field(description="Coherence that noise alone exceeds with 5 %.")


class CoordinatesEntry(Keys):
    """Whether the excess is sparser in the readings or in the actuators."""

    participation_ratio: dict[str, Number] = Field(
        description="Effective number of coordinates with excess, by 'reading' and 'actuator'."
    )
    explained_by_one: dict[str, dict[str, Number]] = Field(
        description="Share of the excess that each coordinate alone could explain."
    )
    located_in: str = Field(description="'reading', 'actuator', or why neither can be told.")


class SpectralLinesEntry(Keys):
    """Response of one reading to a periodic drive, by kind of spectral line, root mean square in unit."""

    record: str = Field(description="Name of the record.")
    channel: str = Field(description="The reading.")
    unit: str = Field(description="Unit of the four levels.")
    periods: int = Field(description="Periods averaged.")
    excited: Number = Field(description="At the lines of the drive.")
    odd: Number = Field(description="At odd harmonics that are not driven; null without any.")
    even: Number = Field(description="At even harmonics that are not driven; null without any.")
    noise: Number = Field(description="Noise in as many lines.")
    p_odd: Number = Field(description="p-value of the odd lines under noise alone.")
    p_even: Number = Field(description="p-value of the even lines under noise alone.")
    statement: str = Field(description="What follows.")


class UnmodelledForceEntry(Keys):
    """The unknown input (force or displacement) that would explain the residual after the correction."""

    statements: list[str] = Field(description="What it depends on.")


class ResidualLocationEntry(Keys):
    """Where the residual of one model is large."""

    excess: Number = Field(description="Mean square of the whitened residual over all readings, less 1.")
    by_reading: list[ResidualPartEntry] = Field(description="The residual of each reading.")
    by_actuator: list[ResidualPartEntry] = Field(description="The residual as an equivalent input at each axis.")
    coordinates: CoordinatesEntry = Field(description="Whether it is sparser in the readings or in the actuators.")
    by_frequency: list[FrequencyBandEntry] = Field(description="The residual by frequency band.")
    by_travel: dict[str, list[ResidualPartEntry]] = Field(description="Fifths of the travel, by axis.")
    by_direction: dict[str, list[ResidualPartEntry]] = Field(description="Forward and backward motion, by axis.")
    by_time: list[ResidualPartEntry] = Field(description="The residual by stretch of time.")
    by_temperature: list[ResidualPartEntry] = Field(
        description="The residual by temperature; empty where none is known."
    )
    spectral_lines: list[SpectralLinesEntry] = Field(description="Responses to periodic drives; empty without any.")
    statements: list[str] = Field(description="What follows, in sentences.")
    unmodelled_force: UnmodelledForceEntry | None = Field(
        default=None, description="In `after`, where the findings do not explain all."
    )


class ResidualLocations(Keys):
    """The residual on all records."""

    before: ResidualLocationEntry = Field(
        description="Of the device as described, refitted within its stated uncertainty."
    )
    after: ResidualLocationEntry = Field(description="With the findings.")


class SmallestDetectableEntry(EffectAt):
    """The smallest amplitude of one effect that this recording would have shown, at the location where it shows most."""

    amplitude: str = Field(description="Name of the amplitude parameter.")
    detectable_from: Number = Field(description="Smallest amplitude that exceeds the screen's threshold [unit].")
    identifiable_from: Number = Field(description="Smallest amplitude that would also have been named [unit].")
    unit: str = Field(description="Unit of the amplitude.")
    confusable_with: list[tuple[str, str]] = Field(description="[effect, location] of what it would be taken for.")
    by_location: dict[str, Number] = Field(description="detectable_from at every location [unit].")


class UndetectableEntry(EffectAt):
    """A cause that this recording cannot show."""

    masked_by: str = Field(description="The free parameter, or the reason, that hides it.")


class DetectabilityEntry(Keys):
    """What this recording could have shown besides the findings."""

    smallest: dict[str, SmallestDetectableEntry] = Field(description="By effect.")
    undetectable: list[UndetectableEntry] = Field(description="Causes that this recording cannot show.")


class CandidateExperimentEntry(Keys):
    """One drive that was considered."""

    kind: str = Field(description="Form of the drive.")
    description: str = Field(description="The drive in words.")
    strength: float = Field(description="Amplitude as a share of the drive's range.")
    separation: float = Field(description="Separation of the rivals with it [standard deviations].")


class NextExperimentEntry(Keys):
    """The drive that discriminates best between models that this recording cannot tell apart."""

    discriminates_between: tuple[str, str] = Field(description="The two models, by their causes.")
    reason: str = Field(description="Why these two.")
    description: str = Field(description="The drive in words.")
    kind: str = Field(description="Form of the drive.")
    strength: float = Field(description="Amplitude as a share of the drive's range.")
    samples: int = Field(description="Length of the drive.")
    sample_time: Number = Field(description="[s]; null for settled poses.")
    separation_now: Number = Field(description="Separation by this recording [standard deviations].")
    separation_after: Number = Field(description="Separation by both recordings [standard deviations].")
    settles: bool = Field(description="Whether separation_after decides between them.")
    candidates: list[CandidateExperimentEntry] = Field(description="All drives considered, the best first.")


class TriedCause(EffectAt):
    """A cause that a candidate model adds."""

    z: Number = Field(description="Score of the screen [standard deviations]; null where it was not screened.")
    accepted: bool = Field(description="Whether it is in the model after the round.")


class RefusedEntry(Keys):
    """A model that scores better than what was taken, and was not taken."""

    causes: list[EffectAt] = Field(description="The causes that speak against it.")
    reasons: list[str] = Field(description="What speaks against each.")


class CandidateModelEntry(Keys):
    """One model that was fitted in a round."""

    causes: list[TriedCause] = Field(description="Causes that it adds to the model before the round.")
    criterion: Number = Field(description="Selection criterion T: smaller is better.")
    fitted: Number = Field(description="Mean square of the residual on the records to fit, over the noise's.")
    held_out: Number = Field(description="Mean square of the residual on the held-out records, over the noise's.")


class RoundEntry(Keys):
    """One round of the search."""

    round: int = Field(description="Its number, from 1.")
    threshold: Number = Field(description="|z| that a recording without mismatch exceeds anywhere with 1 % chance.")
    suspects: int = Field(description="Hypotheses screened.")
    criterion_before: Number = Field(description="Selection criterion T of the model before the round.")
    candidates: list[CandidateModelEntry] = Field(description="Models fitted, the best first.")
    refused: list[RefusedEntry] = Field(description="Models that score better than what was taken, with the reason.")
    failed: list[str] = Field(description="Trials that could not be built or simulated, with the reason.")
    causes_after: list[tuple[str, str]] = Field(description="[effect, location] of the causes after the round.")
    decision: str = Field(description="What was decided, and why.")


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

    verdict: Verdict = Field(description="The answer in one word.")
    sentence: str = Field(description="The answer in a sentence: cause, size, share, what is left.")
    attribution: AttributionEntry = Field(description="What the findings take away together, and the rest.")
    findings: list[FindingEntry] = Field(
        description="Causes that the device file leaves out, the most important first."
    )
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
