"""Causes with corners, memories and steps, on recordings simulated by other code."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import (
    AXIS,
    BACKLASH,
    FINE,
    LATE,
    NOISE,
    SETTLING,
    H,
    fine,
    fitter_of,
    move,
    played,
)
from misfits import errors_of, held_out_deviance, left, weighed_by
from scipy.signal import lfilter

from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.model_selection import ModelSelection
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.estimation.fit import Fit
from ctrlgen.estimation.held_out import refit_to_held_out
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.isolated_outliers import isolated_outliers
from ctrlgen.estimation.noise import estimate_noise
from ctrlgen.estimation.noise_update import update_guessed_noise
from ctrlgen.estimation.prediction_uncertainty import prediction_uncertainty
from ctrlgen.estimation.residual_tests import run_residual_tests
from ctrlgen.estimation.settings import CANDIDATE_TERMS
from ctrlgen.estimation.simulator import Simulator
from ctrlgen.estimation.structure import Structure


def test_play_is_followed_through_reversals_between_samples():
    fitter = fitter_of(played)
    fit = fitter.fit(Structure(AXIS).with_cause(BACKLASH, {"gap": 3e-8}))
    assert fit.theta[-1] == pytest.approx(6e-8, rel=0.05)
    assert fit.chi2 < 1.4 * fit.n  # the samples alone: 10 n
    n = sum(int(r.valid.sum()) for r in fitter.held_out_records)
    # The record rests first: inside the gap the slopes by the start say nothing of it
    assert held_out_deviance(fitter, fit) < 1.4 * n


def test_time_constants_are_found_decades_away():
    """The record is shorter than the slowest ones: over how many decades they lie is known to two of them."""

    def creeping(u):
        y = move(u)
        lags = (lfilter([0, 1 - np.exp(-H / tau)], [1, -np.exp(-H / tau)], y) for tau in np.logspace(-1.7, 1.3, 10))
        return y + 0.003 * sum(lags)

    fitter = fitter_of(creeping)
    for tau in (0.01, 1.0):
        fit = fitter.fit(Structure(AXIS).with_cause(LATE, {"gain": 1e-3, "tau": tau, "decades": 3.25}))
        assert fit.chi2 < 1.15 * fit.n
        tau, decades = fit.theta[-2:]
        assert tau == pytest.approx(0.02, rel=0.2) and abs(decades - 3.0) < 2 * np.sqrt(fit.covariance[-1, -1]) < 5.0


def test_a_push_on_a_mass_is_no_spike():
    quiet = 0.1 * np.random.default_rng(0).standard_normal((900, 1))
    spikes, pushed = quiet.copy(), quiet.copy()
    spikes[[100, 400, 401], 0] += 30
    pushed[300:305, 0] += [8, 30, 40, 25, 9]
    assert np.flatnonzero(isolated_outliers(spikes)).tolist() == [100, 400, 401]
    assert not isolated_outliers(pushed).any()


def test_a_start_that_is_far_off_is_begun_again_near_off():
    """Under the discrepancy of the device as described, as every candidate is fitted."""
    fitter, nominal = fitter_of(played).described(AXIS)
    late = Hypothesis("low_pass", "sensor:axis", "axis")
    far = Structure(AXIS).with_cause(late, {"share": 1.5, "tau": 1.0, "damping": 0.3})
    assert fitter.fit(far, nested=nominal, steps=8).objective <= nominal.objective * 1.001


@pytest.mark.parametrize(
    "first, lost, fitted, sure, doubtful",
    [
        ("hysteresis", 0.3, 0.3, 50.0, True),  # a law of hysteresis leaves a fiftieth of itself, 0.4 of 1000 squares
        ("hysteresis", 0.5, 0.5, 50.0, False),
        ("hysteresis", 0.3, 100.0, 50.0, False),  # a tenth of what was fitted is no matter of form
        ("drive_gain", 0.3, 0.3, 50.0, False),  # a gain leaves nothing
        ("hysteresis", 9.0, 9.0, 1.5, True),  # where it may be nothing, a tenth of itself, 10 squares
        ("hysteresis", 11.0, 11.0, 1.5, False),
        ("drive_gain", 0.05, 0.05, 1.5, False),
    ],
)
def test_what_the_form_of_another_law_may_leave_is_given_no_name(first, lost, fitted, sure, doubtful):
    at = "actuator:axis" if first == "drive_gain" else "stage:axis"
    begin = {"gain": 0.1} if first == "drive_gain" else {"stiffness": 1e4, "reach": 3e-5, "taper": 0.5}
    structure = Structure(AXIS).with_cause(Hypothesis(first, at, "axis"), begin)
    structure = structure.with_cause(LATE, {"gain": 1.0, "tau": 1.0, "decades": 3.0})

    def candidate(fitted, held, of=structure):
        fit = Fit(of, of.start, (), 1500, 1500, np.zeros(0), sure * np.eye(len(of.start)), 0.0)
        return CandidateModel(fit, errors_of(left(fitted)), left(fitted), left(held))

    weigh = ModelSelection(weighed_by(), lambda *_, **__: [candidate(1000.0, 1000.0)])
    without, chosen = candidate(fitted, lost, structure.without(1)), candidate(0.0, 0.0)
    assert weigh.within_model_form_error(without, chosen, 1) == doubtful


def test_a_place_has_one_form_of_hysteresis():
    first, second = (Hypothesis(e, "stage:axis", "axis") for e in ("hysteresis", "bouc_wen"))
    elsewhere = Hypothesis("bouc_wen", "stage:other", "other")
    assert second.beside([first]) is None and first.beside([second]) is None
    assert second.beside([elsewhere, LATE]) is second


def test_a_guessed_noise_is_refined_by_what_the_device_leaves():
    """Nothing rests, repeats or dwells; the readings' own fastest part is motion, tens of times the noise."""
    fitter = fitter_of()
    moving = replace(fitter.recording, records=tuple(r for r in fitter.recording.records if r.role != "rest"))
    guess = estimate_noise(replace(moving, records=moving.records[:1]), SETTLING)
    assert guess.guessed[0] and guess.floor[0] > 3 * NOISE
    fitter = replace(fitter, recording=moving, noise=guess)
    noise = update_guessed_noise(fitter, fitter.fit(Structure(AXIS)))
    assert noise.floor[0] == pytest.approx(NOISE, rel=0.1) and "move least" in noise.notes[0]


def test_play_is_seen_by_what_it_does_at_finite_gaps():
    """The slope at no gap says little of a stage that creeps and swings about its goal."""
    fitter = fitter_of(played)
    fit = fitter.fit(Structure(AXIS))
    found = Screen(fitter, [BACKLASH]).run(fit).suspects[0]
    assert found.start["gap"] == pytest.approx(6e-8, rel=0.3)
    assert found.z**2 > 0.5 * (fit.objective - fit.n)


@pytest.mark.long
@pytest.mark.parametrize("rise", [3e-3, 2e-4])
@pytest.mark.parametrize("moment", [0.18, 0.87, 1.33])
def test_the_moment_of_an_event_is_the_middle_of_its_rise(moment, rise):
    """A force that sets in within three samples, or a fifth of one; it is given in steps of a tenth."""

    def pushed(u):
        t = np.arange(len(u) * FINE) * H / FINE
        return fine(u, 0.02 * np.clip((t - moment) / rise + 0.5, 0, 1) * (len(u) > 1000))[::FINE]

    fitter = fitter_of(pushed)
    event = Hypothesis("force_step", "disturbance:axis", "axis", highest=CANDIDATE_TERMS.highest_frequency / H)
    start = Screen(fitter, [event]).run(fitter.fit(Structure(AXIS))).suspects[0].start
    fit = fitter.fit(Structure(AXIS).with_cause(event, start))
    k = next(i for i, u in enumerate(fit.structure.free_parameters) if u.name == "moment")
    value, sd = fit.theta[k], np.sqrt(fit.covariance[k, k])
    assert abs(value - moment) < 3 * sd + H / FINE and sd < 1e-4


def test_a_drive_that_is_held_stays_held_through_its_sample():
    """A late share of a fast drive: the slope keeps most of what the share does."""
    lag = Hypothesis("thermal_lag", "actuator:axis", "axis")

    def late(u):
        slow = lfilter([0, 1 - np.exp(-H / 0.3)], [1, -np.exp(-H / 0.3)], u)
        return move(0.97 * u + 0.03 * slow)

    fitter, fit = fitter_of(late).described(AXIS)
    suspect = Screen(fitter, [lag]).run(fit).suspects[0]
    assert suspect.z**2 > 0.8 * (fit.objective - fit.n)


def test_numbers_that_the_fit_leaves_open_are_not_held_against_a_structure():
    fitter = fitter_of()
    fit = fitter.fit(Structure(AXIS))
    n = sum(int(fitter.noise.usable(r.valid).sum()) for r in fitter.held_out_records)
    off = replace(fit, theta=fit.theta * np.array([1.02, *np.ones(len(fit.theta) - 1)]))
    plain = sum(float(np.sum(fitter.whitened_residual(off, r) ** 2)) for r in fitter.held_out_records)
    poorly_determined = replace(off, J=off.J / 40)  # as if known 40 times worse
    assert plain > 1.5 * n
    assert held_out_deviance(fitter, poorly_determined) < 0.7 * plain
    assert held_out_deviance(fitter, fit) < held_out_deviance(fitter, off)


def test_a_number_that_nothing_holds_does_not_keep_the_others_where_they_are():
    fitter = fitter_of()
    fit = fitter.fit(Structure(AXIS))
    off = replace(fit, theta=fit.theta * np.array([1.02, *np.ones(len(fit.theta) - 1)]))
    poorly_determined = replace(off, J=off.J / 40 * (np.arange(off.J.shape[1]) != 1))
    assert held_out_deviance(fitter, poorly_determined) < 0.7 * held_out_deviance(fitter, replace(off, J=1e4 * off.J))
    moved = refit_to_held_out(fitter, poorly_determined).fit
    assert moved.theta[1] == off.theta[1] and np.all(moved.theta[[0, 2, 3]] != off.theta[[0, 2, 3]])


def test_what_slopes_that_left_the_numbers_say_is_not_called_sure(monkeypatch):
    fitter = fitter_of()
    fit = fitter.fit(Structure(AXIS))
    (record,) = fitter.held_out_records
    shape = (len(record.time), 1, len(fit.theta) + len(fit.initial_states[0]))
    monkeypatch.setattr(Simulator, "sensitivities", lambda *_: (record.observed, np.full(shape, np.nan)))
    assert np.array_equal(prediction_uncertainty(fitter, fit), [np.inf])


def test_what_uncertain_numbers_leave_is_what_numbers_drawn_from_it_leave(rng):
    fitter = fitter_of()
    fit = fitter.fit(Structure(AXIS))
    (record,) = fitter.held_out_records
    drawn = rng.multivariate_normal(fit.theta, fit.covariance, 200)
    off = [fitter.predict(replace(fit, theta=theta), record) - fitter.predict(fit, record) for theta in drawn]
    assert prediction_uncertainty(fitter, fit) == pytest.approx(np.sqrt(np.mean(np.square(off), axis=(0, 1))), rel=0.15)
    fixed = replace(fit, theta=np.zeros(0), J=np.zeros((len(fit.J), 0)))
    assert np.array_equal(prediction_uncertainty(fitter, fixed), [0.0])


def test_a_fit_is_judged_where_the_records_leave_its_numbers_and_by_what_it_fitted():
    fitter = fitter_of()
    fit = fitter.fit(Structure(AXIS))
    assert run_residual_tests(fitter, fit).passed
    off = replace(fit, theta=fit.theta * np.array([1.02, *np.ones(len(fit.theta) - 1)]))
    assert run_residual_tests(fitter, off).p_values["size"] < 1e-6
    open_ = replace(off, J=off.J / 1e4)  # as if nothing were known of it
    assert run_residual_tests(fitter, open_).p_values["size"] > 0.1
    assert not run_residual_tests(fitter, open_).passed  # the records to fit are left far from the numbers
    (fit_record,) = fitter.fit_records
    struck = replace(fit_record, observed=fit_record.observed + 1.5 * NOISE * np.sin(np.arange(1500) / 5)[:, None])
    alone = tuple(struck if r is fit_record else r for r in fitter.recording.records)
    found = run_residual_tests(replace(fitter, recording=replace(fitter.recording, records=alone)), fit)
    assert found.p_values["size"] > 0.01 and not found.passed  # what shows in the records to fit alone


def test_what_bends_a_reading_is_delayed_afterwards():
    delay, bow = Hypothesis("delay", "sensor:axis", "axis"), Hypothesis("bow", "sensor:axis", "axis")
    ends = {}
    for order in ((delay, bow), (bow, delay)):
        start = {delay: {"delay": 1.4e-3}, bow: {"curvature": 2e3}}
        s = Structure(AXIS, order, tuple(start[c] for c in order))
        fitter = fitter_of()
        simulator = s.simulator(fitter.recording.channels, fitter.fit_records[0].timing)
        ends[order] = simulator.simulate(fitter.fit_records[0], s.start)[:, 0]
    plain = Structure(AXIS, (delay,), ({"delay": 1.4e-3},))
    late = plain.simulator(fitter.recording.channels, fitter.fit_records[0].timing).simulate(
        fitter.fit_records[0], plain.start
    )[:, 0]
    assert np.array_equal(*ends.values())
    bent = late + 2e3 * late**2
    # but for the two samples that show what was before the record
    assert np.abs(ends[delay, bow] - bent)[2:].max() < 0.02 * np.abs(bent - late).max()


def test_fringes_count_in_what_a_bowed_scale_says():
    bow, fringe = Hypothesis("bow", "sensor:axis", "axis"), Hypothesis("cyclic", "sensor:axis", "axis")
    starts = {"curvature": 1e3}, {"amplitude": 3e-8, "period": 2e-6, "phase": 0.3}
    both = Structure(AXIS, (bow, fringe), starts)
    fitter = fitter_of()
    plain = (
        Structure(AXIS)
        .simulator(fitter.recording.channels, fitter.fit_records[0].timing)
        .simulate(fitter.fit_records[0], Structure(AXIS).start)[:, 0]
    )
    read = both.simulator(fitter.recording.channels, fitter.fit_records[0].timing).simulate(
        fitter.fit_records[0], both.start
    )[:, 0]
    said = plain + 1e3 * plain**2
    assert np.abs(said - plain).max() > 1e-7  # a twentieth of a fringe
    assert read == pytest.approx(said + 3e-8 * np.sin(2 * np.pi * said / 2e-6 + 0.3), abs=1e-13)
