"""What a new user mistypes in the first minutes is answered once, with what to write instead."""

from __future__ import annotations

from pathlib import Path

import pytest

from ctrlgen.app.batch import load_batch
from ctrlgen.app.check_files import check
from ctrlgen.app.commands.cli import app
from ctrlgen.core.errors import InputError
from ctrlgen.devices import load_device
from ctrlgen.model.assembly import build_model
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.reader import load_recordings
from ctrlgen.trajectory.scenario import load_scenario

STAGE = Path("tests/logs/stage.toml").read_text(encoding="utf-8")


def said(action) -> list[str]:
    with pytest.raises(InputError) as refused:
        action()
    return [f"{fault.where}: {fault.what}" for fault in refused.value.faults]


@pytest.mark.parametrize(
    ("mass", "told"),
    [
        (
            '"0.5 kilo"',
            'mechanics.mass: \'kilo\' is not a unit I know; write for example "0.5 kg", or write for example "0.5 kg*m^2"',
        ),
        ('"0,5 kg"', "mechanics.mass: '0,5 kg' has a decimal comma; write a point"),
        ('"-0.5 kg"', "mechanics.mass: '-0.5 kg' is out of bounds; it must be > 0 kg"),
        (
            '"0.5 V"',
            "mechanics.mass: '0.5 V' has the wrong unit: kg is needed, for example \"0.5 kg\", or kg*m^2 is needed",
        ),
    ],
)
def test_a_wrong_number_is_told_once(tmp_path, mass, told):
    (tmp_path / "stage.toml").write_text(STAGE.replace('"0.5 kg"', mass))
    (only,) = said(lambda: check(tmp_path / "stage.toml"))
    assert only.startswith(told)


def test_a_file_of_another_kind_is_told_what_it_is(tmp_path):
    for text in ("", STAGE.replace('kind = "axis"', "")):
        (tmp_path / "device.toml").write_text(text)
        (only,) = said(lambda: check(tmp_path / "device.toml"))
        assert only.startswith("kind: is missing; a device file begins with kind =")
    (tmp_path / "log.csv").write_text("time [s],drive [V]\n0,1\n1,2\n")
    (only,) = said(lambda: check(tmp_path / "log.csv"))
    assert "it is no TOML" in only and "ctrlgen look" in only


def test_a_measurement_that_is_not_there_holds_names_alone_or_is_a_folder(tmp_path, monkeypatch):
    axis = build_model(load_device("tests/logs/stage.toml"))
    monkeypatch.chdir(tmp_path)
    assert said(lambda: load_recordings([tmp_path / "none.csv"], axis)) == ["file: does not exist; check the path"]
    (tmp_path / "log.csv").write_text("t,u,x\n")
    assert said(lambda: read_table(tmp_path / "log.csv")) == [
        "log.csv: holds names of columns, 't,u,x', and no rows; is the file complete?"
    ]
    assert said(lambda: read_table(Path())) == ["file: is a folder; name the file inside it"]


OTHERS = {
    "device": STAGE,
    "scenario": 'title = "a"\ndevice = "stage.toml"\n[path]\nkind = "line"\n',
    "recording": 'title = "a"\nkind = "series"\n[[record]]\nfile = "log.csv"\n',
    "jobs": '[[job]]\ndevice = "stage.toml"\nrecordings = ["a"]\n',
    "uncertainty": 'title = "a"\n[surroundings]\nsd = "1 K"\nsource = "log"\n',
}
READERS = {"device": load_device, "scenario": load_scenario, "jobs": load_batch}


@pytest.mark.parametrize("wanted", READERS)
@pytest.mark.parametrize("given", OTHERS)
def test_every_reader_says_in_one_line_what_a_file_of_another_kind_is(tmp_path, wanted, given):
    (tmp_path / "some.toml").write_text(OTHERS[given])
    if given != wanted:
        (only,) = said(lambda: READERS[wanted](tmp_path / "some.toml"))
        assert only.startswith("file: ") and "name" in only and "missing" not in only


def test_a_device_file_without_a_kind_is_told_the_kinds(tmp_path):
    for text in ("", STAGE.replace('kind = "axis"', "")):
        (tmp_path / "device.toml").write_text(text)
        (only,) = said(lambda: load_device(tmp_path / "device.toml"))
        assert only.startswith('kind: is missing; write kind = one of "axis"')


def test_the_time_that_falls_is_named_with_its_unit(tmp_path, capsys):
    (tmp_path / "log.csv").write_text("time [s],x [um]\n" + "\n".join(f"{1 - k / 10},{k}" for k in range(9)))
    app(["look", str(tmp_path / "log.csv")], standalone_mode=False)
    assert "the time 'time [s]' falls: newest row first" in capsys.readouterr().out
