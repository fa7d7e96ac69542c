"""Spikes and held stretches that a missing law hides are marked against the model that explains; what a law does is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import AXIS, NOISE, H, drive, move, record

import ctrlgen
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.estimation.isolated_outliers import mark_again, mark_outliers, without_marks
from ctrlgen.estimation.noise import estimate_noise
from ctrlgen.estimation.pose_outliers import pose_outliers
from ctrlgen.estimation.spikes import marking_notes
from ctrlgen.recordings.recording import Recording
from ctrlgen.recordings.validation import ChannelNames, mark

N = 2000


def friction(t, q, v, memory):
    """Dry friction of 0.5 N that bends by 0.1 um first, ten times a sample: peaks at every reversal."""
    z = np.clip((memory or 0.0) + v * H / 10, -1e-7, 1e-7)
    return -0.5 * z / 1e-7, z


def bristle(t, q, v, memory):
    """Dry friction of 0.05 N by Dahl's law, bent by 0.5 um, forty times a sample."""
    z = memory or 0.0
    step = v * H / 40
    return -0.05 * z, z + (step - abs(step) * z) / 5e-7


def stop(t, q, v, memory):
    """Touched at the outermost micrometre of the travel."""
    return -4e6 * max(q - 8.5e-5, 0.0), memory


def stiffening(t, q, v, memory):
    return -2e13 * q**3, memory


LAWS = {"friction": friction, "stop": stop, "stiffening": stiffening, "none": None}


def recorded(law, rate: float, seed: int = 1, records=("fit", "hold_out")):
    """Two records of the axis with a law beside it, spikes at a `rate` of ten to two hundred deviations, and the clean readings."""
    rng, parts, clean, at = np.random.default_rng(seed), [], [], []
    for k, role in enumerate(records):
        u = drive(N) if role == "fit" else 1.6 * np.sin(2 * np.pi * 1.7 * np.arange(N) * H)
        y = move(u, law, fine=40 if law is bristle else 10)
        hit = np.flatnonzero(rng.random(N) < rate)
        spikes = np.zeros(N)
        spikes[hit] = NOISE * rng.uniform(12, 200, len(hit)) * rng.choice([-1, 1], len(hit))
        parts.append(record(u, y + NOISE * rng.standard_normal(N) + spikes, role, first=k * N * H))
        clean.append(y)
        at.append(hit)
    recording = Recording("t", AXIS.name, "series", ("reading.axis",), ("nm",), (NOISE,), tuple(parts), ())
    return recording, clean, at


def marks(recording: Recording) -> list[np.ndarray]:
    return [np.flatnonzero(~r.valid[:, 0]) for r in recording.records]


def of(recording, values):
    """The prediction that belongs to each record."""
    by_role = {r.role: v[:, None] for r, v in zip(recording.records, values, strict=True)}
    return lambda r: by_role[r.role]


@pytest.mark.parametrize("rate", [0.001, 0.01, 0.02])
@pytest.mark.parametrize("law", LAWS)
def test_spikes_that_a_law_hides_are_marked_once_it_is_known_on_every_record(law, rate):
    recording, clean, at = recorded(LAWS[law], rate)
    nominal = [move(r.drive[:, 0]) for r in recording.records]
    noise = estimate_noise(recording, 0.5)
    first = mark_outliers(recording, of(recording, nominal))
    again = mark_again(first, of(recording, clean), noise)
    for marked, hit, r in zip(marks(again), at, again.records, strict=True):
        assert np.isin(hit, marked).mean() >= 0.9  # three in a row are no isolated sample
        assert np.isin(marked, hit).all()
        assert len(r.spikes) == len(marked)


@pytest.mark.parametrize("law", ["friction", "stop", "stiffening"])
def test_a_law_that_is_still_missing_is_not_marked_away(law):
    recording, clean, _ = recorded(LAWS[law], 0.0)
    nominal = [move(r.drive[:, 0]) for r in recording.records]
    again = mark_again(
        mark_outliers(recording, of(recording, nominal)), of(recording, nominal), estimate_noise(recording, 0.5)
    )
    for r, y, described in zip(again.records, clean, nominal, strict=True):
        left = (y - described) ** 2
        assert left[~r.valid[:, 0]].sum() <= 0.002 * left.sum() and (~r.valid).mean() < 0.005


def test_more_than_isolated_faults_are_no_faults():
    recording, clean, _ = recorded(None, 0.05)
    again = mark_again(recording, of(recording, clean), estimate_noise(recording, 0.5))
    assert again is recording


def test_marks_that_the_accepted_model_explains_are_taken_back_and_told():
    """Peaks of one sample that a drive makes which the model of before did not know."""
    recording, clean, _ = recorded(None, 0.0)
    peaks = np.zeros(N)
    peaks[[300, 800, 1500]] = 60 * NOISE
    fit, held = recording.records
    recording = replace(recording, records=(replace(fit, observed=fit.observed + peaks[:, None]), held))
    first = mark_outliers(recording, of(recording, clean))
    assert marks(first)[0].tolist() == [300, 800, 1500]
    noise = estimate_noise(recording, 0.5)
    assert mark_again(first, of(recording, clean), noise) is first
    again = mark_again(first, of(recording, [clean[0] + peaks, clean[1]]), noise)
    assert not marks(again)[0].size and again.records[0].spikes == ()
    (note,) = marking_notes(first, again)
    assert "fit, reading.axis: 3 samples that were marked as outliers are used again" in note


def test_a_reading_that_validation_marked_comes_back_as_it_was():
    y = 1e-6 * np.sin(2e-3 * np.arange(N)) + NOISE * np.random.default_rng(1).standard_normal(N)
    y[[400, 900]] += 60 * NOISE
    given = record(0.01 * np.cos(2e-3 * np.arange(N)), y, "fit")
    names = ChannelNames(("drive.axis",), ("V",), ("reading.axis",), ("nm",))
    marked, _ = mark(given, "series", names, np.array([True]))
    assert np.flatnonzero(~marked.valid[:, 0]).tolist() == [400, 900]
    back = without_marks(marked)
    np.testing.assert_allclose(back.observed[:, 0], y, rtol=0, atol=1e-6 * NOISE)
    assert back.valid.all()


def coarse(law, held: bool):
    """Readings of a step of twice the noise, which repeat themselves anyway; the sensor of one record is held for 60 of them."""
    recording, clean, _ = recorded(law, 0.0)
    records = [replace(r, observed=np.round(r.observed / (2 * NOISE)) * 2 * NOISE) for r in recording.records]
    if held:
        stuck = records[0].observed.copy()
        stuck[700:760] = stuck[700]
        records[0] = replace(records[0], observed=stuck)
    return replace(recording, records=tuple(records)), clean


def test_a_stretch_in_which_a_coarse_sensor_is_held_is_marked_in_its_record_alone():
    recording, clean = coarse(friction, held=True)
    again = mark_again(recording, of(recording, clean), estimate_noise(recording, 0.5))
    ((first, last, channel),) = again.records[0].held
    assert channel == 0 and abs(first - 700) <= 2 and abs(last - 760) <= 2 and not again.records[1].held
    assert any("repeat one value while the device moves" in note for note in marking_notes(recording, again))
    assert mark_again(again, of(recording, clean), estimate_noise(again, 0.5)) is again


def test_a_stage_that_friction_holds_is_no_sensor_that_is_held():
    """Slow turns: friction that the model lacks holds the stage at each, and coarse readings repeat themselves."""
    u = 0.8 * np.sin(2 * np.pi * 1.1 * H * np.arange(N))
    y = move(u, friction) + NOISE * np.random.default_rng(2).standard_normal(N)
    given = record(u, np.round(y / (4 * NOISE)) * 4 * NOISE, "fit")
    recording = Recording("t", AXIS.name, "series", ("reading.axis",), ("nm",), (NOISE,), (given,), ())
    again = mark_again(recording, lambda r: move(r.drive[:, 0])[:, None], estimate_noise(recording, 0.5))
    assert all(not r.held for r in again.records)


def poses(n=120, channels=3, seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform(-1, 1, (n, 2)), rng.standard_normal((n, channels))


def test_a_pose_that_one_sensor_misread_is_marked():
    drive_, e = poses()
    e[[40, 77], [0, 2]] += [60.0, -40.0]
    assert np.argwhere(pose_outliers(drive_, e)).tolist() == [[40, 0], [77, 2]]


def test_of_an_accepted_model_as_many_poses_are_marked_as_chance_makes_of_the_largest_share():
    """Of 120 poses and a largest share of 3 %, 3.6 are expected and 7 are within chance; more are physics in some poses."""
    drive_, e = poses()
    for every, marked, of_described in ((40, 2, 2), (17, 7, 0), (13, 0, 0)):
        misread = e.copy()
        misread[every::every, 0] += 60.0
        assert pose_outliers(drive_, misread, of_accepted=True).sum() == marked
        assert pose_outliers(drive_, misread).sum() == of_described


@pytest.mark.parametrize("seed", range(20))
def test_normal_noise_has_no_outlying_pose(seed):
    drive_, e = poses(seed=seed)
    assert not pose_outliers(drive_, e).any()


def test_poses_in_which_something_acts_are_not_marked():
    drive_, e = poses()
    stop_, scratch_, bend = e.copy(), e.copy(), e.copy()
    stop_[np.argmax(drive_[:, 0]), 0] += 60.0
    near = np.argsort(np.linalg.norm(drive_ - drive_[50], axis=1))[:3]
    scratch_[near, 0] += 60.0
    bend[50] += 60.0
    for acted in (stop_, scratch_, bend):
        assert not pose_outliers(drive_, acted).any()


@pytest.mark.long
def test_friction_behind_spikes_is_explained_and_all_spikes_are_told():
    recording, _, at = recorded(bristle, 0.01, seed=4)
    found = ctrlgen.diagnose(AXIS, recording, laws=["coulomb", "stiffening", "creep", "clock_offset"], jobs=0)
    assert found.verdict == Verdict.EXPLAINED
    assert [f.effect for f in found.findings] == ["coulomb"]
    assert found.spikes[0].count == pytest.approx(sum(map(len, at)), abs=2)
