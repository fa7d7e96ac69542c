"""What the model-free shares say, in sentences: the ceiling beside what the accepted laws reach, and of what kind the rest is."""

from __future__ import annotations

from enum import Enum

from ctrlgen.diagnosis.evidence.diagnosis_result import Diagnosis
from ctrlgen.diagnosis.report.narrative import empirical_sentences, per_cent, short
from ctrlgen.diagnosis.report.period_words import pitch
from ctrlgen.diagnosis.selection.cause_entry import cause_name
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.diagnosis.settings import SHARES
from ctrlgen.diagnosis.shares.design import Kind
from ctrlgen.diagnosis.shares.families import SPEAKS_FOR, ranking
from ctrlgen.diagnosis.shares.shares_table import ChannelShares, Share, SharesTable
from ctrlgen.effects import Family
from ctrlgen.reporting.numbers import number

# kinds that a sentence names
NAMED = 3
# families of laws that a sentence names
FAMILIES = 2


class Beside(Enum):
    """What stands beside every kind of signal."""

    CONSTANT = "a constant"
    NUMBERS = "what other values of the device's own numbers would take away"


# a residual in which these are the largest part is not called a function of a signal
NO_FUNCTION = (Beside.CONSTANT, Beside.NUMBERS, Kind.RECORD, Kind.PROPORTION)
NAMES: dict[Kind | Beside, str] = {
    Kind.DIRECTION: "the direction of motion",
    Kind.PROPORTION: "a part in proportion to position",
    Kind.RATE: "the rate of the reading",
    Kind.TRAVEL_HISTORY: "the history of travel",
    Kind.DRIVE_HISTORY: "the history of the drive",
    Kind.OTHER_AXIS: "another axis",
    Kind.DRIVE_LAG: "the low-passed drive",
    Kind.PRODUCT: "the product of two signals",
    Kind.WARM_PRODUCT: "the product of temperature and another signal",
    Kind.RECORD: "a constant for each record",
}


def shares_sentences(diagnosis: Diagnosis) -> list[str]:
    """Of the channel with the largest residual, in noise units: what explains it and how much the accepted laws reach; then
    what is left. None where the device as described leaves noise alone, or the records are too short."""
    shares = diagnosis.shares
    if shares is None or diagnosis.verdict == Verdict.CONSISTENT:
        return []
    worst = worst_of(diagnosis, shares.before)
    said = ceiling_sentence(worst)
    if not diagnosis.search.chosen.causes:
        return [f"{said}; {_without_fit(diagnosis)}.", *empirical_sentences(diagnosis)]
    reached = shares.reached(worst.channel)
    # a delay, say, is a function of no signal at its own moment
    laws = (
        "the accepted laws" if named_parts(worst) else "the accepted laws, which are functions of none of them alone,"
    )
    sentences = [f"{said}; {laws} reach {with_interval(reached)}."]
    if not diagnosis.residual_tests.passed:
        sentences.append(rest_sentence(worst_of(diagnosis, shares.after)))
    return [*sentences, *empirical_sentences(diagnosis)]


def _without_fit(diagnosis: Diagnosis) -> str:
    """What is said of the laws where none was fitted: those that the readings show directly are named all the same."""
    if not diagnosis.findings:
        return "no law of the library is confirmed for it"
    names = " and ".join(cause_name(f.cause) for f in diagnosis.findings)
    return f"{names} is seen in the readings themselves and takes no share"


def family_shares(diagnosis: Diagnosis, table: SharesTable) -> list[tuple[Family, float]]:
    """Families of laws by the share that they could account for, channels weighed by their energy in noise units."""
    return ranking(table, noise_of(diagnosis))


def noise_of(diagnosis: Diagnosis) -> dict[str, float]:
    """Standard deviation of the noise [SI] by channel."""
    return dict(zip(diagnosis.recording.channels, diagnosis.fitter.noise.floor.tolist(), strict=True))


def worst_of(diagnosis: Diagnosis, table: SharesTable) -> ChannelShares:
    """The channel with the largest residual in noise units."""
    noise = noise_of(diagnosis)
    return max(table.channels, key=lambda c: c.rms / noise[c.channel])


def ceiling_sentence(c: ChannelShares) -> str:
    """'Direction of motion explains 85 % (80 ... 88 %) of what the device as described leaves in axis'."""
    leaves = f"of what the device as described leaves in {short(c.channel)}"
    parts = named_parts(c)
    if not parts:
        return f"No signal explains more than {per_cent(SHARES.told)} {leaves}"
    total = with_interval(c.total)
    if len(parts) == 1:
        return f"{_capital(part_name(c, parts[0][0]))} explains {total} {leaves}"
    listed = [f"{part_name(c, part)} ({per_cent(share)})" for part, share in parts[:NAMED]]
    beside = " together with lesser ones" if c.total.share - sum(s for _, s in parts[:NAMED]) > SHARES.told else ""
    return f"{_capital(', '.join(listed[:-1]))} and {listed[-1]}{beside} explain {total} {leaves}"


def rest_sentence(c: ChannelShares) -> str:
    """'What is left in axis is mostly a function of travel history, 64 %, alone 60 % (50 ... 71 %), which ...'."""
    left = f"What is left in {short(c.channel)}"
    past = f"its own past predicts {per_cent(c.rest_own_past)}" if c.rest_own_past >= SHARES.told else None
    part, share = next(iter(named_parts(c)), (None, 0.0))
    if part is None or share <= c.rest_own_past:
        beside = [] if past is None else [f"{past} of it"]
        beside += [] if part is None else [f"{part_name(c, part)} {per_cent(share)}"]
        told = f": {', '.join(beside)}" if beside else ""
        return f"{left} is mostly no function of the signals looked at{told}."
    memory = "" if past is None else f"; {past} more"
    if part in NO_FUNCTION:
        return f"{left} is {_mostly(share)} {part_name(c, part)}, {per_cent(share)}{memory}."
    row = max(c.selected, key=lambda row: row.additional)
    families = [f.value for f in SPEAKS_FOR[row.kind][0][:FAMILIES]]
    where = f", where {' or '.join(families)} would show" if families else ""
    return (
        f"{left} is {_mostly(share)} a function of {part_name(c, part)}, {per_cent(share)}, alone {with_interval(row.alone)}{where}, "
        f"which no confirmed law of the library reaches{memory}."
    )


def rest_kind(diagnosis: Diagnosis, channel: str) -> str:
    """', mostly a function of the history of travel (64 %)' of what is left in a channel; nothing where no table tells it."""
    shares = diagnosis.shares
    c = next((c for c in shares.after.channels if c.channel == channel), None) if shares is not None else None
    if c is None:
        return ""
    part, share = next(iter(named_parts(c)), (None, 0.0))
    if part is None or share <= c.rest_own_past:
        return ", mostly no function of the signals looked at"
    function = "" if part in NO_FUNCTION else "a function of "
    return f", {_mostly(share)} {function}{part_name(c, part)} ({per_cent(share)})"


def named_parts(c: ChannelShares) -> list[tuple[Kind | Beside, float]]:
    """What a residual is a function of with the share that each adds, the largest first; those below `SHARES.told` left out, and all
    where together they predict no more."""
    if c.total.share < SHARES.told:
        return []
    parts: list[tuple[Kind | Beside, float]] = [(Beside.CONSTANT, c.constant), (Beside.NUMBERS, c.numbers)]
    parts += [(row.kind, row.additional) for row in c.selected]
    return sorted((part for part in parts if part[1] >= SHARES.told), key=lambda part: -part[1])


def part_name(c: ChannelShares, part: Kind | Beside) -> str:
    """'the direction of motion', 'a line of 2.2 Hz', 'the place in a pitch of 0.25 mm (4 a mm)', 'position times direction'."""
    if isinstance(part, Kind) and part in c.factors:
        return " times ".join(c.factors[part])
    if part is Kind.LINE:
        return f"a line of {number(1 / c.periods[part], 3)} Hz"
    if part is Kind.PITCH:
        return f"the place in {pitch(c.periods[part], c.pitch_unit)}"
    return NAMES.get(part, part.value)


def with_interval(share: Share) -> str:
    """'85 % (80 ... 88 %)'; without the interval where its ends show as the share itself."""
    value, ends = per_cent(share.share), interval(share.ci95)
    return value if ends == f"{value.removesuffix(' %')} ... {value}" else f"{value} ({ends})"


def interval(ci95: tuple[float, float]) -> str:
    """The interval in per cent, such as '80 ... 88 %'."""
    low, high = (per_cent(end).removesuffix(" %") for end in ci95)
    return f"{low} ... {high} %"


def _mostly(share: float) -> str:
    return "mostly" if share >= SHARES.mostly else "in part"


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]
