"""A model that needs shorter steps of its integrator is screened and linearised in these too, not in steps in which it has no motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import AXIS, BACKLASH, axis_fitter
from conftest import AXIS_FILE
from creeping_axis import LAWS, creeping_recording

import ctrlgen
from ctrlgen.diagnosis.evidence import supporting_analyses
from ctrlgen.diagnosis.evidence.ltv_linearisation import linearise_along
from ctrlgen.diagnosis.evidence.residual_location import LocatedIn
from ctrlgen.diagnosis.report.diagnosis_record import Provenance
from ctrlgen.diagnosis.report.html_report import page
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.structure import Structure

# N s/m beyond 6 mm/s: one step a sample overshoots more each time, two do not
DAMPING = {"damping": 2e3, "speed": 6e-3}
FINER = 2


@pytest.fixture(scope="module")
def damped() -> tuple[Fitter, Structure]:
    fitter = axis_fitter(u=np.repeat([1.5, -1.5, 0.5, -1.0], 100))
    return fitter, Structure(AXIS).with_cause(Hypothesis("viscous_at_speed", "stage:axis", "axis"), DAMPING)


def fitted(fitter: Fitter, structure: Structure, finer: int) -> Fit:
    return fitter.fit(replace(structure, finer=finer), steps=0)


def test_the_motion_is_linearised_in_the_steps_of_its_fit(damped):
    fitter, structure = damped
    record = fitter.fit_records[0]
    model = linearise_along(fitter, fitted(fitter, structure, FINER), record)
    assert np.isfinite(model.F_S).all() and np.abs(model.displacement).max() > 1e-5
    with np.errstate(all="ignore"), pytest.raises(ArithmeticError, match="not finite"):
        linearise_along(fitter, fitted(fitter, structure, 1), record)


def test_the_screen_takes_the_steps_of_its_fit(damped):
    fitter, structure = damped
    screened = Screen(fitter, [BACKLASH]).run(fitted(fitter, structure, FINER))
    assert [s.hypothesis for s in screened.suspects] == [BACKLASH] and np.isfinite(screened.suspects[0].z)


def test_a_motion_that_cannot_be_linearised_leaves_a_diagnosis_its_findings(tmp_path, monkeypatch):
    def refused(*_: object) -> None:
        raise ArithmeticError("the motion that the model foretells is not finite")

    monkeypatch.setattr(supporting_analyses, "linearise_along", refused)
    found = ctrlgen.diagnose(AXIS_FILE, creeping_recording(tmp_path), laws=LAWS)
    assert [c.effect for c in found.search.chosen.causes] == ["creep"]
    assert found.residual_location.after.coordinates.located_in is LocatedIn.UNKNOWN
    assert any(
        "the place of the residual after the correction is left out: the motion that" in note for note in found.notes
    )
    assert "creep" in page(found, Provenance({}, 0))
