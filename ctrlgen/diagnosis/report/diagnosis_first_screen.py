"""What report.html of a diagnosis says before anything else."""

from __future__ import annotations

from collections.abc import Mapping

from ctrlgen.diagnosis.evidence.diagnosis_result import Diagnosis
from ctrlgen.diagnosis.report.answer import answer, worst_channel
from ctrlgen.diagnosis.report.luck_sentences import chance_text
from ctrlgen.diagnosis.report.narrative import hard, interval, next_steps, share_text, short
from ctrlgen.diagnosis.selection.cause_entry import cause_noun
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.reporting.numbers import number
from ctrlgen.reporting.page_figure import FirstScreen, PageFigure

STATES = {Verdict.CONSISTENT: "ok", Verdict.EXPLAINED: "ok", Verdict.UNEXPLAINED: "bad"}
# numbers of the main cause beside the figure: its amplitude and what shapes it most
NUMBERS = 3


def diagnosis_first_screen(diagnosis: Diagnosis, figures: Mapping[str, PageFigure]) -> FirstScreen:
    """The answer, measured against simulated, the errors and the main cause's numbers, the next steps."""
    return FirstScreen(
        tuple(hard(line) for line in answer(diagnosis)),
        STATES.get(diagnosis.verdict, "so"),
        figures.get("readings"),
        _numbers(diagnosis),
        tuple(next_steps(diagnosis)),
    )


def _numbers(diagnosis: Diagnosis) -> tuple[tuple[str, str], ...]:
    channel = worst_channel(diagnosis)
    e = diagnosis.held_out[channel]
    told = [(f"held-out error of {short(channel)}, as described", f"{number(e.rms_before, 3)} {e.unit}")]
    if diagnosis.findings:
        told.append(("with the findings", f"{number(e.rms_after, 3)} {e.unit}"))
    told.append(("noise", "not known" if e.noise_floor is None else f"{number(e.noise_floor, 3)} {e.unit}"))
    for main in diagnosis.findings[:1]:
        told.append((f"share of {cause_noun(main.cause)}", share_text(main)))
        told.append(("chance by luck", chance_text(main)))
        told += [(name, interval(one, name)) for name, one in main.numbers[:NUMBERS]]
    return tuple((name, hard(value)) for name, value in told)
