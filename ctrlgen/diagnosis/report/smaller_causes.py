"""What to do where more than noise is left, and too little of the whole error for smaller causes to be sought beside those found."""

from __future__ import annotations

from ctrlgen.core.percent import percent
from ctrlgen.diagnosis.evidence.diagnosis_result import Diagnosis
from ctrlgen.diagnosis.settings import MODEL_SELECTION

LOUD = 2.0
"""Times the noise above which it is worth another diagnosis. Judgement."""
SMALLER = (
    "What is left is less than {} of the error's energy, and of it only a cause that takes most away was sought: for smaller "
    "ones, diagnose device.next.toml with the same recordings."
)


def smaller_causes_step(diagnosis: Diagnosis) -> list[str]:
    """How to go on to smaller causes; nothing where they were sought (`ModelSelection.only_much_matters`), or noise is left."""
    errors = diagnosis.held_out.values()
    known = all(e.noise_floor is not None for e in errors)
    if not (diagnosis.search.chosen.causes and known) or diagnosis.residual_tests.passed:
        return []
    if not all(e.rms_after**2 <= MODEL_SELECTION.least_share * e.rms_before**2 for e in errors):
        return []
    loud = any(e.rms_after > LOUD * (e.noise_floor or 0.0) for e in errors)
    return [SMALLER.format(percent(MODEL_SELECTION.least_share, 2))] if loud else []
