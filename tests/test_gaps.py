"""Short gaps of a drive that tells what it did there are bridged; the others end a record."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import AXIS, NOISE, H, drive, move, record
from conftest import AXIS_FILE
from recorded import refused, samples, two
from scipy.signal import lfilter

import ctrlgen
from ctrlgen.core.counts import number_of
from ctrlgen.core.units import from_si
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.noise import estimate_noise
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings import gaps
from ctrlgen.recordings.after_gaps import Described
from ctrlgen.recordings.reader import load_recordings
from ctrlgen.recordings.recording import Record, Recording

N = 4000
t = H * np.arange(N)
KNOWN = {
    "sines": (drive(N), 1e-9),
    "chirp": (np.sin(2 * np.pi * (t + 10 * t**2)), 1e-6),
    "triangle": (np.abs((2 * t) % 2 - 1), 1e-3),  # two rows next to a corner
    "at rest": (np.zeros(N), 0.0),
    "levels, then a sweep": (np.where(t < 2, np.floor(t), np.sin(2 * np.pi * 8 * (t - 2) ** 2)), 1e-4),
    "clocked steps": (np.repeat(np.random.default_rng(5).choice([-1.0, 0.0, 1.0], N // 10), 10), 0.0),
    "twelve bits": (np.round(drive(N) * 512) / 512, 2e-3),
}
WHITE = np.random.default_rng(6).standard_normal(N)


def lacking(u: np.ndarray, rate: float = 0.01, seed: int = 1, role: str = "fit") -> tuple[Record, np.ndarray]:
    """A record of the drive whose rows are missing at a rate, and which are there."""
    there = np.random.default_rng(seed).random(len(u)) >= rate
    there[[0, -1]] = True
    whole = record(u, np.arange(len(u)), role)
    return gaps.rows_of(whole, there), there


@pytest.mark.parametrize("kind", KNOWN)
def test_a_drive_that_tells_what_it_did_is_bridged_and_told_in_one_note(kind):
    u, within = KNOWN[kind]
    given, there = lacking(u)
    (bridged,), notes = gaps.stretches(given)
    assert np.abs(bridged.drive[:, 0] - u).max() <= within * max(np.ptp(u), 1.0)
    assert np.array_equal(bridged.valid[:, 0], there) and np.isnan(bridged.observed[~there, 0]).all()
    np.testing.assert_allclose(bridged.time, t, atol=1e-12)
    runs = np.diff(np.flatnonzero(there)) - 1
    (note,) = notes
    assert f"{(runs > 0).sum()} gaps, the longest of {number_of(runs.max(), 'sample')}, are" in note


@pytest.mark.parametrize("rate", [0.003, 0.02])
def test_a_drive_that_nobody_knows_between_its_rows_is_not_made_up(rate):
    given, there = lacking(WHITE, rate)
    parts, notes = gaps.stretches(given)
    assert sum(len(p.time) for p in parts) <= there.sum() and len(parts) > 5
    assert all(np.isin(p.drive[:, 0], WHITE).all() for p in parts) and "not known across gaps" in notes[-1]


ROUGH = lfilter([1.0], [1.0, -2 * 0.94, 0.94**2], WHITE)  # noise through two poles of 1 Hz, sampled at 100 Hz
SERVO = """kind = "servo"
name = "s"
title = "S"
source = "a test"
travel = "60 um"
"""


def servo(tmp_path) -> Described:
    (tmp_path / "servo.toml").write_text(SERVO)
    model = ctrlgen.build_model(ctrlgen.load_device(tmp_path / "servo.toml"))
    return Described(model, ("reading.axis",), {"reading.axis": NOISE})


@pytest.mark.parametrize("longest", [1, 7])
def test_a_rough_drive_is_bridged_where_the_readings_after_it_hardly_notice(longest, tmp_path):
    """Off by half a per cent of its range in a row, by some per cent in seven: nothing of it is left in a memory of seconds."""
    u = 20e-6 * ROUGH / np.abs(ROUGH).max()
    there = np.ones(N, bool)
    for k in range(60, N - 60, 400):
        there[k : k + longest] = False
    whole = record(u, u + NOISE * WHITE, "fit", h=0.01)
    (bridged,), (note,) = gaps.stretches(gaps.rows_of(whole, there), device=servo(tmp_path))
    off = np.abs(bridged.drive[:, 0] - u).max() / np.ptp(u)
    assert 1e-3 < off < 0.1 and "by trials" in note
    behind = ~bridged.valid[:, 0] & there
    gone = np.flatnonzero(~there)
    assert 0 < behind.sum() <= 5 * (~there).sum() and f"nor of {behind.sum()} samples after them" in note
    assert all(gone[gone < k].max() + 5 * longest >= k for k in np.flatnonzero(behind))
    slow = 0.2 * np.exp(-np.arange(N) / 700) / 700
    left = [np.convolve(v, slow)[:N] for v in (bridged.drive[:, 0], u)]
    assert np.sqrt(np.mean((left[0] - left[1])[bridged.valid[:, 0]] ** 2)) < 0.3 * NOISE


@pytest.mark.parametrize("amplitude, pieces", [(0.003, 1), (1.0, 10)])
def test_a_stage_rings_after_a_gap_and_what_its_noise_hides_costs_nothing(amplitude, pieces):
    """The stage remembers a wrong drive for as long as it rings: readings that it changes by more than a part of their noise are not
    used, and the record is cut where those would be most of it."""
    u = amplitude * ROUGH / np.abs(ROUGH).max()
    there = np.ones(N, bool)
    there[60:-60:97] = False
    y = move(u)
    whole = record(u, y + NOISE * WHITE, "fit")
    device = Described(ctrlgen.build_model(AXIS), ("reading.axis",), {})
    parts, _ = gaps.stretches(gaps.rows_of(whole, there), device=device)
    assert len(parts) == 1 if pieces == 1 else len(parts) > pieces
    for part in parts:
        if pieces == 1:
            off = (move(part.drive[:, 0]) - y)[part.valid[:, 0]]
            assert np.sqrt(np.mean(off**2)) < 0.3 * NOISE and part.valid.mean() > 0.75


def test_a_jump_inside_of_a_gap_of_a_smooth_drive_is_not_bridged():
    u = np.sin(2 * np.pi * t) + (t >= 2.0)
    whole = record(u, u, "fit")
    parts, _ = gaps.stretches(gaps.rows_of(whole, ~np.isin(np.arange(N), [700, 1999, 2000, 3000])))
    assert [len(p.time) for p in parts] == [1999, 1999]


def test_a_long_gap_splits_and_short_ones_beside_it_are_bridged():
    there = np.ones(N, bool)
    there[[500, 900, 901, 3000]] = False
    there[1500:1700] = False
    parts, notes = gaps.stretches(gaps.rows_of(record(drive(N), drive(N), "fit"), there))
    assert [len(p.time) for p in parts] == [1500, 2300] and len(notes) == 2
    assert "3 gaps, the longest of 2 samples" in notes[0] and "cut before 1.7 s" in notes[1]


def test_a_gap_that_is_no_whole_number_of_samples_splits():
    u = drive(N)
    given = gaps.rows_of(record(u, u, "fit"), np.arange(N) != 2000)
    time = given.time.copy()
    time[2000:] += 0.4 * H
    parts, _ = gaps.stretches(replace(given, time=time))
    assert [len(p.time) for p in parts] == [2000, 1999]


@pytest.mark.parametrize("gap, value", [("linear", 1.5), ("held", 1.0)])
def test_what_the_file_says_of_a_gap_holds(gap, value):
    u = WHITE.copy()
    u[[99, 101]] = 1.0, 2.0
    given = gaps.rows_of(record(u, u, "fit"), np.arange(N) != 100)
    (bridged,), (note,) = gaps.stretches(given, gap)
    assert bridged.drive[100, 0] == value and f"taken as {gap} there" in note
    assert len(gaps.stretches(given, "split")[0]) == 2


@pytest.mark.parametrize("gap", ["held", "linear"])
@pytest.mark.parametrize("every", [2, 5, 50])
def test_readings_between_the_rows_of_a_slower_drive_are_used_where_the_file_says_how_it_goes(every, gap):
    u = drive(N)
    k = np.arange(N)
    last = k[-1] // every * every
    slow = np.where(k % every == 0, u, np.nan)
    given = record(slow, np.arange(N), "fit")
    assert len(gaps.stretches(given)[0]) == 0 or every == 2  # a drive that moves on in every row tells nothing of five
    (bridged,), notes = gaps.stretches(given, gap)
    stated = u[k // every * every] if gap == "held" else np.interp(k, k[::every], u[::every])
    n = len(bridged.time)
    assert n == last + 1 and bridged.valid.all()
    np.testing.assert_allclose(bridged.drive[:, 0], stated[:n], atol=1e-9)
    np.testing.assert_array_equal(bridged.observed[:, 0], np.arange(n))
    assert f"readings of {last - last // every} of them are used" in " ".join(notes)
    there = (k % 7 != 3) | (k % every == 0)
    (bridged,), _ = gaps.stretches(gaps.rows_of(given, there), gap)
    np.testing.assert_array_equal(bridged.valid[:, 0], there[:n])


def test_the_file_may_say_it_for_a_series_alone(tmp_path, model):
    kept = np.arange(400) != 200
    fit = {k: v[kept] for k, v in samples().items()}
    assert [len(r.time) for r in load_recordings([two(tmp_path, fit)], model).records] == [400, 400]
    parts = load_recordings([two(tmp_path, fit, gap="split")], model).records
    assert [len(r.time) for r in parts] == [200, 199, 400]
    faults = refused([two(tmp_path, fit, gap="spline")], model)
    assert "linear" in str(faults)


def test_a_row_without_a_number_for_one_drive_keeps_those_of_the_others(tmp_path, model):
    fit = samples()
    u = fit["u2X"].copy()
    fit["u2X"][[100, 101, 300]] = np.nan
    recording = load_recordings([two(tmp_path, fit)], model)
    first = recording.records[0]
    k = list(model.signals["drive"].channels).index("2X")
    np.testing.assert_allclose(first.drive[:, k], u, atol=1e-9)
    assert np.flatnonzero(~first.valid[:, 0]).tolist() == [100, 101, 300]


MEMORY = {
    "displacement_hysteresis": {"share": "0.03", "reach": "50 um", "taper": "0", "reversible": "0"},
    "backlash": {"gap": "0.2 um"},
    "creep": {"gain": "0.03", "tau": "0.2 s", "slow": "0.1"},
    "resonance": {"stiffness": "0.02 N/um", "frequency": "180 Hz", "damping": "0.02"},
}


def with_law(law: str):
    lines = "".join(f'{k} = "{v}"\n' for k, v in MEMORY[law].items())
    return f'[[effect]]\nkind = "{law}"\nat = "axis"\n{lines}'


@pytest.mark.long
@pytest.mark.parametrize("law", MEMORY)
def test_a_law_with_memory_is_fitted_across_gaps_as_without_them(law, tmp_path):
    (tmp_path / "true.toml").write_text(AXIS_FILE.read_text() + with_law(law))
    true = ctrlgen.load_device(tmp_path / "true.toml")
    model, rng = ctrlgen.build_model(true), np.random.default_rng(3)
    records = []
    for role, u in (
        ("fit", drive(N)),
        ("hold_out", 1.2 * np.sin(2 * np.pi * 1.7 * t) + 0.2 * np.sin(2 * np.pi * 29 * t)),
    ):
        y = ctrlgen.simulate(model, u[:, None], H).signals["reading"][:-1, 0] + NOISE * rng.standard_normal(N)
        records.append(record(u, y, role, first=0.0 if role == "fit" else N * H))
    (effect,) = true.effect
    start = {name: 1.2 * value.si for name, value in effect.values.items()}
    errors, pieces = [], []
    for whole in (True, False):
        parts = []
        for k, r in enumerate(records):
            there = np.random.default_rng(7 + k).random(N) >= (0.0 if whole else 0.01)
            parts += gaps.stretches(gaps.rows_of(r, there))[0]
        recording = Recording("t", AXIS.name, "series", ("reading.axis",), ("nm",), (NOISE,), tuple(parts), ())
        fitter = Fitter(recording, estimate_noise(recording, 0.5))
        fit = fitter.fit(Structure(AXIS).with_cause(Hypothesis(law, "stage:axis", "axis"), start))
        left = [(r.observed - fitter.predict(fit, r))[r.valid] for r in fitter.held_out_records]
        errors.append(np.sqrt(np.mean(np.concatenate(left) ** 2)))
        pieces.append(len(parts))
    assert pieces == [2, 2]
    assert from_si(errors[1], "nm") == pytest.approx(from_si(errors[0], "nm"), rel=0.1)
