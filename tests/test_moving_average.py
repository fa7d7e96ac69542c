"""A reading that is the mean over a window: by its definition, sample by sample as of a record as a whole, behind and before others."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from axis_records import AXIS, FINE, fine, record
from conftest import AXIS_FILE
from law_inputs import law_inputs
from scipy.interpolate import CubicSpline

from ctrlgen import build_model, simulate
from ctrlgen.core.files import validate
from ctrlgen.core.units import Quantity
from ctrlgen.devices import Device
from ctrlgen.effects import Apart, Effect
from ctrlgen.estimation.hypothesis import Hypothesis, nominal_physics
from ctrlgen.estimation.late_readings import LateSlopes, Signals, effects_apart, read_mean, sums_of_neighbours
from ctrlgen.estimation.priors import prior_of
from ctrlgen.estimation.settings import CANDIDATE_TERMS
from ctrlgen.estimation.simulator import Simulator
from ctrlgen.estimation.structure import Structure

H = 1e-3
WINDOWS = [0.4, 1.0, 3.7, 12.0]  # samples
MEAN = Hypothesis("moving_average", "sensor:axis", "axis", highest=CANDIDATE_TERMS.highest_frequency / H)
DELAY = Hypothesis("delay", "sensor:axis", "axis", highest=CANDIDATE_TERMS.highest_frequency / H)
TABLE = tomllib.loads(AXIS_FILE.read_text())
FILTERS = {
    "low_pass": {"share": "1", "tau": "2 ms", "damping": "0.7"},
    "high_pass": {"share": "1", "tau": "0.1 s"},
    "soft_coupling": {"share": "1", "frequency": "70 Hz", "damping": "0.3"},
}


def mean_of(y, samples: float, h: float, at: np.ndarray) -> np.ndarray:
    """The mean of a function over the window before each moment, by Simpson's rule in two thousand steps."""
    steps = np.linspace(0.0, samples * h, 2001)
    weights = np.ones(2001)
    weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
    return np.array([weights @ y(t - steps) for t in at]) / weights.sum()


def of_law(y, dy, samples: float, h: float, slopes: bool) -> float:
    """What the law makes of a function y at 19 h, kept sample by sample."""
    law = Effect.library["moving_average"]("all", {"window": Quantity(samples * h, "the window")})
    memory = {state.name: 0.0 for state in law.kept(h, free=False)}
    for k in range(20):
        rates = {"rate": dy(k * h), "second_rate": 0.0} if slopes else {}
        s = law_inputs(value=y(k * h), sample_time=h, **rates, **memory)
        memory |= law.update(s, None)
        s = s.with_states(memory)
    return float(s.value + ca.DM(law.term(s, SimpleNamespace(window=samples * h))))


@pytest.mark.parametrize("samples", [0.0, *WINDOWS])
def test_a_mean_is_exact_for_cubics_where_the_motion_gives_slopes_and_else_for_lines(samples, rng):
    for slopes, degree in ((True, 3), (False, 1)):
        y = np.polynomial.Polynomial(rng.uniform(-1, 1, degree + 1))
        exact = y.integ()
        wanted = (exact(19 * 0.3) - exact((19 - samples) * 0.3)) / (samples * 0.3) if samples else y(19 * 0.3)
        assert of_law(y, y.deriv(), samples, 0.3, slopes) == pytest.approx(wanted, rel=1e-11)


@pytest.mark.parametrize("samples", WINDOWS)
def test_a_mean_of_a_smooth_motion_is_as_near_as_its_polynomial(samples):
    """Of a sine of w h = 0.4: a part of a sample is off by (w h)^4/384 of the amplitude at most, whole ones by (w h)^4/720 and two ends."""
    w, t = 0.4 / H, H * np.arange(200)

    def y(t: np.ndarray) -> np.ndarray:
        return np.sin(w * t + 0.3)

    found, by_window = read_mean(Signals(y(t), w * np.cos(w * t + 0.3)), samples * H, H)
    off = found - mean_of(y, samples, H, t)
    most = 0.4**4 * (1 / 384 + 2 / 720) / max(samples, 1.0)
    assert np.abs(off[14:]).max() < most
    (lower, _), (upper, _) = (
        read_mean(Signals(y(t), w * np.cos(w * t + 0.3)), s * samples * H, H) for s in (0.9999, 1.0001)
    )
    slope = (upper - lower) / (2e-4 * samples * H)
    assert by_window[14:] == pytest.approx(slope[14:], abs=2e-4 * np.abs(slope).max())


def test_a_window_that_grows_makes_no_jump_at_a_whole_number_of_samples():
    w, t = 0.4 / H, H * np.arange(80)
    for rate in (None, w * np.cos(w * t)):
        for whole in (1.0, 2.0, 7.0):
            ends = [read_mean(Signals(np.sin(w * t), rate), D * H, H)[0][12:] for D in (whole - 1e-9, whole)]
            assert ends[0] == pytest.approx(ends[1], abs=1e-8)


def test_a_long_record_far_from_zero_loses_no_digits():
    """Nor does one that ran away before: a mean knows its window alone."""
    n, away = 20_000, 1e6
    t = H * np.arange(n)
    y = away * (1 + t) + np.sin(40 * t)
    found = read_mean(Signals(y, away + 40 * np.cos(40 * t)), 12.3 * H, H)[0]
    wanted = away * (1 + t - 6.15 * H) + (np.cos(40 * (t - 12.3 * H)) - np.cos(40 * t)) / (40 * 12.3 * H)
    assert np.abs(found - wanted)[15:].max() < 8 * np.finfo(float).eps * np.abs(y).max()
    lost = np.concatenate([np.full(50, 1e200), np.ones(n)])
    assert read_mean(Signals(lost), 12.0 * H, H)[0][70:] == pytest.approx(np.ones(n - 20), rel=1e-14)


@pytest.mark.parametrize("count", [1, 2, 5, 9, 10])
def test_sums_of_neighbours_are_those_of_each_window(count, rng):
    values = rng.standard_normal((10, 3))
    wanted = [values[k : k + count].sum(axis=0) for k in range(11 - count)]
    assert sums_of_neighbours(values, count) == pytest.approx(np.array(wanted), rel=1e-13)


def axis_reading(*effects: dict, u: np.ndarray) -> np.ndarray:
    """Read sample by sample, as the C has it."""
    device = validate(Device.library["axis"], TABLE | {"effect": [{"at": "axis", **e} for e in effects]}, "axis.toml")
    return simulate(build_model(device, sample_time=H), u[:, None], H).signals["reading"][: len(u), 0]


def wave(n: int = 300) -> np.ndarray:
    t = H * np.arange(n)
    return np.sin(2 * np.pi * 9 * t + 1) + 0.5 * np.sin(2 * np.pi * 41 * t)


@pytest.mark.parametrize("samples", WINDOWS)
def test_the_reading_of_an_axis_is_the_mean_of_where_it_was(samples):
    """Of exact steps of m, c, k, ten a sample."""
    u = wave()
    y = fine(u)
    area = CubicSpline(H / FINE * np.arange(len(y)), y).antiderivative()
    t = H * np.arange(60, len(u))
    wanted = (area(t) - area(t - samples * H)) / (samples * H)
    found = axis_reading({"kind": "moving_average", "window": f"{samples} ms"}, u=u)[60:]
    assert np.abs(found - wanted).max() < 2e-5 * np.ptp(y)


@pytest.mark.parametrize("kind", FILTERS)
@pytest.mark.parametrize("late", [{"kind": "delay", "delay": "2.4 ms"}, {"kind": "moving_average", "window": "3.6 ms"}])
def test_what_is_late_behind_a_filter_is_what_the_filter_gave(kind, late):
    u = wave()
    filtered = axis_reading({"kind": kind, **FILTERS[kind]}, u=u)
    found = axis_reading({"kind": kind, **FILTERS[kind]}, late, u=u)
    t = H * np.arange(len(u))
    spline = CubicSpline(t, filtered)
    wanted = spline(t[60:] - 2.4 * H) if "delay" in late else mean_of(spline, 3.6, H, t[60:])
    assert np.abs(found[60:] - wanted).max() < 2e-4 * np.ptp(filtered)


def simulators(monkeypatch, causes, starts) -> tuple[Simulator, Simulator, np.ndarray]:
    """One that reads afterwards, one that keeps each sample in its model, and the free numbers."""
    structure = Structure(AXIS, causes, starts)
    free = tuple(p.path for p in structure.free_parameters)
    quick = Simulator(structure.expanded_device, free, ("reading.axis",), H)
    monkeypatch.setattr("ctrlgen.estimation.simulator.effects_apart", lambda *_: ())
    return quick, Simulator(structure.expanded_device, free, ("reading.axis",), H), structure.start


CHAINS = {
    "mean": ((MEAN,), ({"window": 0.0},)),
    "mean that is sent": ((MEAN, DELAY), ({"window": 0.0}, {"delay": 2.3e-3})),
    "mean behind a filter": (
        (Hypothesis("low_pass", "sensor:axis", "axis"), MEAN),
        ({"share": 0.9, "tau": 2e-3, "damping": 0.7}, {"window": 0.0}),
    ),
}


@pytest.mark.parametrize("samples", WINDOWS)
@pytest.mark.parametrize("chain", CHAINS)
def test_a_mean_read_afterwards_is_that_of_a_model_that_keeps_each_sample(chain, samples, monkeypatch):
    """To rounding, slopes by the free numbers too."""
    causes, starts = CHAINS[chain]
    starts = tuple({**s, "window": samples * H} if "window" in s else s for s in starts)
    u = wave(120)
    given = record(u, 0 * u, "fit")
    quick, kept, p = simulators(monkeypatch, causes, starts)
    assert kept.n_s > quick.n_s + 2 * samples and quick.n_s <= 4
    (y, Y), (wanted, slopes) = quick.sensitivities(given, p), kept.sensitivities(given, p)
    known = slice(int(samples) + 8, None)
    assert np.abs(y - wanted)[known].max() < 1e-12 * np.abs(wanted).max()
    off, size = np.abs(Y - slopes)[known].max(axis=(0, 1)), np.abs(slopes).max(axis=(0, 1))
    assert np.all(off[: len(p)] < 1e-11 * size[: len(p)])
    for i in range(len(p)):
        step = 1e-6 * np.eye(len(p))[i] * max(abs(p[i]), 1e-3)
        ends = [quick.simulate(given, p + sign * step) for sign in (1, -1)]
        by_hand = (ends[0] - ends[1]) / (2 * step[i])
        assert Y[known, :, i] == pytest.approx(by_hand[known], abs=1e-5 * size[i])


def test_what_a_mean_shows_of_the_time_before_the_record_counts_like_what_follows():
    structure = Structure(AXIS, (MEAN, DELAY), ({"window": 4.6 * H}, {"delay": 3.0 * H}))
    quick = Simulator(structure.expanded_device, tuple(p.path for p in structure.free_parameters), ("reading.axis",), H)
    u, observed = wave(60), np.random.default_rng(1).standard_normal((60, 1))
    given = replace(record(u, 0 * u, "fit"), observed=observed)
    wrong = (observed - quick.simulate(given, structure.start))[:, 0]
    assert wrong[:8] == pytest.approx(wrong[16:8:-1])


@pytest.mark.parametrize("samples", WINDOWS)
def test_small_changes_are_averaged_block_by_block(samples, rng):
    changes = np.cumsum(rng.standard_normal((50, 2)), axis=0)
    parts, whole = LateSlopes(samples * H, H, Apart.MEAN), LateSlopes(samples * H, H, Apart.MEAN)
    found = np.vstack([parts.late(changes[:7]), parts.late(changes[7:9]), parts.late(changes[9:])])
    assert found == pytest.approx(whole.late(changes))
    line = 2.0 * np.arange(50.0)[:, None]
    assert LateSlopes(samples * H, H, Apart.MEAN).late(line)[16:] == pytest.approx(line[16:] - samples)


def test_a_mean_stays_in_the_model_where_something_else_follows_it():
    digits = Hypothesis("quantisation", "sensor:axis", "axis")
    rounded = {"quantum": 1e-8, "share": 1.0}
    for causes, starts, places in (
        ((MEAN, DELAY), ({"window": 2e-3}, {"delay": 2e-3}), (0, 1)),
        ((MEAN, digits), ({"window": 2e-3}, rounded), ()),
        ((MEAN, DELAY, digits), ({"window": 2e-3}, {"delay": 2e-3}, rounded), ()),
    ):
        structure = Structure(AXIS, causes, starts)
        free = [p.path for p in structure.free_parameters]
        assert effects_apart(structure.expanded_device, nominal_physics(AXIS), free) == places
    # there a window goes as far as the samples that are kept for it, and begins with more where it needs them
    structure = Structure(AXIS, (MEAN, digits), ({"window": 2e-3}, rounded))
    window = next(p for p in structure.free_parameters if p.name == "window")
    assert window.high == pytest.approx(8 * H)
    longer = structure.restarted(0, {"window": 20 * H}).with_room()
    assert longer.start[structure.free_parameters.index(window)] == 20 * H


def test_a_window_begins_where_it_is_as_late_as_the_law_that_it_takes_the_place_of():
    law = Effect.library["moving_average"]
    assert law.from_plainer({"delay": 3e-3}) == {"window": 6e-3}
    assert law.from_plainer({"share": 0.5, "tau": 2e-3, "damping": 0.7})["window"] == pytest.approx(2.8e-3)
    assert law.from_plainer({"share": -0.5, "tau": 2e-3, "damping": 0.7}) == {"window": 0.0}
    for plain in ("delay", "low_pass"):
        assert MEAN in Hypothesis(plain, "sensor:axis", "axis", highest=MEAN.highest).finer
    assert not prior_of(law).suspected and Effect.library["delay"].late_by == 2 * law.late_by
