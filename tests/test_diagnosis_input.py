"""Columns and wirings that are wrong: refused, named, or said to be no explanation; never a confident answer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import AXIS_FILE, MESO_FILE
from recording_folders import SERVO, axis_recording, poses_recording, servo_poses

import ctrlgen
from ctrlgen.core.errors import InputError
from ctrlgen.diagnosis.diagnosis_folder import diagnose_into
from ctrlgen.diagnosis.report.answer import sentence
from ctrlgen.diagnosis.report.narrative import next_steps
from ctrlgen.diagnosis.selection.verdict import Verdict

# The answer is the same, and quick
LAWS = (
    "creep",
    "drive_gain",
    "sensor_gain",
    "reversed",
    "stiffening",
    "stuck",
    "thermal_lag",
)


@pytest.fixture
def clean(tmp_path) -> Path:
    """A recording of the axis as its file describes it."""
    return axis_recording(tmp_path / "clean", AXIS_FILE.read_text())


def altered(folder: Path, role: str, change) -> None:
    """The readings (n,) of a record changed."""
    rows = np.loadtxt(folder / f"{role}.csv", delimiter=",", skiprows=1)
    rows[:, 2] = change(rows[:, 2])
    np.savetxt(folder / f"{role}.csv", rows, delimiter=",", header="t,u,y", comments="")


@pytest.mark.long
def test_a_cause_without_a_number_is_reported_like_any(tmp_path):
    (tmp_path / "table.toml").write_text(SERVO)
    found = diagnose_into(
        tmp_path / "table.toml", [servo_poses(tmp_path / "run", -2.0, 0)], tmp_path / "out", laws=LAWS
    )
    assert found.verdict == Verdict.EXPLAINED and [f.effect for f in found.findings] == ["reversed"]
    assert (
        "share = 1; it takes away all of the error beyond the noise." in sentence(found)
        and (tmp_path / "out" / "report.html").exists()
    )
    again = ctrlgen.diagnose(tmp_path / "out" / "device.next.toml", tmp_path / "run", laws=LAWS)
    assert again.verdict == Verdict.CONSISTENT


@pytest.mark.long
@pytest.mark.parametrize("unit", ["um", "pm"])
def test_a_column_of_another_unit_is_no_agreement(clean, unit):
    path = clean / "recording.toml"
    path.write_text(path.read_text().replace('"nm"', f'"{unit}"').replace('"5 nm"', f'"5 {unit}"'))
    found = ctrlgen.diagnose(AXIS_FILE, clean)
    first, _, answered = sentence(found).partition(" Unexplained: ")
    assert found.verdict == Verdict.UNEXPLAINED and answered
    assert first.startswith("Check this first: reading.axis is ") and 'write unit = "nm"' in found.notes[0]
    assert "units" in " ".join(next_steps(found))


@pytest.mark.long
def test_a_reading_that_counts_backwards_is_a_sign_and_no_lag(clean):
    """The device's own numbers bend to the edge of what they may be first, and hide the sign there."""
    for role in ("fit", "hold_out"):
        altered(clean, role, lambda y: -y)
    found = ctrlgen.diagnose(AXIS_FILE, clean, laws=LAWS)
    assert [f.effect for f in found.findings] == ["reversed"]


def test_numbers_as_uncertain_as_they_are_stated_are_no_contradiction(clean):
    assert ctrlgen.diagnose(AXIS_FILE, clean, laws=LAWS).verdict == Verdict.CONSISTENT


@pytest.mark.parametrize("kept", [0, 1, 19])
def test_a_channel_of_few_numbers_is_refused(clean, kept):
    altered(clean, "hold_out", lambda y: np.where(np.arange(len(y)) < kept, y, np.nan))
    with pytest.raises(InputError, match=rf"has {kept} numbers? in 600 rows of hold_out.csv"):
        ctrlgen.diagnose(AXIS_FILE, clean, laws=LAWS)


def test_a_dead_channel_alone_is_refused(clean):
    for role in ("fit", "hold_out"):
        altered(clean, role, lambda y: np.full(len(y), 5.0))
    with pytest.raises(InputError, match="reads 5 nm in all records"):
        ctrlgen.diagnose(AXIS_FILE, clean, laws=LAWS)


def test_a_dead_channel_beside_live_ones_is_named_and_left_out(tmp_path):
    folder = poses_recording(tmp_path, ctrlgen.load_device(MESO_FILE))
    with (folder / "poses.csv").open() as file:
        names = file.readline().strip().split(",")
    rows = np.loadtxt(folder / "poses.csv", delimiter=",", skiprows=1)
    rows[:, names.index("reading.delta_y")] = 12.5
    np.savetxt(folder / "poses.csv", rows, delimiter=",", header=",".join(names), comments="")
    found = ctrlgen.diagnose(MESO_FILE, folder, laws=LAWS)
    assert [(f.effect, f.location) for f in found.findings] == [("stuck", "sensor:delta_y")]
    level = found.findings[0].parameters["level"]
    assert (level.value, level.unit) == (pytest.approx(12.5), "um") and "reading.delta_y" not in found.held_out
    assert found.verdict == Verdict.EXPLAINED and any("left out of every fit" in note for note in found.notes)


def test_a_rest_that_reads_one_number_does_not_tell_the_noise(clean):
    """A coarse encoder shows its noise on the move alone."""
    rows = np.column_stack([1e-3 * np.arange(400), np.zeros(400), np.full(400, 3.0)])
    np.savetxt(clean / "rest.csv", rows, delimiter=",", header="t,u,y", comments="")
    record = '[[record]]\nfile = "rest.csv"\nrole = "rest"\ntime = { column = "t", unit = "s" }\n'
    path = clean / "recording.toml"
    path.write_text(path.read_text() + record)
    found = ctrlgen.diagnose(AXIS_FILE, clean, laws=LAWS)
    assert found.verdict == Verdict.CONSISTENT and found.held_out["reading.axis"].noise_floor == pytest.approx(5.0)


def repeated(folder: Path, wrong: float) -> Path:
    """20 settled poses, three times each, of a table whose reading is off by up to `wrong` [deg]; noise is not stated."""
    folder.mkdir()
    rng = np.random.default_rng(0)
    r = np.repeat(rng.uniform(-80, 80, 20), 3)
    y = r + wrong * np.sign(np.sin(1.7 * r)) * np.cos(r**2) + 0.01 * rng.standard_normal(60)
    np.savetxt(folder / "poses.csv", np.column_stack([r, y]), delimiter=",", header="r,y", comments="")
    (folder / "recording.toml").write_text(
        'title = "t"\ndevice = "table"\nkind = "poses"\n[columns]\n"drive.axis" = { column = "r", unit = "deg" }\n'
        '"reading.axis" = { column = "y", unit = "deg" }\n[[record]]\nfile = "poses.csv"\nrole = "fit"\n'
    )
    return folder


def test_repeated_poses_tell_the_noise(tmp_path):
    (tmp_path / "table.toml").write_text(SERVO)
    found = ctrlgen.diagnose(tmp_path / "table.toml", repeated(tmp_path / "good", 0.0), laws=LAWS)
    assert found.verdict == Verdict.CONSISTENT
    floor = found.held_out["reading.axis"].noise_floor
    assert floor == pytest.approx(0.01, rel=0.3)  # 40 repeats: 11 % standard deviation
    found = ctrlgen.diagnose(tmp_path / "table.toml", repeated(tmp_path / "bad", 5.0), laws=LAWS)
    assert found.verdict == Verdict.UNEXPLAINED


def test_agreement_without_a_known_noise_says_how_far_it_goes(tmp_path):
    (tmp_path / "table.toml").write_text(SERVO)
    folder = servo_poses(tmp_path / "run", 0.0, 1)
    path = folder / "recording.toml"
    path.write_text(path.read_text().replace(', noise = "0.001 deg"', ""))
    found = ctrlgen.diagnose(tmp_path / "table.toml", folder, laws=LAWS)
    assert found.verdict == Verdict.CONSISTENT and "errors below 0.000918 deg" in sentence(found)


@pytest.mark.long
def test_only_the_effects_asked_for_are_considered_and_the_answer_says_so(tmp_path):
    """A creeping axis, diagnosed without creep among the hypotheses."""
    creep = '[[effect]]\nkind = "creep"\nat = "axis"\ngain = "0.03"\ntau = "0.2 s"\nslow = "0.1"\n'
    folder = axis_recording(tmp_path / "creeping", AXIS_FILE.read_text() + creep)
    found = ctrlgen.diagnose(AXIS_FILE, folder, laws=("stiffening", "home_offset"))
    tried = {c.hypothesis.effect for round_ in found.search.rounds for c in round_.screened.suspects}
    assert tried <= {"stiffening", "home_offset", "parameter"} and "stiffening" in tried
    assert found.notes[-1].endswith("home_offset, stiffening") and found.verdict != Verdict.EXPLAINED
    assert "creep" not in {f.effect for f in found.findings}


@pytest.mark.parametrize("name, said", [("creeep", "did you mean 'creep'"), ("qqq", "known are: .*creep")])
def test_an_effect_that_does_not_exist_is_refused_with_the_one_that_was_meant_or_all(name, said, clean):
    with pytest.raises(InputError, match=rf"{name}: is not a known effect; {said}"):
        ctrlgen.diagnose(AXIS_FILE, clean, laws=(name,))
