"""What to do about a rest that lies in one stretch of a record, or in the records to fit alone."""

from __future__ import annotations

from ctrlgen.core.percent import percent
from ctrlgen.diagnosis.evidence.diagnosis_result import Diagnosis
from ctrlgen.estimation.settings import RESIDUAL_TESTS

MORE_LEFT = "More than noise is left: the report shows where it is and of what it is a function."


def more_left(diagnosis: Diagnosis) -> str:
    """That more than noise is left, and in which stretch of a record nearly all of it is, where it is in one."""
    there = diagnosis.residual_location.after.gathered
    if there is None:
        return MORE_LEFT
    kind = "poses" if there.poses else "samples"
    return (
        f"More than noise is left, {percent(there.share)} of it in {there.place}, {there.n} of {there.of} {kind}: see what is "
        "other there (a knock, a trip, counts lost, wrong rows, another kind of motion), and diagnose again without these rows."
    )


def held_out_agrees(diagnosis: Diagnosis) -> bool:
    """Whether the device as described, its numbers moved within their uncertainty, leaves noise alone of the held-out records, as fitted
    it does not, and no cause was found."""
    if diagnosis.findings:
        return False
    rows = [
        (e.rms_after, e.rms_refitted, (e.noise_floor or 0.0) * RESIDUAL_TESTS.error_ratio)
        for e in diagnosis.held_out.values()
    ]
    return all(refitted <= most for _, refitted, most in rows) and any(after > most for after, _, most in rows)


FIT_ALONE = (
    "The held-out records alone agree with the device file, with its numbers moved within their uncertainty: what does not agree is in the "
    "records to fit, or changed between them and the held-out ones. Hold out another of the records, and diagnose again."
)
