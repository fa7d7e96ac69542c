"""Periods along a path: which the sampling can tell, which it only feigns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import H, record
from conftest import SCENARIOS
from recovery import fitter_of

from ctrlgen import load_device
from ctrlgen.core.files import validate
from ctrlgen.devices import Device
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.search import Searcher
from ctrlgen.diagnosis.selection.spatial_periods import resolved_way, slowest_periods, spatial_periods
from ctrlgen.estimation.hypothesis import Hypothesis

LENGTH = 10e-3  # m


def sampled(kind: str, step: float, rng) -> np.ndarray:
    """Places [m] along a path of 10 mm at even speed, there and back, at two speeds, swinging, or between two rests."""
    there = np.arange(0.0, LENGTH, step)
    if kind == "even":
        return there
    if kind == "back":
        return np.concatenate([there, LENGTH - np.arange(0.0, LENGTH, rng.uniform(0.6, 1.0) * step)])
    if kind == "two speeds":
        return np.concatenate([there[there < LENGTH / 2], np.arange(LENGTH / 2, LENGTH, 0.63 * step)])
    if kind == "swinging":
        return LENGTH / 2 * np.sin(np.linspace(0, 4 * np.pi, int(4 * LENGTH / step)))
    speed = np.clip(np.linspace(0, 30, int(1.3 * LENGTH / step)), 0, 1) * step
    return np.concatenate([np.zeros(600), np.cumsum(speed), np.full(600, np.sum(speed))])


@pytest.mark.parametrize("kind", ["even", "back", "two speeds", "swinging", "rests"])
def test_of_any_pitch_sampling_and_noise_the_pitch_comes_first_and_no_image_of_it(kind):
    rng = np.random.default_rng(11)
    for samples_a_pitch in (2.6, 3.7, 10.0, 47.0):
        for pitch in LENGTH / np.array([31.0, 97.3, 250.9]):
            path = sampled(kind, pitch / samples_a_pitch, rng)
            error = 0.1 * pitch * np.sin(2 * np.pi * path / pitch + rng.uniform(0, 6))
            for noise in (0.001, 0.03):
                left = error + noise * pitch * rng.standard_normal(len(path))
                first, *others = spatial_periods(path, left)
                # a quarter of a cycle over the path
                assert LENGTH / first == pytest.approx(LENGTH / pitch, abs=0.25)
                assert others == []


@pytest.mark.parametrize("step", [2.5e-6, 7e-6])
def test_even_samples_tell_no_way_below_two_of_their_distances(step):
    path = np.arange(0.0, LENGTH, step)
    both_ways = np.concatenate([path, path[::-1] + 0.37 * step])
    assert resolved_way(path) == pytest.approx(2 * step, rel=1e-3)
    # the places of the way back lie between those of the way there
    assert resolved_way(both_ways) == pytest.approx(2 * step, rel=1e-3)
    shaken = path + step * np.random.default_rng(1).standard_normal(len(path))
    assert resolved_way(shaken) == 0.0


def test_a_lag_of_which_only_the_images_are_short_has_no_period():
    """Each way is late by the same, and the places of both interleave: at the distance of the samples both add up."""
    path = np.arange(0.0, LENGTH, 1e-5)
    there_and_back = np.concatenate([path, path[::-1] + 5e-6])
    late = np.repeat([1e-6, -1e-6], len(path))
    noise = 1e-8 * np.random.default_rng(2).standard_normal(len(late))
    assert spatial_periods(there_and_back, late + noise) == ()


def test_a_way_below_the_shortest_is_not_told():
    path = np.linspace(0.0, LENGTH, 20001)
    left = np.sin(2 * np.pi * path / 5e-5) + 0.1 * np.random.default_rng(3).standard_normal(len(path))
    assert spatial_periods(path, left, 4e-5) == (pytest.approx(5e-5, rel=1e-3),)
    assert spatial_periods(path, left, 6e-5) == ()


@pytest.mark.long
@pytest.mark.parametrize("pitch", [2.1e-4, 3.1e-4])
def test_a_pitch_of_which_a_short_stroke_holds_two_periods_is_found(pitch):
    """Approaches of half a millimetre, with rests, on a travel of 25 mm: the law's own starts begin at 1.25 mm."""
    table = {"kind": "servo", "name": "servo", "title": "an axis", "source": "round numbers", "travel": "25 mm"}
    device, parts, rng = validate(Device.library["servo"], table, "device"), [], np.random.default_rng(4)
    for turns, role in ((3, "fit"), (2, "hold_out")):
        stroke = np.r_[np.linspace(0, 5e-4, 100), np.full(150, 5e-4), np.linspace(5e-4, 0, 100), np.zeros(50)]
        u = 2e-2 + np.tile(stroke, turns)
        y = u + 1e-5 * np.sin(2 * np.pi * u / pitch + 0.7) + 1e-7 * rng.standard_normal(len(u))
        parts.append(record(u, y, role, h=H))
    fitter = fitter_of(device, ("reading.axis",), ("um",), (1e-7,), "series", parts)
    offered = [Hypothesis(kind, "sensor:axis", "axis") for kind in ("cyclic", "sensor_gain", "bow", "cubic_sensor")]
    chosen = Searcher(fitter, Screen(fitter, offered), lambda _: None).run(device).chosen
    assert [c.effect for c in chosen.causes] == ["cyclic"] and chosen.errors.is_noise
    assert chosen.fit.values(0)["period"] == pytest.approx(pitch, rel=1e-2)


def test_a_slow_pitch_is_sought_on_paths_that_are_short_beside_the_travel_alone():
    path = np.linspace(0, 1e-3, 100)
    left = np.sin(2 * np.pi * path / 4e-4) + 300 * path
    assert slowest_periods(path, left, 25e-3) == pytest.approx((4e-4,), rel=0.01)
    assert slowest_periods(path, left, 2e-3) == () and slowest_periods(path[:1], left[:1], 25e-3) == ()


@pytest.mark.parametrize("kind", ["cyclic", "cyclic_from_home"])
def test_of_a_reading_whose_typical_size_is_small_a_pitch_as_long_as_the_way_shows_is_looked_for(kind):
    """A platform that is typically moved by 1 um, over 500 um."""
    platform = load_device(SCENARIOS / "devices" / "meso_hexapod.toml")
    fringe = Hypothesis(kind, "sensor:delta_x", "delta_x")
    channel, (amplitude, period, _) = fringe.channel_on(platform), fringe.law.params
    usual = 2 * channel.scale
    for seen, longest in ((np.inf, usual), (usual / 8, usual), (1.5e-4, 1.5e-4)):
        told = replace(fringe, longest_period=seen)
        assert told.bounds(period, channel) == pytest.approx((1e-4 * channel.scale, longest))
        assert told.bounds(amplitude, channel) == pytest.approx((-longest / 4, longest / 4))
