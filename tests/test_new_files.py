"""ctrlgen new: what it writes can be used as it stands, numbers that nobody gave are marked, nothing is written over."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from command_line import ctrlgen

from ctrlgen import load_device
from ctrlgen.app.check_files import check
from ctrlgen.app.new_files.questions import KINDS, read
from ctrlgen.app.new_files.write import PATHS, write_device, write_scenario
from ctrlgen.core.errors import InputError


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_begun_passes_check(kind, tmp_path):
    device = tmp_path / "stage.toml"
    write_device(device, kind)
    assert load_device(device).name == "stage"
    assert "assumed: replace it by yours" in device.read_text()
    if kind == "tested-axis":
        with pytest.raises(InputError, match="has no actuator: another machine moves it"):
            write_scenario(tmp_path / "first", device)
        return
    write_scenario(tmp_path / "first", device)
    check(tmp_path / "first")  # raises where the path cannot be followed


@pytest.mark.parametrize("path", PATHS)
def test_every_path_can_be_begun(path, tmp_path):
    device = tmp_path / "stage.toml"
    write_device(device, "xy")
    write_scenario(tmp_path / "deeper" / "folder", device, path)
    assert tomllib.loads((tmp_path / "deeper" / "folder" / "scenario.toml").read_text())["path"]["kind"] == path
    check(tmp_path / "deeper" / "folder")


def test_numbers_that_were_given_are_those_of_the_device(tmp_path):
    write_device(tmp_path / "my stage.toml", "piezo", given={"voltage": "150 V", "free_stroke": "0.03 mm"})
    device = load_device(tmp_path / "my stage.toml")
    assert device.name == "my_stage"
    actuator = device.actuator[0]
    assert actuator.high.si == 150.0 and actuator.high.source == "stated"
    # blocked force over voltage: 30 um times 50 N/um over 150 V
    assert abs(actuator.gain.si - 10.0) < 1e-9
    assert actuator.stiffness.source == "assumed: replace it by yours"


def test_a_coil_may_be_driven_by_current(tmp_path):
    write_device(tmp_path / "a.toml", "voice-coil", given={"force_constant": "20 N/A", "drive_limit": "2 A"})
    assert load_device(tmp_path / "a.toml").actuator.drive_limit.text == "2 A"
    with pytest.raises(InputError, match="both in volt or in ampere"):
        write_device(tmp_path / "b.toml", "voice-coil", given={"force_constant": "20 N/A"})  # and volts
    assert not (tmp_path / "b.toml").exists()


def test_an_axis_may_turn_and_what_is_read_behind_it_may_weigh_nothing(tmp_path):
    write_device(tmp_path / "table.toml", "servo", given={"travel": "90 deg"})
    assert load_device(tmp_path / "table.toml").travel.text == "90 deg"
    turning = {"mass": "0 kg*m^2", "damping": "0 N*m*s/rad", "stiffness": "2 N*m/rad"}
    sizes = {"stroke": "1 rad", "speed": "3 rad/s", "force": "5 mN*m"}
    write_device(tmp_path / "motor.toml", "tested-axis", given=turning | sizes)
    assert load_device(tmp_path / "motor.toml").mechanics.rotary
    with pytest.raises(InputError, match="the axis is rotary"):
        write_device(tmp_path / "both.toml", "tested-axis", given=sizes)
    with pytest.raises(InputError, match="must be above zero"):
        write_device(tmp_path / "none.toml", "servo", given={"travel": "0 mm"})


@pytest.mark.parametrize(
    ("travel", "says"),
    [
        ('"60 K"', "travel: '60 K' has the wrong unit: um is needed, for example \"60 um\", or rad is needed"),
        ("60", 'travel: 60 has no unit; write for example "60 um", or write for example "60 rad"'),
    ],
)
def test_a_number_that_may_be_a_length_or_an_angle_is_one_fault(travel, says, tmp_path):
    write_device(tmp_path / "stage.toml", "servo")
    lines = (tmp_path / "stage.toml").read_text().splitlines()
    (tmp_path / "stage.toml").write_text(
        "\n".join(f"travel = {travel}" if line.startswith("travel") else line for line in lines)
    )
    with pytest.raises(InputError) as caught:
        load_device(tmp_path / "stage.toml")
    (fault,) = caught.value.faults
    assert f"{fault.where}: {fault.what}".startswith(says)


@pytest.mark.parametrize(
    ("kind", "given", "says"),
    [
        ("piezo", {"voltage": "150 N"}, "wrong unit"),
        ("piezo", {"voltage": "150"}, "has no unit"),
        ("piezo", {"voltage": "-3 V"}, "above zero"),
        ("piezo", {"volts": "3 V"}, "is not asked of piezo; asked are voltage"),
        ("piezo", {"voltage": '3 V" }\n[evil'}, "does not start with a number"),
        ("lathe", {}, "known are: piezo"),
    ],
)
def test_wrong_answers_are_refused_and_nothing_is_written(kind, given, says, tmp_path):
    with pytest.raises(InputError, match=says.replace('"', ".")):
        write_device(tmp_path / "stage.toml", kind, given=given)
    assert not list(tmp_path.iterdir())


def test_nothing_is_written_over(tmp_path):
    (tmp_path / "stage.toml").write_text("mine")
    with pytest.raises(InputError, match="exists"):
        write_device(tmp_path / "stage.toml", "piezo")
    assert (tmp_path / "stage.toml").read_text() == "mine"


def test_one_axis_has_no_circle(tmp_path):
    write_device(tmp_path / "stage.toml", "voice-coil")
    with pytest.raises(InputError, match="needs two directions of one unit, and stage has axis; --path line has one"):
        write_scenario(tmp_path / "circle", tmp_path / "stage.toml", "circle")
    assert not (tmp_path / "circle").exists()


def test_a_mirror_is_led_in_its_angles(tmp_path):
    write_device(tmp_path / "mirror.toml", "tip-tilt")
    write_scenario(tmp_path / "circle", tmp_path / "mirror.toml")
    path = tomllib.loads((tmp_path / "circle" / "scenario.toml").read_text())["path"]
    assert path["kind"] == "circle" and path["plane"] == ["theta_x", "theta_y"]


def test_every_answer_to_begin_with_is_one():
    for kind in KINDS.values():
        for question in kind.questions:
            assert read(question, question.answer) > 0


@pytest.mark.long
def test_the_command_writes_a_file_and_says_what_comes_next(tmp_path):
    done = ctrlgen("new", "device", tmp_path / "stage.toml", "--kind", "piezo", "--no-ask")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "stage.toml").is_file()
    assert "next:  ctrlgen check" in done.stdout


@pytest.mark.parametrize(
    "file", ["docs/tutorial/first_device.md", "ctrlgen/app/commands/new.py"], ids=["the tutorial", "the help"]
)
def test_every_kind_that_can_be_begun_is_named_where_a_reader_looks(file):
    text = Path(file).read_text(encoding="utf-8")
    assert all(re.search(rf"(?<![\w-]){kind}(?![\w-])", text) for kind in KINDS)
