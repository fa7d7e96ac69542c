"""The sentences about the next experiment: what to run, what it asks of the drives, and what to do where nothing recorded decides."""

from __future__ import annotations

from collections.abc import Sequence

from ctrlgen.diagnosis.evidence.experiment_design import Experiment, ProposedDriveEntry
from ctrlgen.diagnosis.selection.cause_entry import cause_noun
from ctrlgen.reporting.numbers import number

# drives that a sentence names one by one
SHOWN = 3


def experiment_sentence(experiment: Experiment | None) -> str:
    """What to do to decide between the alternatives of an ambiguous verdict; where one of them is the sensor's and one the device's, how to
    read the poses otherwise too."""
    if experiment is None:
        return NOTHING_DECIDES
    said, readings = _by_drives(experiment), experiment.readings
    if readings is None:
        return said
    between = f"{cause_noun(readings.of_sensor)} from {cause_noun(readings.of_device)}"
    first, *others = readings.entries
    if not first.settles:
        tried = " nor ".join(e.description for e in readings.entries)
        none = "Neither" if others else "Not even"
        return f"{said} {none} {tried} tells {between}: measure one of them directly."
    rest = "".join(
        f", and {e.description} {'does too' if e.settles else 'does not'} ({number(e.separation, 2)})" for e in others
    )
    read = "read the same poses, zeroed with the drives off," if readings.settled else "record the same motion"
    apart = number(first.separation, 2)
    told = f"To tell {between}, {read} with {first.description}: they are {apart} standard deviations apart then{rest}."
    # a drive that nothing recorded shows, or none: what is read otherwise comes first
    return f"{said} {told}" if experiment.offered else told


def _by_drives(experiment: Experiment) -> str:
    """What drives decide."""
    what, alternative = experiment.candidates[0].description, experiment.alternative
    within = f"{asked(experiment.drives)}, within what was recorded"
    if experiment.settles:
        return (
            f"Run the next experiment (next_experiment/) to decide between the alternatives: {what}; {within}. "
            "Until then the cause is not known."
        )
    if alternative is None:
        return NOTHING_DECIDES
    if alternative.repeats is not None:
        return (
            f"Run the next experiment (next_experiment/) {alternative.repeats} times to decide between the alternatives: {what}; "
            f"{within}. Once is not enough; until then the cause is not known."
        )
    farther = alternative.beyond.description if alternative.beyond is not None else ""
    return (
        f"No drive within what was recorded decides between the alternatives. If the machine bears it, this one would: {farther}; "
        f"{asked(alternative.drives)}. No recording shows that it can."
    )


NOTHING_DECIDES = (
    "None of the drives considered would decide between the alternatives: measure one directly, with another sensor."
)


def asked(drives: Sequence[ProposedDriveEntry]) -> str:
    """'axis from 0.2 to 3.4 V, at most 20 V/s, up to 3 Hz', for the first drives."""
    parts = []
    for d in drives[:SHOWN]:
        low, high = (number(v, 3) for v in d.range)
        still = d.range[0] == d.range[1]
        text = f"{d.drive} at {low} {d.unit}" if still else f"{d.drive} from {low} to {high} {d.unit}"
        timed = d.rate is not None and d.rate not in (0.0, float("inf"))
        parts.append(f"{text}, at most {number(d.rate, 3)} {d.unit}/s" if timed else text)
    more = [f"{len(drives) - SHOWN} more"] if len(drives) > SHOWN else []
    return "; ".join(parts + more) or "its drives as in drive.csv"
