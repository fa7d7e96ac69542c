"""A rest within a record tells the noise as a record at rest does, and what still moves in a dwell is no noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from ctrlgen.estimation.noise import NoiseSource, estimate_noise
from ctrlgen.recordings.recording import Record, Recording

NOISE = 2e-9
SIGMAS = 4.0  # once in 16 000


def recording(*parts: tuple[np.ndarray, np.ndarray], h: float = 1e-3, stated: float | None = None) -> Recording:
    records = tuple(
        Record(
            f"r{k}", "fit", h * np.arange(len(u)), h, u[:, None], y[:, None], False, None, np.ones((len(u), 1), bool)
        )
        for k, (u, y) in enumerate(parts)
    )
    return Recording("t", "any", "series", ("reading.0",), ("um",), (stated,), records, ())


def moved(n: int, rest: int) -> np.ndarray:
    """A drive that rests at home and then never stands still."""
    t = np.arange(n - rest) / n
    return np.concatenate([np.zeros(rest), np.sin(2 * np.pi * 7 * t) + np.sin(2 * np.pi * 7 * np.sqrt(5) * t)])


@pytest.mark.parametrize("pole", [0.0, 0.8])
@pytest.mark.parametrize("rest", [300, 1000])
def test_a_rest_at_the_beginning_tells_the_noise_whatever_time_the_device_needs_to_settle(rest, pole, rng):
    """Nothing moved before it that would have to settle; of two records, of which one begins at rest."""
    n = 3000
    e = lfilter([1.0], [1.0, -pole], NOISE * rng.standard_normal(n + 200))[200:]
    u = moved(n, rest)
    found = estimate_noise(recording((u, 1e-6 * u + e), (u[rest:], 1e-6 * u[rest:])), 0.5)
    assert (
        found.sources[0] is NoiseSource.DWELLS and found.count[0] == rest + 1
    )  # the first moving sample is at home too
    # a polynomial of fourth degree takes five samples with it, more of what is slow
    assert found.sd[0] == pytest.approx(NOISE, rel=SIGMAS / np.sqrt(2 * rest) + 5 * (1 + pole) / (1 - pole) / rest)


def test_a_stage_that_still_swings_as_the_record_begins_tells_none(rng):
    """Until it has settled; where it never does, what moves fastest tells it."""
    n, rest = 4000, 1500
    u, t = moved(n, rest), np.arange(n)
    swing = 1e-6 * np.cos(0.3 * t) * np.exp(-t / 60)
    begun = estimate_noise(recording((u, 1e-6 * u + swing + NOISE * rng.standard_normal(n))), 5.0)
    assert begun.sources[0] is NoiseSource.DWELLS and begun.count[0] < rest - 60 * np.log(1e-6 / NOISE) / 2
    assert begun.sd[0] == pytest.approx(NOISE, rel=0.15)
    never = estimate_noise(recording((u, 1e-6 * u + 1e-9 * t + NOISE * rng.standard_normal(n))), 5.0)
    assert never.sources[0] is NoiseSource.FASTEST_PART


@pytest.mark.parametrize("loud", [3.0, 100.0])
def test_dwells_in_which_most_move_are_left_out(loud, rng):
    """Two rests, and eight dwells at whose beginning an amplifier still slews: of a stage without inertia, which settles at once."""
    slewing = np.maximum(0, 1 - np.arange(400) / 60) * loud * 40 * NOISE
    u = np.concatenate([np.zeros(600), np.repeat(rng.uniform(0.5, 1, 8), 400)])
    y = np.concatenate([np.zeros(600), *(slewing for _ in range(8))]) + NOISE * rng.standard_normal(len(u))
    found = estimate_noise(
        recording((u, y), (moved(900, 300), moved(900, 300) * 1e-6 + NOISE * rng.standard_normal(900))), 0.0
    )
    assert found.sources[0] is NoiseSource.DWELLS
    assert found.sd[0] == pytest.approx(NOISE, rel=SIGMAS / np.sqrt(2 * found.count[0]) + 5 / 300)


@pytest.mark.parametrize("times, stands", [(1.5, False), (10.0, True)])
def test_what_is_stated_stands_where_dwells_are_several_times_as_loud(times, stands, rng):
    """It is told that they are; a noise that is stated half as large is corrected by them."""
    u = np.repeat(rng.uniform(-1, 1, 8), 500)
    y = 1e-6 * u + times * NOISE * rng.standard_normal(len(u))
    found = estimate_noise(recording((u, y), stated=NOISE), 0.0)
    assert (found.sources[0] is NoiseSource.STATED_WHITE) == stands
    assert ("times that, which is taken for motion" in found.notes[0]) == stands
    assert found.sd[0] == pytest.approx(NOISE if stands else times * NOISE, rel=0.1)
