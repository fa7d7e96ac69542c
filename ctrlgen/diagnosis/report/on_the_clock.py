"""What of the corrected device holds for its recording alone: a drift, an event, a line run on the clock of the records.

In generated C that clock would begin with the controller: a drift would grow from there, a step would come again at its moment.
device.next.toml therefore states them as [[recording_effect]]. What a dead channel reports is no more of use to a controller.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ctrlgen.diagnosis.selection.cause_entry import cause_name
from ctrlgen.diagnosis.selection.findings import Finding
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis
from ctrlgen.recordings.recording import Recording

DEAD = "stuck"  # the law of a channel that reports one number, whatever the motion


def runs_on_the_clock(cause: Hypothesis) -> bool:
    """Whether what a cause does depends on when it is."""
    return cause.effect != PARAMETER and cause.law.runs_on_the_clock()


def a_pose_a_second(recording: Recording, findings: Sequence[Finding]) -> list[str]:
    """What is told of the seconds of causes that run on the clock, where the poses have settled and have none."""
    clocked = [cause_name(f.cause) for f in findings if runs_on_the_clock(f.cause)]
    if not clocked or recording.kind != "poses" or any(np.isfinite(r.sample_time) for r in recording.records):
        return []
    return [f"settled poses have no clock: 1 s of {' and '.join(clocked)} is one pose"]


def used_for_another_run(findings: Sequence[Finding], use: str) -> str:
    """What device.next.toml may be used for, `use`, and which findings no C takes from it; that no C is better for it where these are
    all. A channel that is dead tells of nothing but itself."""
    dead = [cause_name(f.cause) for f in findings if f.cause.effect == DEAD]
    if dead:
        mend = f"{' and '.join(dead)}: nothing of the motion is read there; mend the sensor or its wiring, and record again"
        alive = [f for f in findings if f.cause.effect != DEAD]
        return (
            f"{used_for_another_run(alive, use)} {mend}."
            if alive
            else f"No cause that was found makes the C better. {mend}."
        )
    clocked = [cause_name(f.cause) for f in findings if runs_on_the_clock(f.cause)]
    if not clocked:
        return use
    runs, it = ("runs", "it") if len(clocked) == 1 else ("run", "them")
    why = f"{' and '.join(clocked)} {runs} on the clock of these records, of which another run knows nothing"
    kept = f"device.next.toml keeps {it} for this recording as [[recording_effect]]"
    began = [cause_name(f.cause) for f in findings if runs_on_the_clock(f.cause) and f.cause.law.acts_in is not None]
    lasts = f" If {' and '.join(began)} lasts, state the law without its moment as an [[effect]]." if began else ""
    if len(clocked) == len(findings):
        return f"No cause that was found makes the C better: {why}; {kept}.{lasts}"
    return f"{use} Its C is without what holds for this recording alone: {why}; {kept}.{lasts}"
