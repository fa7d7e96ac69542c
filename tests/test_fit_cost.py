"""What fits and a diagnosis cost, counted in simulations of a record: none is made twice, and a search makes no more than it did."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from axis_records import AXIS, axis_fitter

from ctrlgen.diagnosis.diagnose import diagnose_recording
from ctrlgen.estimation.described_device import described
from ctrlgen.estimation.error_model import ErrorModel
from ctrlgen.estimation.isolated_outliers import mark_outliers
from ctrlgen.estimation.simulator import Simulator
from ctrlgen.estimation.structure import Structure

# Simulations of the diagnosis below
WITH_SLOPES, WITHOUT = 250, 159


@pytest.fixture
def counted(monkeypatch):
    """How often records are simulated, with slopes and without."""
    counts: Counter[str] = Counter()

    def counting(name):
        method = getattr(Simulator, name)
        monkeypatch.setattr(Simulator, name, lambda *a, **k: counts.update([name]) or method(*a, **k))

    counting("simulate_states")
    counting("sensitivities")
    return counts


def test_what_a_fit_predicts_is_simulated_once_under_the_same_errors(counted):
    fitter = axis_fitter(n=400)
    fit = fitter.fit(Structure(AXIS), steps=1)
    record = fitter.held_out_records[0]
    first = fitter.predict(fit, record)
    counted.clear()
    first[:] = 0.0  # belongs to who asked
    again = fitter.predict(replace(fit), record)
    assert not counted and np.any(again)
    other = ErrorModel.of_noise(replace(fitter.noise, sd=2 * fitter.noise.sd))
    replace(fitter, errors=other).predict(fit, record)
    assert counted["sensitivities"] == 1


@pytest.mark.long
def test_a_diagnosis_simulates_no_more_than_it_did(counted):
    """A spring that stiffens and three laws that might be it; a tenth more for the rounding of other machines."""
    fitter = axis_fitter(lambda t, q, v, memory: (-1.8e12 * q**3, memory), n=600)
    found = diagnose_recording(AXIS, fitter.recording, laws=["backlash", "one_sided_stiffening", "stiffening"], jobs=0)
    assert [c.effect for c in found.search.chosen.causes] == ["stiffening"]
    assert counted["sensitivities"] <= 1.1 * WITH_SLOPES and counted["simulate_states"] <= 1.1 * WITHOUT


def test_the_device_as_described_is_fitted_once_to_the_same_samples_under_the_same_errors(counted):
    fitter = axis_fitter(n=400)
    first = described(fitter, AXIS)
    unmarked = mark_outliers(fitter.recording, lambda record: fitter.predict(first[1], record))
    assert unmarked is fitter.recording
    counted.clear()
    assert described(replace(fitter), AXIS) is first and not counted
    other = replace(fitter.noise, sd=2 * fitter.noise.sd)
    assert described(fitter.with_noise(other), AXIS) is not first and counted["sensitivities"]
