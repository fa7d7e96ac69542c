"""Waves are told by a positive amplitude: half a turn of the phase is its other sign."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from axis_records import AXIS, axis_fitter
from law_inputs import law_inputs

from ctrlgen.diagnosis.diagnose import diagnose_recording
from ctrlgen.diagnosis.selection.positive_waves import PHASE, positive
from ctrlgen.effects import Effect
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.structure import Structure

UM = 1e-6
WAVES = [kind for kind, law in Effect.library.items() if PHASE in {p.name for p in law.params}]


@pytest.mark.parametrize("kind", WAVES)
def test_a_law_with_a_phase_is_a_wave(kind):
    """What the flip takes for granted of every law that has a number of this name."""
    law, rng = Effect.library[kind]("all", {}), np.random.default_rng(1)
    given = {
        name: rng.uniform(0.1, 1.0) for name in ("value", "displacement", "position", "travel", "angle", "t", "theta")
    }
    s = law_inputs(**given, all=[0.4], partner=0)
    for phase in rng.uniform(-3, 3, 5):
        numbers = {p.name: rng.uniform(0.5, 2.0) for p in law.params} | {PHASE: phase}
        size = law.amplitude().name
        turned = numbers | {name: -numbers[name] for name in (size, *law.of_even_harmonics)} | {PHASE: phase + np.pi}
        one, other = (float(law.term(s, SimpleNamespace(**n))) for n in (numbers, turned))
        assert one == pytest.approx(other, rel=1e-9) and abs(one) > 1e-3


def test_the_readings_and_the_deviations_of_a_fit_stay_as_they_are():
    pitch = Hypothesis("cyclic", "sensor:axis", "axis")
    fitter = axis_fitter(change=lambda y, u: y - 0.3 * UM * np.sin(2 * np.pi * y / (22 * UM) + 0.4))
    begun = {"amplitude": -0.25 * UM, "period": 22 * UM, "phase": 0.35}
    fit = fitter.fit(Structure(AXIS).with_cause(pitch, begun))
    told = positive(fit)
    assert fit.values(0)["amplitude"] < 0 < told.values(0)["amplitude"]
    assert told.values(0)["phase"] == pytest.approx(0.4 - np.pi, abs=0.05)
    for record in fitter.recording.records:
        assert np.allclose(fitter.predict(told, record), fitter.predict(fit, record), rtol=0, atol=1e-15)
    deviations = [np.sqrt(f.covariance.diagonal()) for f in (fit, told)]
    assert deviations[0] == pytest.approx(deviations[1], rel=1e-9)
    assert positive(told) is told


def test_a_pitch_of_the_other_sign_is_told_and_written_with_half_a_turn():
    fitter = axis_fitter(change=lambda y, u: y - 0.3 * UM * np.sin(2 * np.pi * y / (22 * UM) + np.radians(10)))
    found = diagnose_recording(AXIS, fitter.recording, jobs=0, laws=("cyclic",))
    (pitch,) = found.findings
    assert pitch.parameters["amplitude"].value == pytest.approx(0.3, rel=0.01)
    assert pitch.parameters["phase"].value == pytest.approx(-170, abs=3)
    (written,) = found.corrected.effect
    assert written.values["amplitude"].si > 0
