"""Records of a device that lacks nothing, with what sensors and data sheets do: spikes, coloured noise, a noise stated wrongly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import AXIS, NOISE, SETTLING, H, drives, fitter_of, move, record
from scipy.signal import lfilter, lsim

from ctrlgen.diagnosis.diagnose import diagnose_recording
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.estimation.noise import estimate_noise
from ctrlgen.estimation.noise_update import correct_stated_noise, update_guessed_noise, update_noise_colour
from ctrlgen.recordings.recording import Recording
from ctrlgen.recordings.validation import rows_between

N = 1500
LAWS = ("backlash", "coulomb", "creep", "drift", "force_step", "sensor_step", "stiffening", "thermal_lag", "vibration")


def white(rng, n: int) -> np.ndarray:
    return rng.standard_normal(n)


def spiked(rng, n: int) -> np.ndarray:
    """Normal, one sample of a thousand or two at four to six deviations."""
    e = rng.standard_normal(n)
    at = rng.choice(n, max(round(0.001 * n), 2), replace=False)
    e[at] = rng.uniform(4, 6, len(at)) * rng.choice([-1, 1], len(at))
    return e


def coloured(rng, n: int) -> np.ndarray:
    """Autoregressive, of the stated deviation."""
    return lfilter([np.sqrt(1 - 0.6**2)], [1, -0.6], rng.standard_normal(n + 100))[100:]


def recorded(noise, stated: float = NOISE, seed: int = 4, change=move) -> Recording:
    """A record to fit and one to hold out, with a stated noise and no rest."""
    rng = np.random.default_rng(seed)
    parts = tuple(
        record(u, change(u) + NOISE * noise(rng, N), role, first=k * N * H)
        for k, (u, role) in enumerate(zip(drives(N), ("fit", "hold_out"), strict=True))
    )
    return Recording("t", AXIS.name, "series", ("reading.axis",), ("um",), (stated,), parts, ())


@pytest.mark.long
@pytest.mark.parametrize(
    "noise, stated",
    [(white, 1.0), (spiked, 1.0), (coloured, 1.0), (white, 0.7), (white, 1.5), (spiked, 0.7)],
    ids=lambda value: getattr(value, "__name__", value),
)
def test_a_device_that_lacks_nothing_is_consistent(noise, stated):
    found = diagnose_recording(AXIS, recorded(noise, stated * NOISE), laws=LAWS)
    assert (found.verdict, found.findings) == (Verdict.CONSISTENT, ())


def ramped(u: np.ndarray) -> np.ndarray:
    """The exact response of m, c, k to a drive that is linear between samples."""
    system = ([[0, 1], [-2e5 / 0.5, -30 / 0.5]], [[0], [10 / 0.5]], [[1, 0]], [[0]])
    return lsim(system, u, H * np.arange(len(u)))[1]


@pytest.mark.long
def test_a_drive_that_is_linear_between_samples_is_no_mismatch():
    given = recorded(white, change=ramped)
    linear = tuple(replace(r, linear=True) for r in given.records)
    found = diagnose_recording(AXIS, replace(given, records=linear), laws=LAWS)
    assert (found.verdict, found.findings) == (Verdict.CONSISTENT, ())
    # Taken as held it is half a sample late
    assert diagnose_recording(AXIS, given, laws=("stiffening",)).verdict != Verdict.CONSISTENT


# --- a noise that is stated wrongly


def corrected(recording: Recording):
    """The noise as stated, and after what the device as described leaves."""
    fitter = replace(fitter_of(), recording=recording, noise=estimate_noise(recording, SETTLING))
    weighed, described = fitter.described(AXIS)
    return fitter.noise, correct_stated_noise(weighed, described)


@pytest.mark.parametrize("stated", [0.4, 0.5, 0.7, 0.9, 1.5, 2.0])
def test_a_noise_that_is_stated_wrongly_is_that_of_what_is_left(stated):
    before, after = corrected(recorded(white, stated * NOISE))
    assert before.sd[0] == pytest.approx(stated * NOISE)
    assert after.sd[0] == pytest.approx(NOISE, rel=0.05) and after.count[0] == 2 * N
    assert f"{stated:.2f}"[:3] in after.notes[0] and "taken as the noise" in after.notes[0]


@pytest.mark.parametrize("stated", [0.3, 0.99, 3.3])
def test_a_noise_stands_as_stated_where_it_is_right_or_far_off(stated):
    """Within 5 % data sheets round; beyond a factor of three it is another thing."""
    before, after = corrected(recorded(white, stated * NOISE))
    assert after is before


def test_what_is_not_white_or_follows_the_drive_is_no_noise():
    for change in (lambda u: move(u) + 6e-9 * u, lambda u: move(u) + 1e-8 * np.sin(np.arange(len(u)) / 40)):
        before, after = corrected(recorded(white, NOISE, change=change))
        assert after is before
    random = np.random.default_rng(8).uniform(-1, 1, N)
    for law in (np.square, lambda u: np.abs(np.gradient(u))):
        effect = law(random)
        effect = 6e-9 * (effect - effect.mean()) / effect.std()
        given = recorded(white, NOISE, change=lambda u, effect=effect: move(random) + effect)
        given = replace(given, records=tuple(replace(r, drive=random[:, None]) for r in given.records))
        before, after = corrected(given)
        assert after is before  # as white as noise, and goes with the square of the drive or with how fast it changes
    before, after = corrected(recorded(lambda rng, n: (1 + (np.arange(n) > n / 2)) * white(rng, n), NOISE))
    assert after is before  # its variance changes
    before, after = corrected(recorded(coloured, 0.7 * NOISE))
    assert after is before


@pytest.mark.parametrize("rows", [500, 1500])
def test_a_noise_that_is_stated_takes_its_colour_from_what_is_left_however_short_the_record(rows):
    given = recorded(coloured)
    recording = replace(given, records=tuple(rows_between(r, 0, rows) for r in given.records))
    fitter = replace(fitter_of(), recording=recording, noise=estimate_noise(recording, SETTLING))
    weighed, described = fitter.described(AXIS)
    after = update_noise_colour(weighed, described)
    assert after.ar[0][0] == pytest.approx(0.6, abs=0.15) and after.floor[0] == pytest.approx(NOISE, rel=0.1)


@pytest.mark.parametrize("missing", [0.0, 0.02])
def test_guessed_noise_is_told_by_residuals_that_lack_single_readings(missing):
    rng = np.random.default_rng(2)
    given = recorded(white)
    parts = []
    for r in given.records:
        valid = rng.random(r.valid.shape) >= missing
        parts.append(replace(r, valid=valid, observed=np.where(valid, r.observed, np.nan)))
    recording = replace(given, noise=(None,), records=tuple(parts))
    fitter = replace(fitter_of(), recording=recording, noise=estimate_noise(recording, SETTLING))
    assert fitter.noise.guessed.all()
    weighed, described = fitter.described(AXIS)
    after = update_guessed_noise(weighed, described)
    assert after.sd[0] == pytest.approx(NOISE, rel=0.1) and after.count[0] > 0.2 * N
