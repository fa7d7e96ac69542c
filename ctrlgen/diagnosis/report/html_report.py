"""report.html of a diagnosis: one self-contained page with the answer at the top."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ctrlgen.core.units import show
from ctrlgen.devices.changed_numbers import written
from ctrlgen.diagnosis.evidence.diagnosis_result import Diagnosis
from ctrlgen.diagnosis.report.answer import notes_of
from ctrlgen.diagnosis.report.diagnosis_first_screen import diagnosis_first_screen
from ctrlgen.diagnosis.report.diagnosis_record import Provenance, location_record, shares_record
from ctrlgen.diagnosis.report.figure_words import FIGURES
from ctrlgen.diagnosis.report.figures import draw_all
from ctrlgen.diagnosis.report.history_table import history_rounds, not_taken_rows
from ctrlgen.diagnosis.report.luck_sentences import luck_text
from ctrlgen.diagnosis.report.narrative import gathered, hard, interval, per_cent, plain_name, rest_text, share_text
from ctrlgen.diagnosis.report.reading_charts import diagnosis_charts
from ctrlgen.diagnosis.report.residuals import Residuals
from ctrlgen.diagnosis.report.shares_sentences import family_shares, shares_sentences
from ctrlgen.diagnosis.selection.findings import Finding
from ctrlgen.diagnosis.selection.precedence import why_alike
from ctrlgen.diagnosis.settings import SHARES
from ctrlgen.estimation.hypothesis import PARAMETER, numbers
from ctrlgen.reporting.html import render
from ctrlgen.reporting.numbers import number
from ctrlgen.reporting.page_figure import page_figures
from ctrlgen.reporting.result_file import Keys, origin

CERTAINTY = ("intervals", "profiles", "rivals", "confusability")
# a p-value below is shown as "< 0.0001"
TINY = 1e-4
# standard deviations: parameters that moved by less are left out of the table
NEGLIGIBLE = 1e-3


def page(diagnosis: Diagnosis, provenance: Provenance) -> str:
    """The page as HTML text."""
    residuals = Residuals(diagnosis)
    figures = page_figures(draw_all(diagnosis, residuals), FIGURES, diagnosis_charts(residuals))
    experiment = diagnosis.next_experiment
    return render(
        Path(__file__).with_name("diagnosis.html.j2"),
        d=diagnosis,
        origin=origin(provenance.inputs, provenance.seed),
        trees={name: entry.as_json() for name, entry in _entries(diagnosis).items() if entry is not None},
        first=diagnosis_first_screen(diagnosis, figures),
        history=history_rounds(diagnosis.search),
        not_taken=not_taken_rows(diagnosis.search),
        title=diagnosis.recording.title,
        device_title=diagnosis.device.title,
        counts=counts(diagnosis),
        held_out={channel: entry.as_json() for channel, entry in diagnosis.held_out.items()},
        findings=[_row(f) for f in diagnosis.findings],
        rest=rest_text(diagnosis),
        experiment=None if experiment is None else experiment.record(),
        tested=_tested(diagnosis),
        figures=figures,
        certainty=[figures[name] for name in CERTAINTY if name in figures],
        notes=gathered(notes_of(diagnosis)),
        changed=_changed(diagnosis),
        unknown=[] if diagnosis.unmodelled_force is None else diagnosis.unmodelled_force.sentences(),
        shares=shares_sentences(diagnosis),
        families=_families(diagnosis),
        source=diagnosis.device.source,
        number=number,
        hard=hard,
    )


def _entries(diagnosis: Diagnosis) -> dict[str, Keys | None]:
    """What the page shows number by number, as diagnosis.json states it."""
    return {
        "shares": shares_record(diagnosis),
        "residual_location": location_record(diagnosis),
        "detectability": diagnosis.detectability,
    }


def counts(diagnosis: Diagnosis) -> str:
    """The number of samples in words, such as '3000 samples to fit, 1500 held out'."""
    word = "poses" if diagnosis.recording.kind == "poses" else "samples"
    sizes = {
        role: sum(len(r.time) for r in diagnosis.recording.records if r.role == role)
        for role in ("fit", "hold_out", "rest")
    }
    rest = f", {sizes['rest']} at rest" if sizes["rest"] else ""
    return f"{sizes['fit']} {word} to fit, {sizes['hold_out']} held out{rest}"


def _families(diagnosis: Diagnosis) -> list[dict[str, str]]:
    """Families of laws with the share that they could account for before and after, the largest before first."""
    if diagnosis.shares is None:
        return []
    before, after = (dict(family_shares(diagnosis, t)) for t in (diagnosis.shares.before, diagnosis.shares.after))
    shares = {family: (before.get(family, 0.0), after.get(family, 0.0)) for family in {**before, **after}}
    return [
        {"name": family.value, "before": per_cent(first), "after": per_cent(then)}
        for family, (first, then) in shares.items()
        if max(first, then) >= SHARES.least_gain
    ]


def _row(f: Finding) -> dict[str, Any]:
    return {
        "plain": f.title or plain_name(f.effect),
        "effect": f.effect,
        "location": f.location,
        "of": f.cause.of,
        "numbers": [(name, interval(e, name)) for name, e in f.numbers],
        "alternatives": [
            {"effect": h.effect, "location": h.location, "reason": why_alike(f.cause, h)} for h in f.alternatives
        ],
        "share": share_text(f),
        "luck": luck_text(f),
        "source": f.source,
    }


def _tested(diagnosis: Diagnosis) -> str:
    """The result of the residual tests in one sentence."""
    result = diagnosis.residual_tests
    if any(e.noise_floor is None for e in diagnosis.held_out.values()):
        return "The noise is not known, so the residual cannot be tested against it."
    tests = ", ".join(
        f"{name} p {'= ' + number(p, 2) if p >= TINY else '< ' + number(TINY)}" for name, p in result.p_values.items()
    )
    outcome = "passes" if result.passed else "does not pass"
    return f"The residual {outcome} the tests against the noise model" + (f" ({tests})." if tests else ".")


def _changed(diagnosis: Diagnosis) -> list[dict[str, str]]:
    """Parameters of the device that the fit changed, whether refitted within their uncertainty or found to differ."""
    fit = diagnosis.search.chosen.fit
    known = {path: q for path, _, q in numbers(diagnosis.device)}
    rows = []
    for unknown, value, sd in zip(fit.structure.free_parameters, fit.theta, diagnosis.search.deviations(), strict=True):
        cause = None if unknown.cause is None else fit.structure.causes[unknown.cause]
        of_device = cause is None or cause.effect == PARAMETER
        if of_device and abs(value - unknown.nominal) > NEGLIGIBLE * sd:
            spread = show(sd, unknown.unit, 2) if np.isfinite(sd) and unknown.unit not in ("degC", "degF") else ""
            now = written(value, unknown.unit).text
            rows.append({"path": unknown.path, "was": known[unknown.path].text, "now": now, "sd": spread})
    return rows
