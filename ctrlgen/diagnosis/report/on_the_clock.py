"""What of the corrected device holds for its recording alone: a drift, an event, a line run on the clock of the records.

In generated C that clock begins with the controller: a drift grows from there, a step comes again at its moment.
"""

from __future__ import annotations

from collections.abc import Sequence

from ctrlgen.diagnosis.selection.cause_entry import cause_name
from ctrlgen.diagnosis.selection.findings import Finding
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis


def runs_on_the_clock(cause: Hypothesis) -> bool:
    """Whether what a cause does depends on when it is."""
    return cause.effect != PARAMETER and any(state.clock for state in cause.law.states)


def used_for_another_run(findings: Sequence[Finding], use: str) -> str:
    """What device.next.toml may be used for, `use`, where its findings hold for another run; else what to take out first, or that none of
    it does."""
    clocked = [cause_name(f.cause) for f in findings if runs_on_the_clock(f.cause)]
    if not clocked:
        return use
    names = " and ".join(clocked)
    runs = f"{names} {'runs' if len(clocked) == 1 else 'run'} on the clock of these records, of which another run knows nothing"
    if len(clocked) == len(findings):
        return f"Generate no C with device.next.toml: {runs}."
    return f"Before C is generated with device.next.toml, take out what holds for this recording alone: {runs}. {use}"
