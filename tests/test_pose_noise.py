"""A noise of settled poses that was stated wrongly is that of what is left, where this is noise and nothing else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from misfits import noise_of, record
from recording_folders import SERVO, servo_poses

import ctrlgen
from ctrlgen.core.units import to_si
from ctrlgen.diagnosis.diagnose import diagnose_recording
from ctrlgen.diagnosis.prepared_recording import noise_before_fits
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.noise import NoiseSource
from ctrlgen.estimation.pose_noise import stated_pose_noise
from ctrlgen.model.assembly import build_model
from ctrlgen.recordings.reader import load_recordings

UNIT = to_si(1e-3, "deg")  # the noise


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    path: Path = tmp_path_factory.mktemp("table") / "table.toml"
    path.write_text(SERVO)
    return ctrlgen.load_device(path)


def recorded(table, folder, stated: float, seed: int, change=lambda u, e: 0.0):
    """Ninety poses with a noise of a millidegree, stated as a multiple of that; `change` (drive, noise) [m deg] is added."""
    recording = load_recordings([servo_poses(folder / str(seed), 0.0, seed)], build_model(table))
    records = tuple(
        replace(
            r, observed=r.observed + UNIT * change(r.drive, np.random.default_rng(seed).standard_normal(r.drive.shape))
        )
        for r in recording.records
    )
    return replace(recording, noise=(stated * UNIT,), records=records)


def corrected(table, recording):
    fitter = Fitter(recording, noise_before_fits(table, recording))
    weighed, described = fitter.described(table)
    return fitter.noise, stated_pose_noise(weighed, described)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("stated", [0.5, 2.0])
def test_half_or_twice_the_noise_is_corrected(table, tmp_path, stated, seed):
    before, after = corrected(table, recorded(table, tmp_path, stated, seed))
    assert before.sd[0] == pytest.approx(stated * UNIT)
    assert after.sd[0] == pytest.approx(UNIT, rel=0.25) and after.sources[0] is NoiseSource.RESIDUAL
    assert "of what is left" in after.notes[0]


@pytest.mark.parametrize("seed", range(6))
def test_the_right_noise_stands(table, tmp_path, seed):
    before, after = corrected(table, recorded(table, tmp_path, 1.0, seed))
    assert after is before


def by_direction(u, e):
    return 1.5 * np.sign(np.diff(u, axis=0, prepend=u[:1]))


LAWS = {
    "gain": lambda u, e: 3.0 * u,
    "square": lambda u, e: 3.0 * u**2,
    "direction": by_direction,
    "memory": lambda u, e: np.cumsum(0.5 * e, axis=0),
}


@pytest.mark.parametrize("law", LAWS)
def test_a_law_that_is_missing_is_no_noise(table, tmp_path, law):
    before, after = corrected(table, recorded(table, tmp_path, 0.8, 3, LAWS[law]))
    assert after is before


def test_poses_that_repeat_better_than_what_is_left_say_that_physics_is_left(table, tmp_path):
    """Every third pose is the one before again, and reads within a tenth of what is left."""
    recording = recorded(table, tmp_path, 0.5, 5)

    def repeated(r):
        drive, y, rng = r.drive.copy(), r.observed.copy(), np.random.default_rng(1)
        at = np.arange(1, len(drive), 3)
        drive[at] = drive[at - 1]
        y[at] = y[at - 1] + 0.1 * UNIT * rng.standard_normal((len(at), 1))
        return replace(r, drive=drive, observed=y + (drive - r.drive))

    given = replace(recording, records=tuple(map(repeated, recording.records)))
    before, after = corrected(table, given)
    assert after is before


def of_three_channels(*sizes: float, law: float = 0.0):
    """Noise of three channels, stated as one, after what is left of two records is `sizes` of it; the last has a square of the drive
    beside, `law` times it."""
    rng = np.random.default_rng(7)
    drives = [rng.uniform(-1, 1, (60, 1)) for _ in range(2)]
    parts = [
        record(role, 60, 3, rng.standard_normal((60, 3)) * sizes + law * u**2 * [0, 0, 1], u)
        for role, u in zip(("fit", "hold_out"), drives, strict=True)
    ]
    recording = SimpleNamespace(records=parts, units=("um",) * 3, channels=("reading.x", "reading.y", "reading.z"))
    stated = replace(noise_of(3), sources=(NoiseSource.STATED_WHITE,) * 3)
    fitter = SimpleNamespace(recording=recording, noise=stated, predict=lambda fit, r: np.zeros(r.observed.shape))
    return stated_pose_noise(fitter, SimpleNamespace(theta=np.zeros(3)))


def test_channels_whose_noise_is_stated_as_one_number_have_one_noise():
    assert of_three_channels(2.0, 2.0, 2.0).sd == pytest.approx(np.full(3, 2.0), rel=0.1)
    assert of_three_channels(1.0, 1.0, 1.0).sd == pytest.approx(np.ones(3), rel=1e-12)


def test_what_is_left_of_three_channels_is_no_noise_where_it_differs():
    """What is left of small laws that nothing tells, 1.3 and 1.9 times the noise of the third channel."""
    assert of_three_channels(1.3, 1.9, 1.0).sd == pytest.approx(np.ones(3), rel=1e-12)


def test_a_channel_that_holds_physics_has_the_noise_of_those_that_do_not():
    assert of_three_channels(2.0, 2.0, 2.0, law=20.0).sd == pytest.approx(np.full(3, 2.0), rel=0.15)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(4))
def test_a_table_that_lacks_nothing_is_consistent_with_half_its_noise_stated(table, tmp_path, seed):
    found = diagnose_recording(table, recorded(table, tmp_path, 0.5, seed), jobs=0)
    assert (found.verdict, found.findings) == (Verdict.CONSISTENT, ())
