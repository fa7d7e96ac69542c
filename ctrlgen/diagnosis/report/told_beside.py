"""What a diagnosis tells beside its findings: what was done to the recording, what is known of its noise, what could not be tried."""

from __future__ import annotations

from collections.abc import Sequence

from ctrlgen.diagnosis.report.half_a_sample import half_a_sample
from ctrlgen.diagnosis.report.nearly_as_large import nearly_as_large
from ctrlgen.diagnosis.report.on_the_clock import a_pose_a_second
from ctrlgen.diagnosis.report.worse_channels import worse_channels
from ctrlgen.diagnosis.selection.cause_entry import cause_name
from ctrlgen.diagnosis.selection.dead_channels import LiveChannels
from ctrlgen.diagnosis.selection.findings import Finding
from ctrlgen.diagnosis.selection.search_result import SearchResult
from ctrlgen.estimation.drive_clock import STAMPS, TOLD, stamp_deviation
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.spikes import Spikes, marking_notes
from ctrlgen.estimation.unstated_drive import told_of_reading
from ctrlgen.reporting.numbers import number

RESTLESS = "{}: at rest the residual jumps or has memory, so it is not noise; something acts there that the device file does not describe"
WITHDRAWN = "{} is not confirmed: with it the held-out records are predicted worse than by the device as described"
OFF_ITS_STAMPS = (
    "the drive is taken to come {} s {} its time stamps, {} of a sample: with that the held-out records are predicted better; it is a "
    "number of the recording and not written to the device"
)


def told_beside(
    search: SearchResult,
    live: LiveChannels,
    found: Sequence[Finding],
    spikes: Sequence[Spikes],
    restless: Sequence[str],
    of_laws: Sequence[str],
) -> tuple[str, ...]:
    """The notes of a diagnosis, in the order in which things happened; `restless`: the channels whose residual is no noise at rest."""
    recording = search.fitter.recording
    failed = dict.fromkeys(text for round_ in search.rounds for text in round_.failed)
    return (
        *recording.notes,
        *live.notes,
        *search.fitter.noise.notes,
        *marking_notes(live.recording, recording),
        *(s.sentence for s in spikes),
        *told_of_reading(search.fitter, search.chosen.fit),
        *half_a_sample(recording, found),
        *nearly_as_large(found),
        *worse_channels(search),
        *a_pose_a_second(recording, found),
        *map(RESTLESS.format, restless),
        *clock_note(search.fitter),
        *of_laws,
        *(WITHDRAWN.format(cause_name(c)) for c in search.withdrawn),
        *(f"could not be tried: {text}" for text in failed),
    )


def clock_note(fitter: Fitter) -> list[str]:
    """By how much the drive is off its time stamps, where that is more than stamps usually are."""
    stamps = stamp_deviation(fitter.recording)
    if abs(fitter.clock) <= TOLD * stamps:
        return []
    side = "before" if fitter.clock > 0 else "behind"
    return [OFF_ITS_STAMPS.format(number(abs(fitter.clock), 2), side, number(STAMPS * abs(fitter.clock) / stamps, 2))]
