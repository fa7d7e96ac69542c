"""A cause that is a small part of the mismatch and a large part of what is left is kept, and none that is less."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from misfits import errors_of, left, weighed_by

from ctrlgen.diagnosis.selection import pruning
from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.model_selection import ModelSelection
from ctrlgen.estimation.hypothesis import Hypothesis

N = 1000  # samples of each kind
PITCH, GAIN, CREEP = (
    Hypothesis("cyclic", "sensor:axis", "axis"),
    Hypothesis("drive_gain", "actuator:axis", "axis"),
    Hypothesis("creep", "stage:axis", "axis"),
)
HARMONIC = Hypothesis("cyclic", "sensor:axis", "axis", count=1)
WHOLE = 1e9  # mean square of the mismatch, over the noise's


def model(energy: float, *causes: Hypothesis) -> CandidateModel:
    """A model that leaves a mean square of `energy`, over the noise's, on both kinds of records."""
    found = left((energy - 1) * N)
    structure = SimpleNamespace(causes=causes, free_parameters=(), log_prior_odds=0.0)
    return CandidateModel(SimpleNamespace(structure=structure, penalty=0.0), errors_of(found), found, found)


def compare() -> ModelSelection:
    weigh = weighed_by()
    return ModelSelection(weigh, lambda *_, **__: [], WHOLE * weigh.noise.floor**2)


@pytest.mark.parametrize("after, kept", [(24.0, True), (26.0, False)])
def test_a_cause_that_takes_away_three_quarters_of_what_is_left_matters(after, kept):
    """Of a mismatch of which it is a ten-millionth."""
    assert compare().matters(model(100.0, CREEP), model(after, CREEP, GAIN)) is kept


@pytest.mark.parametrize("after, kept", [(74.0, True), (76.0, False)])
def test_a_harmonic_matters_from_a_quarter_on(after, kept):
    assert compare().matters(model(100.0, PITCH), model(after, PITCH, HARMONIC)) is kept
    assert not compare().matters(model(100.0, CREEP), model(after, CREEP, PITCH))


def test_what_is_left_of_noise_is_nothing_to_take_away():
    assert not compare().matters(model(1.1, CREEP), model(0.2, CREEP, GAIN))


@pytest.mark.parametrize("without, kept", [(37.0, True), (35.0, False)])
def test_a_cause_without_which_nine_times_as_much_is_left_is_no_form_error(monkeypatch, without, kept):
    """Although the size of another law's error would allow it."""
    full, bare = model(4.0, CREEP, GAIN), model(without, CREEP)
    full.fit.restarted = SimpleNamespace(without=lambda k: k)
    bare.fit.restarted = SimpleNamespace(without=lambda k: k)
    monkeypatch.setattr(pruning, "is_needed", lambda *_: True)
    weigh = SimpleNamespace(within_model_form_error=lambda *_: True)
    trials = SimpleNamespace(
        selection=weigh, tried=lambda structure, cause: [bare] if structure == 1 else [], objections=lambda *_: {}
    )
    assert (pruning.without_needless(trials, full) is full) is kept


@pytest.mark.parametrize("numbers, stays", [(200, True), (0, False)])
def test_what_the_uncertainty_of_the_numbers_adds_is_no_reason_to_withdraw(monkeypatch, numbers, stays):
    """Two squares a number: 1.05e4 squares against 1e4 of the device as described."""
    found, nominal = model(2.0, CREEP), model(2.0)
    found.fit.structure.free_parameters = (SimpleNamespace(cause=0),) * numbers
    found.fit.restarted = SimpleNamespace(without=lambda k: k)
    monkeypatch.setattr(pruning, "held_out_energy", lambda _, t: 1.05e4 if t.causes else 1e4)
    trials = SimpleNamespace(tried=lambda *_: [])
    assert (pruning.no_worse(trials, nominal, found) is found) is stays
