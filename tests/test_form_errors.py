"""Rivals that an error of form hides: what is left beyond noise, however many samples show it, tells laws apart by its size alone."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from fitted_causes import CREEP, DRIFT, GAIN, fitted
from misfits import errors_of, left, weighed_by

from ctrlgen.diagnosis.selection import form_errors
from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.form_errors import advantage_in_form, hidden_rivals
from ctrlgen.estimation.hypothesis import Hypothesis

STIFFER = Hypothesis("stiffening", "stage:axis", "axis")
ALIKE = np.exp(9 / 12)  # of squares: six samples on either kind of records, nine of T


@pytest.fixture(autouse=True)
def alike_beforehand(monkeypatch):
    monkeypatch.setattr(form_errors, "prior_odds", lambda fit: fit.odds)


def model(cause: Hypothesis, times: float, n: int = 1000, numbers: int = 1, odds: float = 0.0) -> CandidateModel:
    """A law that leaves so many times the noise's squares beyond the noise, and has so many numbers."""
    found = left(times * n, n)
    fit = fitted((cause,), free_parameters=(SimpleNamespace(cause=0),) * numbers)
    fit.odds, fit.restarted = odds, SimpleNamespace(without=lambda k: None)
    return CandidateModel(fit, errors_of(found), found, found, cause=cause)


def told(current: CandidateModel, *rivals: CandidateModel, known=True, objections=None, without=1000.0, asked=None):
    """The causes of the rivals that are hidden, where the device without the cause leaves so much; what each had to reach, of an objective
    of 100, is appended to `asked`."""
    n, fitter, asked = float(current.fitted.n_plain.sum()), weighed_by(known=known), [] if asked is None else asked
    fitter.initial_objective = lambda structure: 100.0
    trials = SimpleNamespace(
        fitter=fitter,
        objections=lambda t, accepted: objections or {},
        each=lambda function, items: [function(trials, t) for t in items],
        converged=lambda t, enough: asked.append(enough) or t,
        tried=lambda structure, cause: [model(GAIN, without, round(n))],
    )
    return [t.cause for t in hidden_rivals(trials, current, 0, rivals)]


@pytest.mark.parametrize("n", [1000, 1_000_000])
@pytest.mark.parametrize(("more", "hidden"), [(0.99, [STIFFER]), (1.01, [])])
def test_a_law_that_leaves_half_as_much_is_told_from_another_by_any_number_of_samples_or_by_none(n, more, hidden):
    assert told(model(GAIN, 10.0, n), model(STIFFER, 10.0 * ALIKE * more, n)) == hidden
    assert advantage_in_form(model(GAIN, 10.0, n), model(STIFFER, 10.0 * ALIKE, n)) == pytest.approx(9.0)


def test_further_numbers_and_rarity_count_as_everywhere():
    one = model(GAIN, 10.0)
    assert advantage_in_form(one, model(STIFFER, 10.0, numbers=3)) == pytest.approx(2 * np.log(6))
    assert advantage_in_form(one, model(STIFFER, 10.0, odds=-4.6)) == pytest.approx(9.2)
    assert told(one, model(STIFFER, 10.0, odds=-4.6)) == []


def test_nothing_is_hidden_where_noise_alone_is_left_or_is_not_known_or_where_something_speaks_against_it():
    near = model(STIFFER, 10.0)
    assert told(model(GAIN, 0.1), model(STIFFER, 0.1)) == []
    assert told(model(GAIN, 10.0), near, known=False) == []
    assert told(model(GAIN, 10.0), near, objections={0: "it is another law"}) == []


def test_a_function_of_time_follows_any_error_of_form_and_hides_behind_another_alone():
    assert told(model(GAIN, 10.0), model(DRIFT, 9.0)) == []
    assert told(model(DRIFT, 10.0), model(CREEP, 11.0)) == [CREEP]


@pytest.mark.parametrize(("leaves", "hidden"), [(10.2, [STIFFER]), (10.4, [])])
def test_beside_what_other_laws_leave_it_takes_away_nearly_as_much(leaves, hidden):
    """Of 13 without the cause and 10 with it, the rival nine tenths of 3: it leaves little more, as no law at all would."""
    assert told(model(GAIN, 10.0), model(STIFFER, leaves), without=13.0) == hidden


def test_the_same_law_is_fitted_to_its_end_once_and_from_where_it_leaves_least():
    near, far = model(STIFFER, 9.0), model(STIFFER, 30.0)
    assert told(model(GAIN, 10.0), far, near, model(CREEP, 8.0), model(GAIN, 5.0)) == [CREEP, STIFFER]


@pytest.mark.parametrize(
    ("times", "reach"), [(0.9, 100.0), (ALIKE * 0.99, 100.0), (ALIKE * np.exp(4 / 12), 100.0 * np.exp(-4 / 12))]
)
def test_its_fit_ends_where_it_cannot_come_near_enough(times, reach):
    asked = []
    told(model(GAIN, 10.0), model(STIFFER, 10.0 * times), asked=asked)
    assert asked == [pytest.approx(reach)]
