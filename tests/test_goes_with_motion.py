"""Of noise that nothing tells, only what goes with the motion is physics: however large and slow the rest is."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from misfits import noise_of, record
from scipy.signal import lfilter

from ctrlgen.estimation import residual_tests
from ctrlgen.estimation.goes_with_motion import p_by_chance
from ctrlgen.estimation.held_out import HeldOutRefit
from ctrlgen.estimation.noise import NoiseSource
from ctrlgen.estimation.residual_tests import ResidualTests, run_residual_tests
from ctrlgen.recordings.recording import Recording

N = 500


def motion(rng: np.random.Generator) -> np.ndarray:
    """Three sines (N,) within one."""
    t = np.arange(N) * 1e-3
    x = sum(np.sin(2 * np.pi * f * t + p) for f, p in zip(rng.uniform(1.5, 20, 3), rng.uniform(0, 6, 3), strict=True))
    return x / np.abs(x).max()


def noise(rng: np.random.Generator, pole: float) -> np.ndarray:
    return lfilter([1.0], [1.0, -pole], rng.standard_normal(N))


def parts(seed: int, pole: float, size: float = 0.0) -> list:
    """Two records of noise with a kink of the reading in it."""
    rng = np.random.default_rng(seed)
    rows = []
    for _ in range(2):
        x, e = motion(rng), noise(rng, pole)
        rows.append((e + size * np.std(e) * 3 * np.maximum(x - 0.3, 0), np.ones(N, bool), x[:, None]))
    return rows


@pytest.mark.parametrize("pole", [0.0, 0.6, 0.95, 1.0])
def test_noise_of_any_colour_goes_with_no_motion(pole):
    """As often below a tenth as chance has it: of 20, seven or more once in 400."""
    p = np.array([p_by_chance(parts(seed, pole)) for seed in range(20)])
    assert p.min() > 1e-4 and np.count_nonzero(p < 0.1) < 7


@pytest.mark.parametrize("pole", [0.0, 0.6, 1.0])
def test_a_kink_goes_with_it(pole):
    assert max(p_by_chance(parts(seed, pole, 2.0)) for seed in range(3)) < 1e-4


def test_samples_that_are_not_valid_or_too_few_tell_nothing():
    spoilt = parts(1, 0.6)
    for e, good, _ in spoilt:
        good[100:110] = False
        e[100:110] = 1e6
    assert p_by_chance(spoilt) > 1e-4
    assert p_by_chance([(e[:40], good[:40], u[:40]) for e, good, u in parts(1, 0.6, 5.0)]) == 1.0


def judged(size: float, source: NoiseSource, monkeypatch) -> ResidualTests:
    """The tests of noise of pole 0.6 and deviation 1.25 where 1 is taken for it, with a kink in it, the model predicting the motion."""
    predicted, records = {}, []
    for role, (e, _, u) in zip(("fit", "hold_out"), parts(3, 0.6, size), strict=True):
        one = record(role, N, 1, u + e[:, None], u)
        records.append(one)
        predicted[role] = u
    recording = Recording("t", "any", "series", ("reading.axis",), ("um",), (1.0,), tuple(records), ())
    fit, n = SimpleNamespace(theta=np.zeros(1)), replace(noise_of(), sources=(source,))
    fitter = SimpleNamespace(
        noise=n,
        fit_records=records[:1],
        held_out_records=records[1:],
        recording=recording,
        predict=lambda _, r: predicted[r.role],
        whitened_residual=lambda _, r: r.observed - predicted[r.role],
    )
    monkeypatch.setattr(residual_tests, "refit_to_held_out", lambda *_: HeldOutRefit(fit, 0.0, 0.0))
    return run_residual_tests(fitter, fit)


def test_where_nothing_tells_the_noise_only_what_goes_with_the_motion_is_against_a_model(monkeypatch):
    told, guessed = (judged(0.0, source, monkeypatch) for source in (NoiseSource.REST, NoiseSource.FASTEST_PART))
    assert guessed.worst == told.worst > 1.1
    assert not told.passed and told.by_motion == {}
    assert guessed.passed and guessed.by_motion == {"reading.axis": guessed.p_values["motion"]}
    assert "size" not in guessed.p_values and "memory" not in guessed.p_values
    kinked = judged(3.0, NoiseSource.FASTEST_PART, monkeypatch)
    assert not kinked.passed and kinked.by_motion["reading.axis"] < 1e-4
