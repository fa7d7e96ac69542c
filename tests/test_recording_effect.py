"""Effects that one recording had alone: no path, no C and no other recording has them."""

from __future__ import annotations

import pytest
from conftest import AXIS_FILE
from creeping_axis import CREEP
from recording_folders import axis_recording

import ctrlgen
from ctrlgen.core.errors import InputError
from ctrlgen.core.files import read_toml
from ctrlgen.diagnosis.diagnosis_folder import diagnose_into
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.effects import Effect

DRIFT = 'kind = "drift"\nat = "axis"\nrate = "1 um/s"\n'
LAWS = ("creep", "drift", "drive_gain")
OWN, OTHERS = (f'\n[[recording_effect]]\nrecording = "{title}"\n{DRIFT}' for title in ("drifting axis", "another"))


def loaded(folder, text):
    (folder / "device.toml").write_text(text)
    return ctrlgen.load_device(folder / "device.toml")


def test_it_acts_in_its_own_recording_after_the_other_effects(tmp_path):
    device = loaded(tmp_path, AXIS_FILE.read_text() + OTHERS + OWN + CREEP)
    assert [e.kind for e in device.effect] == ["creep"]
    assert [e.kind for e in device.in_recording("drifting axis").effect] == ["creep", "drift"]
    assert device.in_recording("a third").effect == device.effect


def test_it_is_in_no_number_and_no_equation_of_the_device(tmp_path):
    plain, recorded = (loaded(tmp_path, AXIS_FILE.read_text() + text) for text in ("", OWN))
    assert [path for path, _ in plain.quantities()] == [path for path, _ in recorded.quantities()]
    assert str(ctrlgen.build_model(plain).rates) == str(ctrlgen.build_model(recorded).rates)
    assert ctrlgen.build_model(recorded.in_recording("drifting axis")).x.numel() > ctrlgen.build_model(plain).x.numel()


@pytest.mark.parametrize(
    "wrong, told",
    [
        (f"[[recording_effect]]\n{DRIFT}", "recording is missing"),
        (OWN.replace('rate = "1 um/s"', ""), "rate is missing"),
        (OWN.replace('drift"\nat', 'drifts"\nat'), "not a known effect"),
    ],
)
def test_what_is_wrong_with_its_table_is_told(tmp_path, wrong, told):
    with pytest.raises(InputError, match=told):
        loaded(tmp_path, AXIS_FILE.read_text() + wrong)


def test_laws_that_run_on_the_clock_are_those_of_time_alone():
    clocked = {kind for kind, law in Effect.library.items() if law.runs_on_the_clock()}
    assert {"drift", "vibration", "degradation", "sensor_step", "friction_from_a_moment"} & clocked
    assert not clocked & {"creep", "log_creep", "thermal_lag", "resonance", "delay", "stick_slip"}


@pytest.mark.long
def test_a_drift_is_kept_for_its_recording_and_a_creep_for_the_device(tmp_path):
    true = AXIS_FILE.read_text() + CREEP + f"\n[[effect]]\n{DRIFT}"
    recording = axis_recording(tmp_path / "run", true, "drifting axis")
    loaded(tmp_path, AXIS_FILE.read_text() + OTHERS)
    found = diagnose_into(tmp_path / "device.toml", [recording], tmp_path / "out", laws=LAWS)
    assert {f.effect for f in found.findings} == {"creep", "drift"}
    path = tmp_path / "out" / "device.next.toml"
    table, device = read_toml(path), ctrlgen.load_device(path)
    assert [e["kind"] for e in table["effect"]] == ["creep"]
    assert [e["recording"] for e in table["recording_effect"]] == ["another", "drifting axis"]
    assert [e.kind for e in device.effect] == ["creep"]
    assert device.in_recording("drifting axis").effect[1].values["rate"].si == pytest.approx(1e-6, rel=0.05)
    assert ctrlgen.diagnose(device, recording, laws=LAWS).verdict == Verdict.CONSISTENT


@pytest.mark.long
def test_that_of_another_recording_is_left_out_and_told(tmp_path):
    device = loaded(tmp_path, AXIS_FILE.read_text() + OTHERS)
    found = ctrlgen.diagnose(device, axis_recording(tmp_path / "run", AXIS_FILE.read_text()), laws=LAWS)
    assert found.verdict == Verdict.CONSISTENT
    assert any('drift at axis, of the recording "another"' in note for note in found.notes)
