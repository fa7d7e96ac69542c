"""Causes with corners, memories and steps, on recordings simulated without ctrlgen, ten steps a sample."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import (
    AXIS,
    BACKLASH,
    FINE,
    LATE,
    LIMIT,
    NOISE,
    SETTLING,
    H,
    drives,
    fine,
    fitter_of,
    move,
    played,
    record,
)
from misfits import errors_of, held_out_deviance, left, weighed_by
from scipy.signal import lfilter

from ctrlgen.diagnosis.selection.candidate_model import CandidateModel, SearchResult
from ctrlgen.diagnosis.selection.direct_detection import directly_detected_findings
from ctrlgen.diagnosis.selection.model_selection import ModelSelection
from ctrlgen.diagnosis.selection.objections import objections
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.search import Searcher
from ctrlgen.diagnosis.selection.spatial_periods import jump_positions, merged_periods, spatial_periods
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.effects import Place
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.held_out import refit_to_held_out
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.isolated_outliers import isolated_outliers
from ctrlgen.estimation.noise import estimate_noise, stationary_deviation
from ctrlgen.estimation.noise_update import update_guessed_noise
from ctrlgen.estimation.prediction_uncertainty import prediction_uncertainty
from ctrlgen.estimation.residual_noise import noise_from_residual
from ctrlgen.estimation.residual_tests import run_residual_tests
from ctrlgen.estimation.settings import CANDIDATE_TERMS
from ctrlgen.estimation.simulator import Simulator
from ctrlgen.estimation.structure import Structure
from ctrlgen.numerics.quantisation_step import quantisation_step
from ctrlgen.recordings.recording import Recording

FADING = Hypothesis("degradation", "actuator:axis", "axis")


def searched(fitter: Fitter, *hypotheses: Hypothesis) -> SearchResult:
    return Searcher(fitter, Screen(fitter, list(hypotheses)), lambda _: None).run(AXIS)


def test_play_is_followed_through_reversals_between_samples():
    fitter = fitter_of(played)
    fit = fitter.fit(Structure(AXIS).with_cause(BACKLASH, {"gap": 3e-8}))
    assert fit.theta[-1] == pytest.approx(6e-8, rel=0.05)
    assert fit.chi2 < 1.4 * fit.n  # the samples alone: 10 n
    n = sum(int(r.valid.sum()) for r in fitter.held_out_records)
    # The record rests first: inside the gap the slopes by the start say nothing of it
    assert held_out_deviance(fitter, fit) < 1.4 * n


def test_time_constants_are_found_decades_away():
    def creeping(u):
        y = move(u)
        lags = (lfilter([0, 1 - np.exp(-H / tau)], [1, -np.exp(-H / tau)], y) for tau in np.logspace(-1.7, 1.3, 10))
        return y + 0.003 * sum(lags)

    fitter = fitter_of(creeping)
    for tau in (0.01, 1.0):
        fit = fitter.fit(Structure(AXIS).with_cause(LATE, {"gain": 1e-3, "tau": tau, "decades": 3.25}))
        assert fit.chi2 < 1.15 * fit.n
        assert fit.theta[-2:] == pytest.approx([0.02, 3.3], rel=0.2)  # two a decade stand for ten in three


def test_a_limit_is_tried_below_the_largest_drive_of_the_records():
    level = 0.8 * np.abs(drives(1500)[0]).max()
    fitter = fitter_of(lambda u: move(np.clip(u, -level, level)))
    nominal = fitter.fit(Structure(AXIS))
    found = searched(fitter, LIMIT, FADING)
    assert [c.effect for c in found.chosen.fit.structure.causes] == ["saturation"]
    assert found.chosen.fit.values(0)["level"] == pytest.approx(level, rel=0.01)
    assert found.chosen.fit.chi2 < 0.1 * nominal.chi2


def test_readings_on_a_lattice_are_read_off_as_quantised():
    step = 10 * NOISE
    fitter = fitter_of(after=lambda y: step * np.round(y / step + 0.3))
    assert fitter.noise.floor[0] == pytest.approx(step / np.sqrt(12), rel=0.25)
    (found,) = directly_detected_findings(searched(fitter, FADING))
    assert (found.effect, found.location) == ("quantisation", "sensor:axis")
    assert found.parameters["quantum"].value == pytest.approx(step * 1e6, rel=1e-6)


def test_printed_digits_below_the_noise_are_no_finding():
    fitter = fitter_of(after=lambda y: np.round(y, 10))
    assert quantisation_step(fitter.fit_records[0].observed[:, 0]) == pytest.approx(1e-10)
    assert directly_detected_findings(searched(fitter, FADING)) == ()


def test_a_lattice_needs_every_reading_on_it():
    rng = np.random.default_rng(0)
    on = 0.3 + 0.07 * rng.integers(-500, 500, 400)
    assert quantisation_step(on) == pytest.approx(0.07)
    assert quantisation_step(on + 0.02 * rng.standard_normal(400)) < 1e-3
    assert quantisation_step(np.full(400, 2.0)) == 0.0


def test_levels_that_differ_by_rounding_are_one():
    on = 0.07 * np.random.default_rng(0).integers(-500, 500, 400)
    on[:2] = on.min(), on.min() * (1 + 1e-15)
    assert quantisation_step(on) == pytest.approx(0.07)


def test_a_few_readings_have_a_step_only_where_few_are_enough():
    on = 0.07 * np.arange(20)
    assert quantisation_step(on) == 0.0 and quantisation_step(on, fewest=20) == pytest.approx(0.07)


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


@pytest.mark.parametrize("a, shares", [(0.0, (0, 1)), (0.5, (0, 1)), (0.8, (0,))])
def test_noise_is_told_at_the_frequencies_at_which_the_readings_move_least(a, shares):
    """Also beside physics left out that is sixteen times as large, which makes it up to twice as large."""
    rng = np.random.default_rng(3)
    noise = lfilter([1.0], [1.0, -a], rng.standard_normal(4500))[500:]
    motion = lfilter([0.05], [1.0, -0.95], 1000 * rng.standard_normal(4000))
    left_out = lfilter([0.005], [1.0, -0.97], motion)
    total = 1 / np.sqrt(1 - a**2)
    for share in shares:
        sd, ar, worth = noise_from_residual(noise + share * left_out, motion)
        assert 0.85 * total < stationary_deviation(sd, ar) < (2.2 if share else 1.15) * total
        assert worth > 400
    assert noise_from_residual(noise + 20 * left_out, motion) is None  # physics at all frequencies tells no noise


def test_a_stretch_that_is_too_short_tells_no_noise():
    assert noise_from_residual(np.ones(150), np.ones(150)) is None
    assert noise_from_residual(np.zeros(500), np.ones(500)) is None


def test_a_guessed_noise_is_refined_by_what_the_device_leaves():
    """Nothing rests, repeats or dwells; the readings' own fastest part is motion, tens of times the noise."""
    fitter = fitter_of()
    moving = replace(fitter.recording, records=tuple(r for r in fitter.recording.records if r.role != "rest"))
    guess = estimate_noise(replace(moving, records=moving.records[:1]), SETTLING)
    assert guess.guessed[0] and guess.floor[0] > 3 * NOISE
    fitter = replace(fitter, recording=moving, noise=guess)
    noise = update_guessed_noise(fitter, fitter.fit(Structure(AXIS)))
    assert noise.floor[0] == pytest.approx(NOISE, rel=0.1) and "move least" in noise.notes[0]


def test_a_pitch_is_found_that_is_a_thousandth_of_the_path():
    """Six fringes pass between two samples, so that no spectrum over time shows it."""
    rng, pitch = np.random.default_rng(6), 1.58e-7
    t = np.arange(4000) * H
    path = 4e-5 * np.sin(2 * np.pi * 1.3 * t) + 2e-5 * np.sin(2 * np.pi * 7.7 * t)
    noise = 7e-9 * rng.standard_normal(len(t))
    first, *_ = spatial_periods(path + noise, noise + 5e-9 * np.sin(2 * np.pi * path / pitch + 0.4))
    assert first == pytest.approx(pitch, rel=1e-4)
    assert spatial_periods(path, noise) == ()
    assert spatial_periods(np.ones(50), noise[:50]) == ()


def test_fringes_that_bend_the_path_they_are_read_along_are_found_along_the_one_foreseen():
    pitch = 4e-7

    def fringed(u):
        y = move(u)
        return y + 0.3 * pitch * np.sin(2 * np.pi * y / pitch)

    fitter = fitter_of(fringed)
    fit = fitter.fit(Structure(AXIS))
    read = fitter.fit_records[0].observed[:, 0]
    foreseen = fitter.predict(fit, fitter.fit_records[0])[:, 0]
    near = pytest.approx(pitch, rel=1e-3)
    assert near not in spatial_periods(read, read - foreseen) and near in spatial_periods(foreseen, read - foreseen)
    suggested = Screen(fitter, []).data_hints(fit)(Place.SENSOR, 0).suggested["spatial_periods"]
    assert near in suggested and merged_periods([suggested, suggested]) == suggested


def test_the_harmonic_of_a_fringe_that_is_known_is_found_along_what_the_fringe_counts():
    """The fringe that is known already bends both the path read and the one foreseen with it."""
    pitch = 4e-7
    # A zero of J_0: of the harmonic nothing is left at its own way along such a path
    size = 2.405 * pitch / (4 * np.pi)

    def fringed(u):
        y = move(u)
        phase = 2 * np.pi * y / pitch
        return y + size * np.sin(phase) + 0.15 * size * np.sin(2 * phase + 0.6)

    fitter = fitter_of(fringed)
    fringe = Hypothesis("cyclic", "sensor:axis", "axis")
    known = Structure(AXIS, (fringe,), ({"amplitude": size, "period": pitch, "phase": 0.0},))
    fit = fitter.fit(known)
    read, foreseen = fitter.fit_records[0].observed[:, 0], fitter.predict(fit, fitter.fit_records[0])[:, 0]
    near = pytest.approx(pitch / 2, rel=1e-3)
    assert near not in spatial_periods(foreseen, read - foreseen) and near not in spatial_periods(read, read - foreseen)
    assert near in Screen(fitter, []).data_hints(fit)(Place.SENSOR, 0).suggested["spatial_periods"]


@pytest.mark.parametrize("place", [-6e-6, 1.5e-6, 1.1e-5])
def test_a_reading_that_jumps_at_a_place_is_found_there(place):
    """A straight ramp of 60 nm over 0.2 um, in a path of 40 um."""

    def stitched(y):
        return y + 6e-8 * np.clip((y - place) / 2e-7 + 0.5, 0, 1)

    fitter = fitter_of(after=stitched)
    assert np.ptp(fitter.fit_records[0].observed) > 2.5e-5
    error = Hypothesis("stitching_error", "sensor:axis", "axis")
    start = Screen(fitter, [error]).run(fitter.fit(Structure(AXIS))).suspects[0].start
    fit = fitter.fit(Structure(AXIS).with_cause(error, start))
    found = {u.name: value for u, value in zip(fit.structure.free_parameters, fit.theta, strict=True)}
    assert found["offset"] == pytest.approx(6e-8, rel=0.05)
    beside = np.sort(fitter.fit_records[0].observed[:, 0] - place)
    near = beside[beside < -1e-7][-1], beside[beside > 1e-7][0]  # the last reading before the ramp, the first beyond
    assert near[0] < found["position"] - place < near[1] and np.ptp(near) < 1e-6
    assert fit.chi2 < 1.1 * fit.n


def test_what_has_no_jump_suggests_no_jump_of_note():
    path = 4e-5 * np.sin(np.arange(4000) / 130)
    step = np.where(path > 1.3e-5, 2e-9, 0.0)
    assert jump_positions(path, step + 1e-4 * path)[0] == pytest.approx(1.3e-5, abs=4e-7)
    assert jump_positions(np.ones(50), np.zeros(50)) == ()


def test_what_moves_at_rest_is_no_noise():
    """A level that jumps at random is as large at rest as when held out; its innovations give it away."""
    jumps = np.random.default_rng(8)

    def telegraph(y):
        return y + 6 * NOISE * np.cumprod(np.where(jumps.random(len(y)) < 0.01, -1.0, 1.0))

    for after, restless in ((lambda y: y, ()), (telegraph, ("reading.axis",))):
        fitter = fitter_of(after=after)
        found = run_residual_tests(fitter, fitter.fit(Structure(AXIS)))
        assert found.restless == restless and found.passed == (not restless)


@pytest.mark.parametrize("poles, said", [((0.5,), False), ((0.9, 0.9), True)])
def test_noise_so_slow_that_the_stage_may_move_is_said(poles, said):
    """One pole is a sensor's filter; what a mass does with a random force has two."""
    rng = np.random.default_rng(11)

    def wandering(y):
        return y + 3 * NOISE * lfilter([1.0], np.poly(poles), rng.standard_normal(len(y)))

    (sentence,) = fitter_of(after=wandering).noise.notes
    assert ("may be motion of the device" in sentence) == said


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


def test_a_reading_that_moves_with_the_surroundings_at_rest_is_no_noise():
    rng = np.random.default_rng(3)
    ambient = 0.5 * np.sin(np.arange(1500) * H / 0.4)
    y = NOISE * rng.standard_normal(1500) + 4e-8 * ambient
    for warmth, told in ((None, 4.0), (ambient, 1.0)):
        still = replace(record(np.zeros(1500), y, "rest"), ambient=warmth)
        recording = Recording("t", AXIS.name, "series", ("reading.axis",), ("um",), (None,), (still,), ())
        floor = estimate_noise(recording, SETTLING).floor[0] / NOISE
        assert floor == pytest.approx(1.0, rel=0.05) if told == 1.0 else floor > 1.5


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
    assert np.abs(ends[delay, bow] - bent).max() < 0.02 * np.abs(bent - late).max()


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


def test_fringes_that_the_records_cannot_part_are_one():
    """They must part by half a period over the path that was read."""
    fitter = fitter_of()
    fringe = Hypothesis("cyclic", "sensor:axis", "axis")
    once_more = replace(fringe, count=1)
    path = max(float(np.ptp(r.observed)) for r in fitter.fit_records)
    for apart, part in ((0.3, False), (0.8, True)):
        starts = tuple({"amplitude": 1e-8, "phase": 0.0, "period": path / periods} for periods in (5.0, 5.0 + apart))
        fit = fitter.fit(Structure(AXIS, (fringe, once_more), starts), steps=0)
        told = "the records are too short to tell it from another line of its kind"
        assert objections(fitter.recording, fit) == ({} if part else {1: told})
        assert objections(fitter.recording, fit, (fringe, once_more)) == {}


TURNED = "its amplitude is so large beside its period that the reading would turn back"


@pytest.mark.parametrize("share, meant", [(0.9, True), (1.1, False)])
def test_a_fringe_that_turns_the_reading_back_is_none(share, meant):
    """Beyond A = Lambda/2 pi what repeats is no error of a reading: the aliases of a line in time look so."""
    fringe = Hypothesis("cyclic", "sensor:axis", "axis", highest=CANDIDATE_TERMS.highest_frequency / H)
    period = 2e-6
    fitter = fitter_of(after=lambda y: y + share * period / (2 * np.pi) * np.sin(2 * np.pi * y / period + 0.5))
    start = {"amplitude": 0.9 * share * period / (2 * np.pi), "period": period, "phase": 0.5}
    trials = Trials(fitter, Screen(fitter, [fringe]), lambda _: None)
    trial = trials.fit(Structure(AXIS).with_cause(fringe, start), steps=40)
    assert trial.fit.values(0)["amplitude"] == pytest.approx(share * period / (2 * np.pi), rel=0.02)
    assert trials.objections(trial) == ({} if meant else {0: TURNED})
