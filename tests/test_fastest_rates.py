"""The fastest motion under rates of drives and lags of amplifiers, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import SCENARIOS
from scipy.optimize import brentq

import ctrlgen
from ctrlgen import build_model, load_scenario, solve, user_device
from ctrlgen.path_timing.curve import Curve
from ctrlgen.path_timing.fastest_page import write_fastest
from ctrlgen.path_timing.feasibility import Followed
from ctrlgen.path_timing.intersample_error import error_between
from ctrlgen.path_timing.maximum_velocity import steps_in_time
from ctrlgen.path_timing.optimum import Optimiser

STIFFNESS, GAIN, RADIUS, RATE = 1e6, 0.2, 10e-6, 2e4  # of `stage`: N/m, N/V, m, V/s


@pytest.mark.long
def test_a_circle_as_large_as_a_frequency_allows_takes_just_that_long(tmp_path):
    """0.2 %: scales are searched to 0.1 %. Its set-points are a scenario like any other, whose drives keep the limits."""
    found = ctrlgen.fastest(SCENARIOS / "circle20", sample_rate="10 kHz", frequency="50 Hz")
    largest = found.repetition.scale
    optimiser = Optimiser(found.solution.model, "pose", 1e-4)
    assert optimiser.along(found.curve.scaled(largest)).duration == pytest.approx(0.02, rel=2e-3)
    assert found.repetition.even < largest < 1
    assert found.repetition.even < found.repetition.sampled <= largest
    write_fastest(tmp_path, found)
    written = load_scenario(tmp_path / "at_frequency" / "scenario" / "circle20_repeated.toml")
    again = solve(written, build_model(written.device))
    assert len(again.command) == 200 and again.scenario.closed  # of 10 kHz, 50 times a second
    radius = np.ptp(again.command[:, 3]) / 2
    assert radius == pytest.approx(found.repetition.sampled * 10e-6, rel=1e-3)  # the largest of 200 points of a circle
    assert all(margin.distance >= 0 for margin in again.margins)


def both(rate):
    """The same rate of both drives [V/s]."""
    return {"x": f"{rate} V/s", "y": f"{rate} V/s"}


def stage(rate, **other):
    """A piezo X-Y stage, u = stiffness d/gain, whose drives change by `rate` at most."""
    words = dict(
        parameters={"gain": "0.2 N/V", "k": "1 N/um"},
        drive={"x": ("0 V", "150 V"), "y": ("0 V", "150 V")},
        axes={"x": ("-1 um", "30 um"), "y": ("-1 um", "30 um")},
        force=lambda u, p: p.gain * u.vector,
        restoring_force=lambda d, p: p.k * d.vector,
        drive_rate=rate,
    )
    return user_device("stage", **(words | other))


def lagging(rate):
    """The same with amplifiers that follow within 1 ms."""
    return stage(
        rate,
        parameters={"gain": "0.2 N/V", "k": "1 N/um", "tau": "1 ms"},
        state={"a": "150 V", "b": "150 V"},
        force=lambda x, p: [p.gain * x.a, p.gain * x.b],
        rates=lambda u, x, p: [(u.x - x.a) / p.tau, (u.y - x.b) / p.tau],
    )


ROUND = 'kind = "circle"\ndiameter = "20 um"\ncentre = { x = "15 um", y = "15 um" }\nplane = ["x", "y"]\n'
STRAIGHT = 'kind = "line"\nstart = { x = "5 um", y = "5 um" }\nend = { x = "15 um", y = "5 um" }\n'


def written(folder, device, path, rate="20 kHz"):
    text = f'title = "t"\ndevice = "{device.name}"\nfollow = "displacement"\nsample_rate = "{rate}"\nduration = "50 ms"\n[path]\n{path}'
    (folder / "scenario.toml").write_text(text)
    return load_scenario(folder, device)


def test_a_circle_under_rates_of_drives_takes_the_integral_of_the_faster_axis(tmp_path):
    """T = k R/(g r) int max(|sin|, |cos|) dphi = 4 sqrt(2) k R/(g r); at even speed 2 pi k R/(g r), less what chords cut off."""
    found = ctrlgen.fastest(written(tmp_path, stage(both(RATE)), ROUND))
    unit = STIFFNESS * RADIUS / (GAIN * RATE)
    assert found.optimum.duration == pytest.approx(4 * np.sqrt(2) * unit, rel=5e-3)
    assert found.even == pytest.approx(2 * np.pi * unit, rel=2e-2)
    assert {b.side.limit.name for b in found.bindings} == {"rate_x", "rate_y"}


def test_a_lag_under_a_rate_of_its_drive_takes_two_ramps(tmp_path):
    """From 25 V to 75 V, where the amplifier rests again: the drive rises for t1 and falls for t2, with the response of a lag to ramps."""
    found = ctrlgen.fastest(written(tmp_path, lagging(both(RATE)), STRAIGHT))
    tau, swing = 1e-3, STIFFNESS * 10e-6 / GAIN

    def left(t1):  # of the lag behind the drive, once the drive is where it ends: it must be zero
        t2 = t1 - swing / RATE
        behind = RATE * tau * (1 - np.exp(-t1 / tau))
        return -RATE * tau + (behind + RATE * tau) * np.exp(-t2 / tau)

    t1 = brentq(left, swing / RATE, 10e-3)
    assert found.optimum.duration == pytest.approx(2 * t1 - swing / RATE, rel=1e-2)


def test_a_lag_alone_takes_a_logarithm(tmp_path):
    """From 25 to 75 V behind an amplifier of 1 ms at its 150 V: tau ln((150 - 25)/(150 - 75)). 1e-4: trapezia over some hundred places."""
    found = ctrlgen.fastest(written(tmp_path, lagging(None), STRAIGHT, rate="200 kHz"))
    assert found.optimum.duration == pytest.approx(1e-3 * np.log(125 / 75), rel=1e-4)


@pytest.mark.parametrize("closed", [False, True])
def test_at_even_speed_every_sample_leads_as_far_also_beyond_the_end(closed):
    """Half a second for the path, 0.1 s a sample: a fifth of it, from its last place too."""
    share = np.linspace(0, 1, 11)
    steps = steps_in_time(share, share / 2, np.full(11, 2.0), 0.1, closed)
    assert steps == pytest.approx(np.full(11, 0.2))


@pytest.mark.long
def test_a_rate_that_never_binds_leaves_what_each_place_allows(tmp_path):
    """IPOPT over the whole path against the bound of each place: 0.5 %, of 216 intervals."""
    free = ctrlgen.fastest(written(tmp_path, lagging(None), ROUND))
    bound = ctrlgen.fastest(written(tmp_path, lagging(both(1e9)), ROUND))
    assert bound.optimum.duration == pytest.approx(free.optimum.duration, rel=5e-3)
    (piece,) = bound.optimum.pieces
    assert np.all(piece.speed <= piece.bound * (1 + 1e-6))


def test_between_set_points_the_distance_is_that_to_the_nearest_place_of_the_curve(tmp_path):
    """24 set-points round the circle, amplifiers with a lag of one sample: e^(-t/tau) written here, and the distance from a circle. 1 nm
    of 170: what the curve is more than its chords, R (1 - cos(pi/384)), is 0.3 nm; without the foot on the chord it would be 80."""
    scenario, h, turn = written(tmp_path, lagging(None), ROUND, "1 kHz"), 1e-3, np.linspace(0, 1, 25)
    model = build_model(scenario.device)
    curve = Curve(scenario, model)
    solution = solve(Followed.of(curve, model, scenario.file.sample_rate).scenario(turn, "t"), model)
    worst = np.zeros(2)
    for part in (0.25, 0.5, 0.75):
        u, volts = solution.drive, solution.trace.x
        off = GAIN / STIFFNESS * (u + (volts - u) * np.exp(-part * h / 1e-3)) - 15e-6
        away = off - RADIUS * off / np.linalg.norm(off, axis=1, keepdims=True)
        worst = np.maximum(worst, np.abs(away).max(axis=0))
    assert worst.min() > 50e-9 and error_between(curve, solution, turn) == pytest.approx(worst, abs=1e-9)


def test_a_circle_of_two_axes_of_unlike_size_is_divided_evenly(tmp_path):
    """Sizes of 30 um and 0.3 mm: equal steps along the circle are equal angles, as lengths of one kind count alike. 1e-6: its length is
    summed over 4000 chords."""
    device = stage(both(RATE), axes={"x": ("-1 um", "30 um"), "y": ("-0.01 mm", "0.3 mm")})
    share = Curve(written(tmp_path, device, ROUND), build_model(device)).evenly(36)
    assert share == pytest.approx(np.linspace(0, 1, 37), abs=1e-6)


def test_an_open_motion_lasts_from_its_first_sample_to_its_last_and_a_closed_one_a_period(tmp_path):
    """1000 samples of 50 us: 999 steps of a line, which stands at its first sample at the time zero; of a circle the last leads back."""
    for path, steps in ((STRAIGHT, 999), (ROUND, 1000)):
        scenario = written(tmp_path, stage(both(RATE)), path)
        assert len(scenario.bind(build_model(scenario.device)).samples) == 1000
        found = ctrlgen.fastest(scenario)
        assert found.given == pytest.approx(steps * 50e-6)
