"""report.html of a diagnosis: one self-contained page, the answer on the first screen."""

from __future__ import annotations

from typing import Any

import numpy as np

from ctrlgen.core.units import show
from ctrlgen.diagnosis.estimation.robust_covariance import robust_deviations
from ctrlgen.diagnosis.hypotheses.hypotheses import PARAMETER, numbers, written
from ctrlgen.diagnosis.report.diagnosis_json import Provenance, diagnosis_record
from ctrlgen.diagnosis.report.narrative import (
    gathered,
    hard,
    interval,
    next_steps,
    number,
    plain_name,
    sentence,
    unknown_lines,
)
from ctrlgen.diagnosis.report.plots import draw_all
from ctrlgen.diagnosis.selection.result import Diagnosis, Finding
from ctrlgen.reporting.html import render

CAPTIONS = {
    "residuals": "What the model leaves of the held-out records. A gap is a marked sample.",
    "spectrum": "The same by frequency. Where a curve lies on the noise, nothing more can be learnt from this recording.",
    "where": "Where the mismatch is: excess of squares over the noise's with 95 % intervals, part by part.",
    "unknown": "The disturbance that would explain the rest, with 95 % intervals: its shape is a hint at the law.",
    "intervals": "An interval that reaches zero would mean that the cause may be absent.",
    "profiles": "The objective with one number held and the others fitted again; below the dotted line lies the 95 % "
    "interval (shaded).",
    "rivals": "Each round fits the most conspicuous suspects and keeps the best. T: squares left on the records to fit "
    "and on the held-out ones, in units of the noise, and a price for every number. Blue: in the final answer; orange: "
    "explains alike; grey: worse.",
    "confusability": "How alike two suspects look in this recording: |cos| of what they do to the readings once the "
    "device's own uncertain numbers are free; 1 cannot be told apart, 0 cannot be confused. Each with one shape; "
    "fitted shapes can make two more alike. |z|: how conspicuous, in standard deviations.",
}
TINY = 1e-4  # p below which its size says nothing more
NEGLIGIBLE = 1e-3  # of its standard deviation: numbers that moved less are left out of the table


def page(diagnosis: Diagnosis, provenance: Provenance) -> str:
    """The page as HTML text."""
    return render(
        "diagnosis.html.j2",
        d=diagnosis_record(diagnosis, provenance),
        title=diagnosis.recording.title,
        device_title=diagnosis.device.title,
        counts=counts(diagnosis),
        sentence=sentence(diagnosis),
        findings=[_row(f) for f in diagnosis.findings],
        steps=next_steps(diagnosis),
        tested=_tested(diagnosis),
        figures=draw_all(diagnosis),
        captions=CAPTIONS,
        notes=gathered(diagnosis.notes),
        changed=_changed(diagnosis),
        unknown=unknown_lines(diagnosis),
        source=diagnosis.device.source,
        number=number,
        hard=hard,
    )


def counts(diagnosis: Diagnosis) -> str:
    """'3000 samples to fit, 1500 held out'."""
    word = "poses" if diagnosis.recording.kind == "poses" else "samples"
    sizes = {
        role: sum(len(r.time) for r in diagnosis.recording.records if r.role == role)
        for role in ("fit", "hold_out", "rest")
    }
    rest = f", {sizes['rest']} at rest" if sizes["rest"] else ""
    return f"{sizes['fit']} {word} to fit, {sizes['hold_out']} held out{rest}"


def _row(f: Finding) -> dict[str, Any]:
    return {
        "plain": plain_name(f.effect), "effect": f.effect, "location": f.location, "of": f.cause.of,
        "numbers": [(name, interval(e)) for name, e in f.parameters.items()],
        "alternatives": [{"effect": effect, "location": location} for effect, location in f.alternatives],
        "gain": f"{100 * f.held_out_gain:.3g} %" if np.isfinite(f.held_out_gain) else "not known", "source": f.source,
    }  # fmt: skip


def _tested(diagnosis: Diagnosis) -> str:
    """What the adequacy gate says of the rest."""
    gate = diagnosis.residual_tests
    if any(e.noise_floor is None for e in diagnosis.held_out.values()):
        return "The noise is not known, so these errors cannot be judged against it."
    tests = ", ".join(
        f"{name} p {'= ' + number(p, 2) if p >= TINY else '< ' + number(TINY)}" for name, p in gate.p_values.items()
    )
    result = "passes" if gate.passed else "does not pass"
    return f"What is left {result} the test against the noise" + (f" ({tests})." if tests else ".")


def _changed(diagnosis: Diagnosis) -> list[dict[str, str]]:
    """The device's own numbers that the fit moved, the refitted and the diagnosed."""
    fit = diagnosis.search.chosen.fit
    known = {path: q for path, _, q in numbers(diagnosis.device)}
    rows = []
    for unknown, value, sd in zip(fit.structure.free_parameters, fit.theta, robust_deviations(fit), strict=True):
        cause = None if unknown.cause is None else fit.structure.causes[unknown.cause]
        own = cause is None or cause.effect == PARAMETER
        if own and abs(value - unknown.nominal) > NEGLIGIBLE * sd:
            spread = show(sd, unknown.unit, 2) if np.isfinite(sd) and unknown.unit not in ("degC", "degF") else ""
            now = written(value, unknown.unit).text
            rows.append({"path": unknown.path, "was": known[unknown.path].text, "now": now, "sd": spread})
    return rows
