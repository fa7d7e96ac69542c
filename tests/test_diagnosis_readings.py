"""Causes in the readings: lattices, fringes, jumps, delays, and what noise says of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import (
    AXIS,
    LIMIT,
    NOISE,
    SETTLING,
    H,
    drives,
    fitter_of,
    move,
    record,
)
from scipy.signal import lfilter

from ctrlgen.diagnosis.selection.direct_detection import directly_detected_findings
from ctrlgen.diagnosis.selection.objections import objections
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.search import Searcher
from ctrlgen.diagnosis.selection.search_result import SearchResult
from ctrlgen.diagnosis.selection.spatial_periods import jump_positions, merged_periods, spatial_periods
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.effects import Place
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.noise import estimate_noise, stationary_deviation
from ctrlgen.estimation.residual_noise import noise_from_residual
from ctrlgen.estimation.residual_tests import run_residual_tests
from ctrlgen.estimation.settings import CANDIDATE_TERMS
from ctrlgen.estimation.structure import Structure
from ctrlgen.numerics.quantisation_step import quantisation_step
from ctrlgen.recordings.recording import Recording

FADING = Hypothesis("degradation", "actuator:axis", "axis")


def searched(fitter: Fitter, *hypotheses: Hypothesis) -> SearchResult:
    return Searcher(fitter, Screen(fitter, list(hypotheses)), lambda _: None).run(AXIS)


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
    first, *_ = spatial_periods(read, read - foreseen)
    assert first != near and near == spatial_periods(foreseen, read - foreseen)[0]
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


def test_a_number_that_only_rest_tells_makes_no_stage_restless():
    """The room warms by a kelvin at rest and hardly afterwards: a slope two deviations off its value leaves a ramp at rest, no motion."""
    plain = fitter_of()
    records = [
        replace(r, ambient=a, observed=r.observed + 1e-7 * a[:, None])
        for r in plain.recording.records
        for a in [np.linspace(0.0, 1.0 if r.role == "rest" else 0.02, len(r.time))]
    ]
    recording = replace(plain.recording, records=tuple(records))
    fitter = Fitter(recording, estimate_noise(recording, SETTLING))
    law = Hypothesis("temperature_sensitivity", "sensor:axis", "axis")
    fit = fitter.fit(Structure(AXIS).with_cause(law, {"slope": 1e-7, "reference": 0.0}))
    slope = [u.name for u in fit.structure.free_parameters].index("slope")
    theta = fit.theta.copy()
    theta[slope] = 1e-7 + 2 * np.sqrt(fit.covariance[slope, slope])
    assert run_residual_tests(fitter, replace(fit, theta=theta)).restless == ()
    theta[slope] = 1e-7 + 20 * np.sqrt(fit.covariance[slope, slope])
    assert run_residual_tests(fitter, replace(fit, theta=theta)).restless == ("reading.axis",)


@pytest.mark.parametrize("poles, said", [((0.5,), False), ((0.9, 0.9), True)])
def test_noise_so_slow_that_the_stage_may_move_is_said(poles, said):
    """One pole is a sensor's filter; what a mass does with a random force has two."""
    rng = np.random.default_rng(11)

    def wandering(y):
        return y + 3 * NOISE * lfilter([1.0], np.poly(poles), rng.standard_normal(len(y)))

    (sentence,) = fitter_of(after=wandering).noise.notes
    assert ("may be motion of the device" in sentence) == said


def test_a_reading_that_moves_with_the_surroundings_at_rest_is_no_noise():
    rng = np.random.default_rng(3)
    ambient = 0.5 * np.sin(np.arange(1500) * H / 0.4)
    y = NOISE * rng.standard_normal(1500) + 4e-8 * ambient
    for warmth, told in ((None, 4.0), (ambient, 1.0)):
        still = replace(record(np.zeros(1500), y, "rest"), ambient=warmth)
        recording = Recording("t", AXIS.name, "series", ("reading.axis",), ("um",), (None,), (still,), ())
        floor = estimate_noise(recording, SETTLING).floor[0] / NOISE
        assert floor == pytest.approx(1.0, rel=0.05) if told == 1.0 else floor > 1.5


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
        against = {} if part else {1: told}
        # both may have been told apart when they were accepted, and have moved together since
        assert objections(fitter.recording, fit) == objections(fitter.recording, fit, (fringe, once_more)) == against


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
