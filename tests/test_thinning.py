"""Long records are thinned where that loses nothing, and where it would they are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import AXIS, KF, C, K, M
from scipy.signal import cont2discrete, dlsim

from ctrlgen import build_model
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.noise import estimate_noise
from ctrlgen.estimation.structure import FreeParameter, Structure
from ctrlgen.recordings import thinning
from ctrlgen.recordings.reader import load_recordings
from ctrlgen.recordings.recording import Record, Recording

STEP, GROUP, NOISE = (
    5e-6,
    20,
    5e-9,
)  # s of a row of the recorder, rows of a sample of the controller, noise of a reading [m]
FREE = {"mechanics.mass": "kg", "mechanics.damping": "N*s/m", "mechanics.stiffness": "N/m"}


def response(u, numbers=(M, C, K, KF)):
    """Position [m] of the axis under `u` [V], held from row to row."""
    m, c, k, k_f = numbers
    system = cont2discrete(tuple(map(np.array, ([[0, 1], [-k / m, -c / m]], [[0], [k_f / m]], [[1, 0]], [[0]]))), STEP)
    return dlsim(system, u)[1][:, 0]


def record_of(u, y, linear=False):
    n = len(u)
    return Record(
        "log.csv", "fit", STEP * np.arange(n), STEP, u[:, None], y[:, None], linear, None, np.ones((n, 1), bool)
    )


def swept(n, rng, rows=1):
    """A drive of many frequencies up to 150 Hz, held over so many rows."""
    t = STEP * rows * np.arange(-(-n // rows))
    f = np.geomspace(5, 150, 9)
    return np.repeat(np.sin(2 * np.pi * f * t[:, None] + rng.uniform(0, 6, 9)).sum(axis=1) / 4, rows)[:n]


@pytest.fixture
def long_log(rng):
    u = swept(50_000, rng, GROUP)
    return record_of(u, response(u) + NOISE * rng.standard_normal(len(u)))


def test_held_drives_are_kept_exactly_and_readings_averaged(long_log):
    can = thinning.thinnable(long_log, 1000)
    assert can.most == GROUP and can.group == GROUP
    thin = thinning.thinned(long_log, GROUP, can)
    assert np.array_equal(
        np.repeat(thin.drive[1:-1, 0], GROUP), long_log.drive[GROUP : GROUP * (len(thin.drive) - 1), 0]
    )
    clean = response(long_log.drive[:, 0])[np.round(thin.time / STEP).astype(int)]
    off = (thin.observed[:, 0] - clean)[thin.valid[:, 0]]
    assert 0.85 * NOISE / np.sqrt(GROUP) < np.std(off) < 1.15 * NOISE / np.sqrt(GROUP)  # of 2500 values within 5 %
    assert thin.sample_time == pytest.approx(GROUP * STEP) and abs(np.mean(off)) < NOISE / 50


def test_readings_that_follow_within_a_row_are_averaged_over_the_group_of_their_step(rng):
    u = np.repeat(rng.uniform(-1, 1, 2500), GROUP)
    clean = KF / K * u
    record = record_of(u[7:], (clean + NOISE * rng.standard_normal(len(u)))[7:])  # begins within a group
    can = thinning.thinnable(record, 1000)
    assert can.most == GROUP and can.at_once
    thin = thinning.thinned(record, GROUP, can)
    off = (thin.observed[:, 0] - KF / K * thin.drive[:, 0])[thin.valid[:, 0]]
    assert len(off) >= 2498 and 0.9 * NOISE / np.sqrt(GROUP) < np.std(off) < 1.1 * NOISE / np.sqrt(GROUP)
    drifting = record_of(
        u, clean + 3 * NOISE * np.repeat(np.diff(u[::GROUP], prepend=0), GROUP) * (np.arange(len(u)) % GROUP) / GROUP
    )
    assert (
        thinning.thinnable(
            replace(drifting, observed=drifting.observed + NOISE * rng.standard_normal((len(u), 1))), 1000
        ).most
        < GROUP
    )


def test_what_would_lose_something_is_left(long_log, rng):
    u, y = long_log.drive[:, 0], long_log.observed[:, 0]
    ringing = y + 2e-8 * np.exp(-(np.arange(len(u)) % 5000) / 300) * np.sin(
        0.6 * np.arange(len(u))
    )  # of 19 kHz, after each blow
    assert thinning.thinnable(record_of(u, ringing), 1000).most < GROUP
    steps = np.diff(u, prepend=u[:1])
    follows = y + 1e-3 * K**-1 * KF * np.convolve(steps, np.sin(0.5 * np.arange(GROUP)))[: len(u)]  # within each group
    assert thinning.thinnable(record_of(u, follows), 1000).most < GROUP
    white = rng.standard_normal(50_000)
    assert thinning.thinnable(record_of(white, response(white) + NOISE * rng.standard_normal(50_000)), 1000).most == 1
    gap = replace(long_log, time=long_log.time + 0.1 * (long_log.time > 0.1))
    assert "rows are missing" in thinning.thinnable(gap, 1000).why


def test_a_slow_curve_is_thinned_as_far_as_straight_lines_give_it(rng):
    t = STEP * np.arange(50_000)
    u = np.sin(2 * np.pi * 4 * t)
    y = KF / K * u + 50 * NOISE * rng.standard_normal(len(u))
    can = thinning.thinnable(record_of(u, y), 1000)
    assert can.group is None and can.most > 1
    thin = thinning.thinned(record_of(u, y), can.most, can)
    inner = thin.valid[:, 0]
    held_half_a_row_later = np.sin(2 * np.pi * 4 * (thin.time - STEP / 2))
    assert thin.linear and np.abs(thin.drive[inner, 0] - held_half_a_row_later[inner]).max() < 1e-5
    quick = np.sin(2 * np.pi * 4000 * t)
    assert thinning.thinnable(record_of(quick, KF / K * quick + NOISE * rng.standard_normal(len(u))), 1000).most == 1


def fitted(record, noise):
    """Numbers of the axis and their standard deviations."""
    recording = Recording("t", AXIS.name, "series", ("reading.axis",), ("um",), (noise,), (record,), ())
    known = dict(AXIS.quantities())
    free = tuple(
        FreeParameter(path, unit, known[path].si, 0.5 * known[path].si, 2 * known[path].si, known[path].si)
        for path, unit in FREE.items()
    )
    fit = Fitter(recording, estimate_noise(recording, 0.05)).fit(Structure(AXIS, free=free))
    return fit.theta, np.sqrt(np.diag(fit.covariance))


@pytest.mark.long
def test_a_fit_to_the_thinned_record_gives_the_same_numbers(long_log):
    """Of the 50,000 rows and of 2500: within the interval of either, which is as narrow."""
    can = thinning.thinnable(long_log, 1000)
    whole, sd = fitted(long_log, NOISE)
    thin, thin_sd = fitted(thinning.thinned(long_log, can.most, can), NOISE / np.sqrt(can.most))
    assert np.all(np.abs(thin - whole) < 1.96 * sd)
    assert np.all(np.abs(thin_sd / sd - 1) < 0.15)


def test_the_reader_thins_a_long_record_and_says_so(tmp_path, monkeypatch, long_log):
    monkeypatch.setattr(thinning, "LONG", 10_000)
    monkeypatch.setattr(thinning, "ENOUGH", 1000)
    y = 1e6 * long_log.observed[:, 0]
    y[7013] += 30
    rows = np.column_stack([long_log.time, long_log.drive[:, 0], y])
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header="t,u,y", comments="", fmt="%.9g")
    (tmp_path / "recording.toml").write_text(
        'title = "t"\ndevice = "flexure_axis"\nkind = "series"\n'
        + "".join(
            f'[[record]]\nfile = "log.csv"\nrole = "{role}"\nrows = {rows}\ntime = {{ column = "t", unit = "s" }}\n'
            for role, rows in (("fit", [0, 30_000]), ("hold_out", [30_000, 50_000]))
        )
        + '[columns]\n"drive.axis" = { column = "u", unit = "V" }\n'
        + '"reading.axis" = { column = "y", unit = "um", noise = "5 nm" }\n'
    )
    recording = load_recordings([tmp_path], build_model(AXIS))
    assert [len(r.time) for r in recording.records] == [1500, 1000], recording.notes
    said = [note for note in recording.notes if "thinned" in note]
    assert len(said) == 2 and "30000 rows are thinned to 1500, each the average of 20 readings" in said[0]
    assert "1 outlier or stuck reading was" in said[0]
    assert recording.noise[0] == pytest.approx(5e-9 / np.sqrt(GROUP))
