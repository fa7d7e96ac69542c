"""An event in one stretch of one record is told by its place; a residual that goes with the motion is not."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from axis_records import AXIS, NOISE, N, drive, move, record

from ctrlgen import diagnose
from ctrlgen.diagnosis.evidence.gathered_residual import gathered_residual, shortest_window
from ctrlgen.diagnosis.report.narrative import contradicted, next_steps
from ctrlgen.diagnosis.report.where_it_is_left import FIT_ALONE, MORE_LEFT, held_out_agrees, more_left
from ctrlgen.recordings.recording import Recording


def seen(white: np.ndarray, motion: np.ndarray, name: str, poses: bool = False) -> SimpleNamespace:
    """A record of which so much is left, in multiples of the noise (n, n_y), while its readings (n, n_y) move so."""
    told = SimpleNamespace(time=1e-3 * np.arange(len(white)), observed=motion, name=f"day/{name}", poses=poses)
    return SimpleNamespace(record=told, white=white, usable=np.ones(white.shape, bool), poses=poses)


def records(readings: int, poses: bool, scale: float = 1.0) -> list[SimpleNamespace]:
    rng = np.random.default_rng(readings)
    n = 100 if poses else 900
    rows = range(3)
    moved = [np.sin(0.02 * (1 + k) * np.arange(n))[:, None] * np.ones(readings) for k in rows]
    return [seen(scale * rng.standard_normal((n, readings)), moved[k], f"run{k}.csv", poses) for k in rows]


@pytest.mark.parametrize("poses", [False, True])
@pytest.mark.parametrize("readings", [1, 2])
@pytest.mark.parametrize("which, first, share", [(0, 0.0, 0.2), (1, 0.4, 0.3), (2, 0.7, 0.3), (1, 0.0, 1.0)])
def test_an_event_is_told_by_its_record_and_its_time(which, first, share, readings, poses):
    """In one reading of several as well; where a whole record is off, by that record."""
    models = records(readings, poses)
    n = len(models[0].white)
    begin, end = round(first * n), round((first + share) * n)
    models[which].white[begin:end, 0] += 40.0
    told = gathered_residual(models)
    assert told is not None and told.record == f"run{which}.csv" and told.share >= 0.95
    times = (np.arange(n) + 1.0) if poses else models[which].record.time
    step = times[1] - times[0]
    slack = 0.06 * (end - begin) * step
    assert times[begin] - 1e-9 <= told.first <= times[begin] + slack
    assert times[end - 1] - slack <= told.last <= times[end - 1] + 1e-9
    assert told.n <= end - begin and told.of == 3 * n


@pytest.mark.parametrize("poses", [False, True])
def test_noise_and_what_is_everywhere_have_no_place(poses):
    assert gathered_residual(records(1, poses)) is None
    assert gathered_residual(records(2, poses, scale=30.0)) is None


def test_what_goes_with_the_motion_has_no_place():
    """A gain that is off leaves most where most is moved."""
    still, moving = np.full((900, 1), 0.01) * np.sin(np.arange(900))[:, None], np.sin(0.02 * np.arange(900))[:, None]
    models = [seen(100 * m, m, f"run{k}.csv") for k, m in enumerate((still, moving, still))]
    assert gathered_residual(models) is None
    models[0].white[:] = 0.0
    models[0].white[300:600] = 1000.0
    assert gathered_residual(models).record == "run0.csv"


@pytest.mark.parametrize("squares, least, told", [([1, 5, 5, 1], 10, (1, 2)), ([1, 1], 2, (0, 1)), ([1, 1], 3, None)])
def test_the_shortest_window_is_the_shortest(squares, least, told):
    assert shortest_window(np.array(squares, float), least) == told


def test_an_amplifier_that_trips_in_one_record_is_told_with_its_time():
    """The commanded drive is recorded, and no law is of a moment at which it does not act: the held-out record agrees."""
    rng, drives = np.random.default_rng(5), [drive(N), drive(N, 1.1, 0.5), drive(N, 1.3, 0.2)]
    acted = [u.copy() for u in drives]
    acted[1][1000:1400] = 0.0
    parts = [
        replace(record(u, move(a) + NOISE * rng.standard_normal(N), role, first=3.0 * k), name=f"run{k}.csv")
        for k, (u, a, role) in enumerate(zip(drives, acted, ("fit", "fit", "hold_out"), strict=True))
    ]
    found = diagnose(
        AXIS,
        Recording("t", AXIS.name, "series", ("reading.axis",), ("um",), (NOISE,), tuple(parts), ()),
        laws=["delay"],
    )
    there = found.residual_location.after.gathered
    assert there is not None and there.record == "run1.csv"
    # it rings on after
    assert 3.99 < there.first < 4.1 and 4.3 < there.last < 4.5
    assert more_left(found) in next_steps(found) and MORE_LEFT not in next_steps(found)


@pytest.mark.parametrize("refitted, after, findings, agrees", [
    (1.02, 50.0, (), True), (1.02, 1.0, (), False), (3.0, 50.0, (), False), (1.02, 50.0, ("one",), False),
])  # fmt: skip
def test_records_to_fit_that_are_other_than_those_held_out(refitted, after, findings, agrees):
    errors = {"reading.axis": SimpleNamespace(rms_after=after, rms_refitted=refitted, noise_floor=1.0)}
    assert held_out_agrees(SimpleNamespace(held_out=errors, findings=findings)) == agrees and FIT_ALONE


def test_numbers_that_contradict_the_file_are_named_before_they_are_used():
    assert all(
        path in contradicted(["mechanics.mass", "actuator.gain"]) for path in ("mechanics.mass", "actuator.gain")
    )
