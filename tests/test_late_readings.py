"""Readings that come late: of a record as a whole as sample by sample, and their age found whatever it is."""

from __future__ import annotations

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from axis_records import AXIS, NOISE, fine, record
from conftest import AXIS_FILE
from scipy.interpolate import CubicSpline

from ctrlgen import user_device
from ctrlgen.core.files import validate
from ctrlgen.core.units import Quantity
from ctrlgen.devices import Device
from ctrlgen.diagnosis.diagnose import diagnose_recording
from ctrlgen.diagnosis.selection.candidates import fit_other_clocks
from ctrlgen.diagnosis.selection.model_selection import scored
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.shifts import shifts_tried
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.effects import Effect
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import Hypothesis, hypotheses, nominal_physics
from ctrlgen.estimation.late_readings import LateSlopes, effects_apart, settling_time_of
from ctrlgen.estimation.noise import Noise, NoiseSource
from ctrlgen.estimation.simulator import Simulator
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Recording

H = 1e-3
LATE = Hypothesis("delay", "sensor:axis", "axis")
CLOCKS = Hypothesis("clock_offset", "recording:all", "all")
LOOP = {"position_gain": "60 1/s", "velocity_gain": "20 V/(m/s)", "integral_gain": "5e4 V/(m*s)"}


def late_axis(tau: float) -> tuple[Simulator, np.ndarray]:
    """A simulator of the axis whose reading is late by tau, which is free, and its number."""
    late = Structure(AXIS, (LATE,), ({"delay": tau},))
    paths = tuple(p.path for p in late.free_parameters)
    return Simulator(late.expanded_device, paths, ("reading.axis",), H), late.start


def driven(n: int):
    """A record of a drive of many frequencies; its readings do not matter."""
    t = H * np.arange(n)
    u = np.sin(2 * np.pi * 2.3 * t + 1) + 0.3 * np.sin(2 * np.pi * 13.1 * t) + 0.2 * np.sin(2 * np.pi * 41 * t)
    return record(u, 0 * u, "fit")


@pytest.mark.parametrize("samples", [0.3, 1.0, 7.6, 25.4])
def test_readings_that_are_late_are_those_of_a_model_that_keeps_each_sample(samples, monkeypatch):
    """To rounding, slopes too: the C and everything else that goes sample by sample has the latter."""
    given = driven(120)
    quick, p = late_axis(samples * H)
    monkeypatch.setattr("ctrlgen.estimation.simulator.effects_apart", lambda *_: ())
    kept, _ = late_axis(samples * H)
    assert kept.n_s >= 6 * samples and quick.n_s == 2  # velocity and place
    y, Y = quick.sensitivities(given, p)
    wanted, slopes = kept.sensitivities(given, p)
    known = slice(int(samples) + 2, None)  # before, the one knows nothing and the other was at home
    assert np.abs(y - wanted)[known].max() < 1e-12 * np.abs(wanted).max()
    off, size = np.abs(Y - slopes)[known].max(axis=(0, 1)), np.abs(slopes).max(axis=(0, 1))
    assert np.all(off[: len(p)] < 1e-12 * size[: len(p)])


def test_slopes_of_a_late_reading_are_its_differences():
    """By its age and by the initial states."""
    given = driven(200)
    quick, p = late_axis(7.6 * H)
    k, places = len(p), list(quick.free_initial_states)
    Y = quick.sensitivities(given, p, np.zeros(2))[1][:, :, k - 1 :]
    sizes = np.array([1e-7, *1e-3 * np.concatenate([quick.model.x_scale, quick.model.z_scale])[places]])
    for i, moved in enumerate(np.diag(sizes)):
        by_age = np.append(np.zeros(k - 1), moved[0])
        ends = [quick.simulate(given, p + sign * by_age, sign * moved[1:]) for sign in (1, -1)]
        assert (ends[0] - ends[1]) / (2 * sizes[i]) == pytest.approx(Y[:, :, i], abs=1e-6 * np.abs(Y[:, :, i]).max())


def test_what_a_late_reading_shows_of_the_time_before_the_record_counts_like_what_follows():
    """Eight samples are read as wrong as the eight behind them; where the reading is not valid, they say nothing."""
    given = driven(60)
    observed = np.random.default_rng(1).standard_normal((60, 1))
    quick, p = late_axis(7.6 * H)
    valid = given.valid.copy()
    valid[3] = False
    given = replace(given, observed=observed, valid=valid)
    wrong = (observed - quick.simulate(given, p))[:, 0]
    kept = np.arange(8) != 3
    assert wrong[:8][kept] == pytest.approx(wrong[16:8:-1][kept])


def test_small_changes_are_late_block_by_block(rng):
    changes = np.cumsum(rng.standard_normal((50, 2)), axis=0)
    parts = LateSlopes(3.4 * H, H)
    found = np.vstack([parts.late(changes[:7]), parts.late(changes[7:9]), parts.late(changes[9:])])
    assert found == pytest.approx(LateSlopes(3.4 * H, H).late(changes))
    line = 2.0 * np.arange(50.0)[:, None]
    assert LateSlopes(3.4 * H, H).late(line)[10:] == pytest.approx(line[10:] - 6.8)


def test_what_acts_behind_a_delay_or_on_it_in_a_loop_keeps_the_samples_in_the_model():
    digits = Hypothesis("quantisation", "sensor:axis", "axis")
    starts = {"delay": 2e-3}, {"quantum": 1e-8, "share": 1.0}
    for causes, places in (((LATE,), (0,)), ((LATE, digits), ())):
        structure = Structure(AXIS, causes, starts[: len(causes)])
        free = [p.path for p in structure.free_parameters]
        assert effects_apart(structure.expanded_device, nominal_physics(AXIS), free) == places
    looped = validate(Device.library["axis"], tomllib.loads(AXIS_FILE.read_text()) | {"loop": LOOP}, "looped.toml")
    physics = nominal_physics(looped)
    late, *_ = hypotheses(looped, physics, ("reading.axis",), H, False, [Effect.library["delay"]])
    assert late.bounds(late.law.amplitude(), late.channel_on(looped)) == (0.0, 8 * H)
    assert effects_apart(Structure(looped, (late,), ({"delay": 2e-3},)).expanded_device, physics) == ()


def test_the_noise_is_looked_for_without_building_a_delay_of_minutes():
    late = AXIS.model_copy(update={"effect": (Effect.library["delay"]("axis", {"delay": Quantity(600.0, "600 s")}),)})
    assert settling_time_of(late) == settling_time_of(AXIS) > 0


def late_recording(tau: float, n: int = 1500, seed: int = 3) -> Recording:
    """Readings late by tau, of motions ten times a sample between which a spline goes; the record to fit begins in full motion, the
    one to hold out at rest."""
    rng, before = np.random.default_rng(seed), 400
    t = H * np.arange(before + n)
    fit = 0.5 * np.sin(2 * np.pi * 2.3 * t + 1) + 0.4 * np.sin(2 * np.pi * 23 * t) + 0.3 * np.sin(2 * np.pi * 9.1 * t)
    risen = np.clip((t / H - before - 100) / 300, 0.0, 1.0)
    held = risen**2 * (0.6 * np.sin(2 * np.pi * 17 * t) + 0.5 * np.sin(2 * np.pi * 3.7 * t))
    parts = []
    for u, role in ((fit, "fit"), (held, "hold_out")):
        y = fine(u)
        late = CubicSpline(H * np.arange(len(y)) / 10, y)(t[before:] - tau)
        parts.append(record(u[before:], late + NOISE * rng.standard_normal(n), role))
    return Recording("t", AXIS.name, "series", ("reading.axis",), ("um",), (NOISE,), tuple(parts), ())


def fitter_of(recording: Recording) -> Fitter:
    known = Noise(np.array([NOISE]), (np.zeros(0),), (NoiseSource.STATED,), ("",), np.array([np.inf]))
    return Fitter(recording, known)


@pytest.mark.long
@pytest.mark.parametrize("samples", [1.0, 2.5, 7.0, 24.3, 45.0, 60.0])
def test_the_age_of_a_reading_is_found_whatever_it_is(samples):
    """The interval holds what was planted, and noise is all that is left, held out too."""
    fitter, described = fitter_of(late_recording(samples * H)).described(AXIS)
    trials = Trials(fitter, Screen(fitter, [LATE, CLOCKS]), lambda _: None)
    found = min(fit_other_clocks(trials, scored(fitter, described), ()), key=lambda t: t.fitted.excess)
    assert found.causes == (LATE,)
    plain = fitter_of(fitter.recording)
    fit = plain.fit(found.fit.restarted)
    sd = float(np.sqrt(fit.covariance[-1, -1]))
    assert abs(fit.theta[-1] - samples * H) < 3 * sd and sd < 0.01 * H
    assert fit.chi2 < 1.15 * fit.n and plain.held_out_squares(fit) < 1.3 * fit.n


@pytest.mark.long
@pytest.mark.parametrize("samples", [0.3, 25.0])
def test_a_late_reading_is_one_cause(samples):
    found = diagnose_recording(AXIS, late_recording(samples * H), jobs=0)
    (finding,) = found.findings
    assert finding.effect == "delay"
    low, high = finding.parameters["delay"].ci95
    assert low <= samples <= high and high - low < 0.2  # ms


def test_shifts_are_tried_a_sample_apart_and_farther_the_longer_they_are():
    tried = shifts_tried(H, 0.0, 1.0) / H
    assert tried[:16] == pytest.approx(np.arange(1, 17)) and 56 < tried[-1] <= 64
    assert np.all(np.diff(tried) <= np.maximum(1, tried[:-1] / 8))
    assert shifts_tried(H, 0.0, 3.4 * H) == pytest.approx([H, 2 * H, 3 * H])
    assert shifts_tried(H, 0.0, 0.4 * H) == pytest.approx([0.4 * H])


@pytest.mark.parametrize(("sample_time", "longest"), [(1e-3, 0.5), (1.0, 100.0), (5.0, 500.0)])
def test_a_process_that_is_read_every_few_seconds_may_be_late_by_minutes(sample_time, longest):
    """All its readings at once: the dead time of the drive."""
    tanks = user_device(
        "tanks",
        parameters={"rate": "0.01 1/s"},
        drive={"pump": "1 V"},
        axes={"first": "1 cm", "second": "1 cm"},
        state={"a": "1 cm", "b": "1 cm"},
        rates=lambda u, x, p: [p.rate * (0.01 * u.pump - x.a), p.rate * (x.a - x.b)],
        force=lambda x: [x.a, x.b],
        restoring_force=lambda d: d.vector,
    )
    there = [
        h
        for h in hypotheses(tanks, nominal_physics(tanks), ("reading.first", "reading.second"), sample_time, False)
        if h.effect == "delay"
    ]
    assert [h.location for h in there] == ["sensor:first", "sensor:second", "sensor:all"]
    for h in there:
        assert h.bounds(h.law.amplitude(), h.channel_on(tanks)) == (0.0, longest)
