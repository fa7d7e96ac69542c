"""What a file or an argument can be that nobody meant: one clear message that says what, where and what to do."""

from __future__ import annotations

import errno
import json
import os
import resource
import shutil
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest
from command_line import ctrlgen
from conftest import AXIS_FILE, DEVICE, DEVICES, SCENARIOS

from ctrlgen import InputError, build_model, load_device, load_recordings, load_scenario
from ctrlgen.core.files import whole_folder, write_bytes

BOM = b"\xef\xbb\xbf"
DEEP = "[" * 5000 + "]" * 5000
AXIS = """title = "t"
device = "flexure_axis"
kind = "series"
[[record]]
file = "FILE"
role = "fit"
sample_rate = "1 kHz"
[columns]
"drive.axis" = { column = "u", unit = "V" }
"reading.axis" = { column = "y", unit = "um" }
"""


def refused(done: subprocess.CompletedProcess[str], *says: str, status: int = 1) -> None:
    assert done.returncode == status, done
    assert "Traceback" not in done.stderr
    for words in says:
        assert words in done.stderr, done.stderr


def scenario(folder: Path, path: str, device: str = str(DEVICE)) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / "scenario.toml").write_text(f'title = "t"\ndevice = "{device}"\n{path}\n')
    return folder


POSES = '[path]\nkind = "poses"\nfile = "poses.csv"'


@pytest.mark.long
@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("kind = []", "kind: [] is not a kind of device I know; write kind = one of"),
        ("kind = 3", "kind: 3 is not a kind of device I know"),
        (f"kind = {'[' * 60 + ']' * 60}", "kind: [[[[[[[...]]]]]]] is not a kind of device I know"),
        (f"a = {DEEP}", "stand more than 100 deep inside one another"),
        ("[[record]]", "describes a recording; name the device file that it was made on"),
        ('kind = "axis"\nname = "a', "syntax: "),
    ],
)
def test_a_device_file_that_is_none(tmp_path, text, says):
    (tmp_path / "device.toml").write_text(f"{text}\n")
    refused(ctrlgen("workspace", tmp_path / "device.toml", "--out", tmp_path / "out"), "device.toml", says)


def test_an_effect_whose_kind_is_no_text(tmp_path):
    (tmp_path / "device.toml").write_text(DEVICE.read_text() + "\n[[effect]]\nkind = []\n")
    refused(
        ctrlgen("check", tmp_path / "device.toml"), "effect[0]: kind = [] is not a known effect; known are: abbe_arm"
    )


@pytest.mark.long
@pytest.mark.parametrize(
    ("path", "says"),
    [
        ("[path]\nkind = []", "path.kind: [] is not one I know; write 'circle', 'line'"),
        ('[path]\ndiameter = "20 um"', "path: has no kind"),
        ("path = 5", "path: 5: write a table, such as"),
        (f"path = {DEEP}", "stand more than 100 deep inside one another"),
        ('[path]\nkind = "poses"\nfile = "."', "is a folder; name the file inside it"),
        (
            '[path]\nkind = "poses"\nfile = "a\\u0000b"',
            "path.file: has a character that is not shown, U+0000, after 1 others; remove it",
        ),
        (f'[path]\nkind = "poses"\nfile = "{"x" * 1000}"', "File name too long; choose a shorter name"),
        ('[[record]]\nfile = "a"', "describes a recording; name a scenario"),
        (
            'controller = "Fast"\n[path]\nkind = "poses"',
            "controller: 'Fast' is no C identifier in lower case: begin with a letter",
        ),
        ('controller = "2fast"\n[path]\nkind = "poses"', "controller: '2fast' is no C identifier"),
        ('controller = ""\n[path]\nkind = "poses"', "controller: '' is no C identifier"),
        ('controller = "fast\\n"\n[path]\nkind = "poses"', "is no C identifier"),
        ('controller = "fäst"\n[path]\nkind = "poses"', "controller: 'fäst' is no C identifier"),
        ("controller = 3\n[path]\nkind = 'poses'", "controller: 3: write a text in quotes"),
        ('[path]\nkind = "poses"\nperiodic = "maybe"', "path.periodic: 'maybe': write true or false"),
        ('[path]\nkind = "poses"\nperiodic = "yes"', "path.periodic: 'yes': write true or false"),
        (
            '[path]\nkind = "poses"\nfile = "p.csv"\nperiodic = true',
            "path.periodic is of motions in time: give sample_rate",
        ),
    ],
)
def test_a_scenario_that_cannot_be_one(tmp_path, path, says):
    refused(ctrlgen("check", scenario(tmp_path / "s", path)), says)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"delta_z [um]\n" + b"2" * 200_000, "is no CSV: field larger than field limit"),
        ("delta_z [um]\n20\n".encode("utf-16"), "is not UTF-8 text (byte 0); save it as UTF-8"),
        (b"delta_z [um]\n\x00\n", "line 2, delta_z: "),
        (b"", "has no samples"),
    ],
)
def test_poses_that_are_no_csv(tmp_path, content, says):
    folder = scenario(tmp_path / "s", POSES)
    (folder / "poses.csv").write_bytes(content)
    refused(ctrlgen("check", folder), "poses.csv", says)


def test_a_byte_order_mark_is_no_part_of_the_text(tmp_path):
    """Some editors and spreadsheets put one at the beginning of UTF-8."""
    device = tmp_path / "device.toml"
    device.write_bytes(BOM + DEVICE.read_bytes())
    folder = scenario(tmp_path / "s", POSES, str(device))
    (folder / "scenario.toml").write_bytes(BOM + (folder / "scenario.toml").read_bytes())
    (folder / "poses.csv").write_bytes(BOM + b"delta_z [um]\n20\n")
    loaded = load_scenario(folder)
    assert loaded.bind(build_model(loaded.device)).samples.shape == (1, 6)
    (tmp_path / "recording.toml").write_bytes(BOM + AXIS.replace("FILE", "run.csv").encode())
    rows = "".join(f"{0.001 * (k % 50)},{0.01 * (k % 50)}\n" for k in range(400))
    (tmp_path / "run.csv").write_bytes(BOM + b"u,y\n" + rows.encode())
    axis = build_model(load_device(AXIS_FILE))
    assert load_recordings([tmp_path], axis).channels == ("reading.axis",)


@pytest.mark.parametrize("name", ["folder", "folder.csv"])
def test_a_folder_in_place_of_a_measurement(tmp_path, name):
    (tmp_path / name).mkdir()
    (tmp_path / "recording.toml").write_text(AXIS.replace("FILE", name))
    axis = AXIS_FILE
    done = ctrlgen("diagnose", axis, tmp_path, "--out", tmp_path / "out")
    refused(done, f"record[0].file: {name} is a folder; name the file inside it", status=2)


def test_json_that_is_nested_without_end(tmp_path):
    (tmp_path / "run.json").write_text(json.dumps({"u": [1, 2]})[:-1] + f', "y": {"[" * 100_000}')
    (tmp_path / "recording.toml").write_text(AXIS.replace("FILE", "run.json"))
    axis = AXIS_FILE
    done = ctrlgen("diagnose", axis, tmp_path, "--out", tmp_path / "out")
    refused(done, "record[0].file: run.json cannot be read as .json", status=2)


@pytest.mark.long
@pytest.mark.parametrize(
    ("given", "says"),
    [
        (SCENARIOS / "nist_hexapod" / "travels.csv", "writes a recording.toml with what it says, to complete"),
        (DEVICE, "describes a device; name a recording.toml"),
        (SCENARIOS / "circle20" / "scenario.toml", "describes a scenario; name a recording.toml"),
    ],
)
def test_something_else_in_place_of_a_recording(tmp_path, given, says):
    refused(ctrlgen("diagnose", DEVICE, given, "--out", tmp_path / "out"), says, status=2)


@pytest.mark.parametrize("command", ["budget", "fastest", "learn", "calibrate"])
def test_a_result_folder_that_cannot_be_is_refused_before_anything_is_read(tmp_path, command):
    (tmp_path / "file").touch()
    for out, says in ((tmp_path / "file", "is a file"), (tmp_path / "file" / "below", "a file stands where a folder")):
        words = [tmp_path / "nowhere"] * (2 if command in ("learn", "calibrate") else 1)
        refused(ctrlgen(command, *words, "--out", out), "--out: ", says)


@pytest.mark.long
@pytest.mark.parametrize("command", ["solve", "generate", "run", "verify"])
def test_a_result_folder_that_is_a_link_to_itself(tmp_path, command):
    (tmp_path / "loop").symlink_to("loop")
    done = ctrlgen(command, SCENARIOS / "spiral", "--out", tmp_path / "loop")
    refused(done, "--out: cannot be written", "a link leads back to itself; remove or correct the link")
    done = ctrlgen(command, SCENARIOS / "spiral", "--out", tmp_path / "loop" / "below")
    refused(done, f"cannot be written at {tmp_path / 'loop'}", "stands where a folder is needed")
    assert [path.name for path in tmp_path.iterdir()] == ["loop"]


@pytest.mark.long
@pytest.mark.parametrize(
    "words",
    [
        ("bode", DEVICE, "--out", "FILE/b.svg"),
        ("reproduce", "S2", "--out", "FILE/p.html"),
        ("example", "circle20", "--to", "FILE"),
        ("fmu", SCENARIOS / "rrr_circle", "--out", "FILE"),
        ("workspace", DEVICES / "rrr_case1.toml", "--out", "FILE/out"),
    ],
    ids=lambda words: words[0],
)
def test_a_file_where_a_folder_should_be_is_named(tmp_path, words):
    (tmp_path / "file").write_text("mine")
    done = ctrlgen(*(str(word).replace("FILE", str(tmp_path / "file")) for word in words))
    refused(done, str(tmp_path / "file"), "a file")
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.long
def test_a_full_disk_is_named_with_the_folder_and_leaves_nothing(tmp_path):
    """A limit on the size of files is the full disk that a test can have: the system refuses the write."""
    done = subprocess.run(
        [sys.executable, "-m", "ctrlgen", "generate", SCENARIOS / "spiral", "--out", tmp_path / "out"],
        capture_output=True,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000)),
    )
    refused(done, "cannot be written: File too large; raise the limit", "mems_hexapod_online_f64.h")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT, errno.EROFS])
def test_what_a_library_could_not_write_into_a_result_is_told_as_the_disks_fault(tmp_path, number):
    with pytest.raises(InputError, match=r"out: 1 fault\n  - --out: cannot be written: .*write to another one"):  # noqa: SIM117
        with whole_folder(tmp_path / "out"):
            raise OSError(number, os.strerror(number))
    assert not list(tmp_path.iterdir())


def test_a_full_disk_at_a_single_file(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(InputError, match="No space left on device; free space on that disk"):
        write_bytes(tmp_path / "page.html", b"text")
    assert not list(tmp_path.iterdir())


@contextmanager
def interrupted_at(step: int):
    """Ctrl-C at instruction number `step` of ctrlgen/core/files.py, or of a function that it calls returning to it."""
    left = step

    def trace(frame, event, _argument):
        nonlocal left
        frame.f_trace_opcodes = True
        if not frame.f_code.co_filename.endswith("core/files.py"):
            return None
        left -= event == "opcode"
        if left == 0:
            raise KeyboardInterrupt
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        yield
    finally:
        sys.settrace(before)


@pytest.mark.filterwarnings("ignore:Exception ignored")  # a file that was open is closed by Python, which warns
def test_ctrl_c_at_any_instruction_leaves_a_whole_file_and_no_other(tmp_path):
    path, contents, step = tmp_path / "out.csv", set(), 0
    path.write_bytes(b"old")
    while True:
        step += 1
        try:
            with interrupted_at(step):
                write_bytes(path, b"new")
            break
        except KeyboardInterrupt:
            assert [p.name for p in tmp_path.iterdir()] == ["out.csv"]
            contents.add(path.read_bytes())
            path.write_bytes(b"old")
    assert contents == {b"old", b"new"} and path.read_bytes() == b"new"


@pytest.mark.filterwarnings("ignore:Exception ignored")  # a file that was open is closed by Python, which warns
def test_ctrl_c_at_any_instruction_leaves_a_whole_folder(tmp_path):
    out, step = tmp_path / "out", 0
    with whole_folder(out) as draft:
        (draft / "a.csv").write_text("old")
    while True:
        step += 1
        try:
            with interrupted_at(step), whole_folder(out) as draft:
                (draft / "a.csv").write_text("new")
            break
        except KeyboardInterrupt:
            assert {p.name for p in out.iterdir()} == {".ctrlgen", "a.csv"}
            assert (out / "a.csv").read_text() in {"old", "new"}
            left = {p.name for p in tmp_path.iterdir()} - {"out"}
            for name in left:  # only what was replaced, and only while it is removed
                assert name.endswith(".old")
                assert (out / "a.csv").read_text() == "new"
                shutil.rmtree(tmp_path / name)
    assert (out / "a.csv").read_text() == "new"


@pytest.mark.long
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full here")
def test_standard_output_on_a_full_disk():
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "ctrlgen", "example"], stdout=full, stderr=subprocess.PIPE, text=True
        )
    refused(done, "No space left on device; free space on that disk")
