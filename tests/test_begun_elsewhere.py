"""A record whose first reading is where its first drive holds the device began while it ran."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import AXIS, KF, H, K, move, record
from conftest import DEVICES
from recovery import fitter_of
from scipy.signal import lfilter

from ctrlgen import build_model, diagnose, load_device, simulate
from ctrlgen.diagnosis.selection.model_selection import scored
from ctrlgen.diagnosis.selection.score_gradient import ScoreGradient, law_terms
from ctrlgen.effects import Effect
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import DataHints, Hypothesis
from ctrlgen.estimation.noise import estimate_noise
from ctrlgen.estimation.priors import prior_of
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.begun_elsewhere import begun_elsewhere
from ctrlgen.recordings.recording import Recording
from ctrlgen.recordings.validation import with_hold_out

N, NOISE = 1200, 1e-6


def flagged(*records):
    channels = ("reading.axis",)
    recording = Recording(
        "t", AXIS.name, "series", channels, ("um",), (None,), records, (), drive_units=("V",), drives=("drive.axis",)
    )
    return [r.resumed for r in begun_elsewhere(recording, build_model(AXIS)).records]


@pytest.fixture(scope="module")
def run():
    u = 1.5 + np.sin(2 * np.pi * 3.0 * H * np.arange(2 * N))
    return u, move(u)


def test_one_from_home_is_at_rest_whatever_its_first_drive(run):
    u, y = run
    assert abs(u[0]) > 1.0 and flagged(record(u, y, "fit")) == [False]


def test_one_cut_out_of_a_run_is_not(run):
    u, y = run
    assert flagged(record(u[N:], y[N:], "fit")) == [True]
    unread = record(u[N:], y[N:], "fit")
    hidden = np.where(np.arange(N)[:, None] < 5, np.nan, unread.observed)
    assert flagged(replace(unread, observed=hidden, valid=np.isfinite(hidden))) == [True]


def test_a_zero_that_is_off_by_a_tenth_of_the_motion_tells_nothing(run):
    u, y = run
    assert flagged(record(u, y + 0.1 * np.ptp(y), "fit")) == [False]


GAIN = KF / K  # m/V, settled


@pytest.mark.parametrize("way, told", [(0.48, False), (0.52, True)])
def test_one_nearer_to_where_its_drive_holds_it_than_to_home_is_not(way, told):
    u = 1.0 + 0.5 * np.sin(2 * np.pi * 3.0 * H * np.arange(N))
    y = GAIN * u
    assert flagged(record(u, np.r_[way * y[0], y[1:]], "fit")) == [told]


@pytest.mark.parametrize("first, told", [(0.048, False), (0.052, True)])
def test_one_that_is_hardly_held_anywhere_tells_nothing(first, told):
    """A twentieth of what the reading moves."""
    u = np.r_[first, 0.5 * np.sin(2 * np.pi * 3.0 * H * np.arange(2 * N))]
    assert flagged(record(u, GAIN * u, "fit")) == [told]


@pytest.mark.parametrize("begin, told", [(0, False), (50, True)])
def test_heaters_that_are_driven_by_their_voltage_hold_by_its_square(tmp_path, begin, told):
    """About 6 V the slope is three times the one by which the first drive, of 2 V, holds the device where it is."""
    file = tmp_path / "device.toml"
    text = (DEVICES / "mems_hexapod.toml").read_text()
    file.write_text(text.replace('drive = "power"', 'drive = "voltage"'))
    device = load_device(file)
    model = build_model(device)
    u = np.r_[np.full((60, 6), 2.0), np.full((200, 6), 7.0)]
    y = simulate(model, u, H).signals["reading"][1:]
    drives, readings = (tuple(f"{r}.{c}" for c in model.signals[r].channels) for r in ("drive", "reading"))
    recording = Recording(
        "t",
        device.name,
        "series",
        readings,
        6 * ("um",),
        6 * (None,),
        (record(u[begin:], y[begin:], "fit"),),
        (),
        drive_units=6 * ("V",),
        drives=drives,
    )
    assert [r.resumed for r in begun_elsewhere(recording, model).records] == [told]


def test_one_that_begins_where_the_drive_is_off_is_left(run):
    u, y = run
    still = np.concatenate([np.zeros(N), u])
    assert flagged(record(still, move(still) + 0.2 * np.ptp(y), "fit")) == [False]


def test_one_without_readings_or_without_motion_is_left(run):
    u, y = run
    blind = record(u, y, "fit")
    nothing = replace(blind, observed=np.full_like(blind.observed, np.nan), valid=np.zeros_like(blind.valid))
    assert flagged(record(u[N:], y[N:], "fit"), nothing, record(u, 0 * y, "fit")) == [True, False, False]


@pytest.mark.parametrize("resumed", [True, False])
def test_a_law_is_screened_from_where_it_has_settled_in_a_record_that_began_before_its_first_row(run, resumed):
    """From rest a lag would bring its beginning, which hides what it does later; a clock goes on as it is."""
    u, y = run
    suspected = [
        Hypothesis(law, f"{place}:axis", "axis")
        for law, place in (
            ("thermal_lag", "actuator"),
            ("drift", "sensor"),
            ("coulomb", "stage"),
            ("slew_rate", "actuator"),
        )
    ]
    part = replace(record(u[N:], y[N:], "fit", first=5.0), resumed=resumed)
    fitter = fitter_of(AXIS, ("reading.axis",), ("um",), (NOISE,), "series", [part, replace(part, role="hold_out")])
    terms = law_terms(AXIS, suspected, fitter.recording.channels, part.timing, N)
    fit = fitter.fit(Structure(AXIS), steps=0)
    slopes = ScoreGradient(fitter, fit, part, suspected, lambda *_: DataHints(), terms)
    begun, along = [], slopes.laws.along
    slopes.laws.along = lambda p, memories, *motion: (
        begun.append((len(set(motion[1][:, 0])), memories)) or along(p, memories, *motion)
    )
    lost = np.zeros(len(slopes.laws.terms), bool)
    list(slopes.blocks(fit.initial_states[0], lost))
    first = next(memories for drives, memories in begun if drives > 1)
    kinds = {slopes.laws.terms[places[0]].kind: k for k, (places, _) in enumerate(slopes.laws.groups)}
    slow = [p.shape["tau"] for p in slopes.columns if p.hypothesis.effect == "thermal_lag"]
    states = first[kinds["thermal_lag"]].reshape(-1, 3)[: len(slow)]
    quick = [s for s, tau in zip(states, slow, strict=True) if tau < 0.1]
    assert quick and quick == pytest.approx(np.full((len(quick), 3), u[N] if resumed else 0.0), rel=1e-6)
    clocks = [clock for k in slopes.laws.groups[kinds["drift"]][0] for clock in slopes.laws.terms[k].clocks]
    settle = {term.kind: term.settle for term in slopes.laws.terms}
    # dry friction is where the motion before left it; of what slews, what is delivered has a place of rest
    assert not any(settle["coulomb"]) and settle["slew_rate"][0]
    assert set(first[kinds["drift"]][clocks]) == {5.0}


@pytest.fixture(scope="module")
def filtered():
    """The stage in balance of a voice coil and its log, of which a filter of firmware lets an eighth of each new reading through; the stage
    had moved before the first row."""
    device = load_device(DEVICES / "parallelogram.toml")
    model, t = build_model(device), np.arange(2400) * H
    u = (
        0.2
        + 0.3 * np.sin(2 * np.pi * 1.3 * t)
        + 0.2 * np.sin(2 * np.pi * 7.7 * t + 1)
        + 0.1 * np.sin(2 * np.pi * 19 * t)
    )
    signal = model.signals["reading"]
    y = signal.channels.index("delta_x")
    followed = lfilter([1 / 8], [1, -7 / 8], simulate(model, u[:, None], H).signals["reading"][1:, y])
    read = (followed + NOISE * np.random.default_rng(1).standard_normal(len(u)))[400:]
    halves = [record(u[400:][a], read[a], role) for a, role in ((slice(1400), "fit"), (slice(1400, None), "hold_out"))]
    channels, drives = ("reading.delta_x",), tuple(f"drive.{c}" for c in model.signals["drive"].channels)
    recording = Recording(
        "t", device.name, "series", channels, ("um",), (NOISE,), tuple(halves), (), drive_units=("A",), drives=drives
    )
    return device, begun_elsewhere(recording, model)


def test_a_filter_of_firmware_in_a_log_of_a_settled_stage_is_found_whole(filtered):
    device, recording = filtered
    assert [r.resumed for r in recording.records] == [True, True]
    fitter, _ = Fitter(recording, estimate_noise(recording, 0.5)).described(device)
    assert fitter.error.rms[0] > 30 * NOISE
    low_pass = Hypothesis("low_pass", "sensor:delta_x", "delta_x")
    begun = {"share": 0.4, "tau": 8e-3, "damping": 0.7}
    fit = fitter.fit(Structure(device).with_cause(low_pass, begun))
    for _ in range(3):  # under what it leaves, as the search weighs a model that it accepts
        fitter = fitter.with_errors_of(fit)
        fit = fitter.fit(fit.restarted)
    values = fit.values(0)
    assert values["share"] == pytest.approx(7 / 8, abs=0.03)
    assert 2 * values["damping"] * values["tau"] == pytest.approx(8 * H, rel=0.1)
    left = scored(fitter, fit).held_out.plain_mean[0]
    assert left < 1.3  # of the noise


@pytest.mark.long
def test_it_stands_before_a_lag_of_heat_which_explains_alike(filtered):
    """The shares speak for timing. A filter of the reading and one of the drive are one behind such a stage, and either may stand first."""
    found = diagnose(*filtered, jobs=1)
    first = found.findings[0]
    others = {c.effect for c in first.alternatives}
    assert {first.effect, *others} >= {"low_pass", "amplifier_lag", "thermal_lag"} and first.effect != "thermal_lag"
    assert (first.support.family, first.support.contradicted, found.verdict) == ("timing", False, "ambiguous")
    assert found.search.chosen.causes[0].effect == first.effect


def test_a_stage_in_balance_whose_amplifier_slews_when_its_log_begins_is_behind_its_drive():
    """Far from home, where it is expected to have caught up: there the reading does not say how far it was behind."""
    device = load_device(DEVICES / "parallelogram.toml")
    u = 1.0 + 0.2 * np.sin(2 * np.pi * 3.0 * H * np.arange(400))
    part = replace(record(u, 0 * u, "fit"), resumed=True)
    structure = Structure(device).with_cause(
        Hypothesis("slew_rate", "actuator:coil", "coil"), {"share": 1.0, "rate": 6.0}
    )

    def fitter(part):
        parts = [part, replace(part, role="hold_out")]
        return fitter_of(device, ("reading.delta_x",), ("um",), (NOISE,), "series", parts)

    behind = fitter(part).simulator(structure, part).simulate(part, structure.start, np.array([0.7]))
    noise = NOISE * np.random.default_rng(2).standard_normal(behind.shape)
    told = replace(part, observed=behind + noise)
    (delivered,) = fitter(told).problem(structure).expected
    assert delivered == pytest.approx(1.0, abs=0.01)
    fit = fitter(told).fit(structure, steps=0)
    (begun,), left = fitter(told).begun(fit, told)
    assert begun == pytest.approx(0.7, abs=0.01) and np.std(told.observed - left) < 1.1 * NOISE


def test_the_rest_of_a_divided_record_goes_on(run):
    u, y = run
    parts = with_hold_out([record(u, y, "fit")], "series").records
    assert [(p.role, p.resumed) for p in parts] == [("fit", False), ("hold_out", True)]


@pytest.mark.parametrize("k, share", [(1, 1 / 2), (2, 3 / 4), (3, 7 / 8)])
def test_a_filter_of_firmware_lies_in_what_is_plausible_of_a_filter(k, share):
    """y += (new - y)/2^k lets 1/2^k of each new reading through at once: half of it, with k = 1, is no filter that is suspected."""
    low, high = prior_of(Effect.library["low_pass"]).parameters["share"].plausible_range
    assert (low <= share <= high) == (k > 1)
