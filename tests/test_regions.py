"""Where along a motion most of a residual is: regions whose edges are found, and none where chance does as much."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from ctrlgen.diagnosis.selection.regions import Leftover, find_regions
from ctrlgen.diagnosis.settings import REGIONS

PLACES = np.random.default_rng(4).uniform(-1.0, 1.0, 6400)
CELL = 2.0 / REGIONS.cells


def left(inside: np.ndarray, ratio: float, seed: int = 5) -> Leftover:
    """Normal noise whose variance is `ratio` times as large inside; no free number."""
    noise = np.random.default_rng(seed).standard_normal((len(PLACES), 1))
    r = noise * np.sqrt(np.where(inside, ratio, 1.0))[:, None]
    return Leftover(r, np.zeros((*r.shape, 0)), np.zeros(0), np.zeros((0, 0)))


@pytest.mark.parametrize("edge", [-0.7, 0.0, 0.6])
@pytest.mark.parametrize("side", [1, -1])
def test_an_edge_is_found_to_a_cell_on_its_side_alone(edge, side):
    first, *others = find_regions(left(side * (PLACES - edge) > 0, 20.0), {"x": PLACES})["x"]
    assert (first.low if side > 0 else first.high) == pytest.approx(edge, abs=1.5 * CELL)
    assert all(np.isinf(region.high if side > 0 else region.low) for region in (first, *others))


def test_a_stretch_is_found_with_both_ends():
    inside = np.abs(PLACES - 0.3) < 0.1
    first, *_ = find_regions(left(inside, 9.0), {"x": PLACES}, ["x"])["x"]
    assert (first.low, first.high) == (pytest.approx(0.2, abs=1.5 * CELL), pytest.approx(0.4, abs=1.5 * CELL))


@pytest.mark.long
def test_noise_has_a_region_in_no_more_than_one_recording_of_twenty():
    """Of five quantities; one in a hundred is meant."""
    rng = np.random.default_rng(6)
    along = {k: rng.uniform(-1.0, 1.0, len(PLACES)) for k in range(4)} | {4: np.arange(float(len(PLACES)))}
    nowhere = PLACES > 2.0
    found = [bool(find_regions(left(nowhere, 1.0, seed), along, [0])) for seed in range(20)]
    assert sum(found) <= 1


def test_a_residual_with_memory_has_none_either():
    """Correlated over sixty samples; stretches shorter than that find a region in two recordings of five."""
    n = 3200
    time = np.arange(n) / 1e3
    place = np.sin(2 * np.pi * 2.3 * time) + 0.3 * np.sin(2 * np.pi * 13 * time)
    along = {"time": time, "place": place, "way": np.abs(place), "speed": np.abs(np.gradient(place))}
    J, found = np.stack([place, np.ones(n)], axis=1), 0
    for seed in range(20):
        r = lfilter([1.0], [1.0, -0.97], np.random.default_rng(seed).standard_normal(n))
        r -= J @ np.linalg.lstsq(J, r, rcond=None)[0]
        found += bool(find_regions(Leftover(r[:, None], J[:, None], np.zeros(0), np.zeros((0, 2))), along, seed=seed))
    assert found <= 2


def test_half_as_much_again_is_asked_whatever_chance_does():
    assert REGIONS.least_ratio == 1.5
    inside = PLACES > 0.2
    assert not find_regions(left(inside, 1.3), {"x": PLACES}) and find_regions(left(inside, 2.0), {"x": PLACES})


def test_numbers_follow_the_samples_outside():
    """A slope that the region bends: with it fitted to all samples as much is left outside as inside."""
    rng = np.random.default_rng(7)
    v = rng.standard_normal(len(PLACES))
    r = (3 * v * (PLACES > 0.0) + rng.standard_normal(len(PLACES)))[:, None]
    fitted = r - v[:, None] * (v @ r[:, 0]) / (v @ v)
    assert np.mean(fitted[PLACES > 0] ** 2) == pytest.approx(np.mean(fitted[PLACES < 0] ** 2), rel=0.1)
    nothing = np.zeros((0, 0))
    assert not find_regions(Leftover(fitted, np.zeros((len(v), 1, 0)), np.zeros(0), nothing), {"x": PLACES})
    held = Leftover(fitted, v[:, None, None], np.zeros(1), np.full((1, 1), 1e-3))
    first, *_ = find_regions(held, {"x": PLACES})["x"]
    edge = first.low if np.isinf(first.high) else first.high
    assert edge == pytest.approx(0.0, abs=1.5 * CELL)


def test_a_few_outliers_are_no_region():
    given = left(PLACES > 2.0, 1.0)
    given.residual[np.argsort(PLACES)[-5:]] = 1e3
    assert not find_regions(given, {"x": PLACES})


def test_a_drive_that_stands_or_a_short_record_has_no_regions():
    given = left(PLACES > 0, 20.0)
    assert not find_regions(given, {"x": np.zeros(6400)})
    few = REGIONS.cells * REGIONS.fewest_in_cell - 1
    short = Leftover(given.residual[:few], given.slopes[:few], given.prior, given.held)
    assert not find_regions(short, {"x": PLACES[:few]})
