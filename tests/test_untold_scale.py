"""Numbers of a device of which the readings tell ratios alone: the file decides which of them is off, and the answer says so."""

from __future__ import annotations

import pytest
from axis_records import AXIS, KF, C, K, M, axis_fitter
from conftest import AXIS_FILE

from ctrlgen import diagnose, load_device
from ctrlgen.diagnosis.report.answer import sentence
from ctrlgen.diagnosis.selection.untold_scale import moved_together
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis
from ctrlgen.estimation.structure import Structure

MASS = Hypothesis(PARAMETER, "stage:mass", path="mechanics.mass")
OTHERS = ("mechanics.damping", "mechanics.stiffness", "actuator.force_constant")


@pytest.fixture(scope="module")
def softer() -> Fitter:
    """An axis whose stiffness and force constant are both a quarter less than stated: all that is read is m/k, c/k and k_f/k."""
    return axis_fitter(n=500, numbers=(M, 3 / 4 * C, 3 / 4 * K, 3 / 4 * KF))


def test_what_others_undo_is_told_beside_them_alone(softer):
    fit = softer.fit(Structure(AXIS).with_cause(MASS, {"value": M}))
    assert moved_together(fit, 0) == OTHERS


def test_a_number_beside_an_exact_force_constant_is_told_alone(softer, tmp_path):
    file = tmp_path / "exact.toml"
    file.write_text(AXIS_FILE.read_text().replace('sd = "0.2 N/V"', 'sd = "0 N/V"'))
    fit = softer.fit(Structure(load_device(file)).with_cause(MASS, {"value": M}))
    assert moved_together(fit, 0) == ()


def test_a_law_is_told_alone(softer):
    gain = Hypothesis("sensor_gain", "sensor:axis", "axis")
    assert moved_together(softer.fit(Structure(AXIS).with_cause(gain, {"gain": 0.0})), 0) == ()


def test_the_answer_says_that_the_file_decided(softer):
    found = diagnose(AXIS, softer.recording, laws=["sensor_gain"])
    assert found.findings[0].cause.path == "mechanics.mass"
    told = "the readings alone do not tell it from mechanics.damping, mechanics.stiffness and actuator.force_constant off together"
    assert told in sentence(found)
