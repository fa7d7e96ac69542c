"""Files say which format they are written in: of another one the reader is told what to do."""

from __future__ import annotations

import shutil

import pytest
from conftest import AXIS_FILE, SCENARIOS
from jsonschema import Draft202012Validator

from ctrlgen import InputError, build_model, load_device, load_scenario
from ctrlgen.app.editor_schemas import FILES, schema_of
from ctrlgen.core.file_format import in_this_format
from ctrlgen.core.files import read_toml
from ctrlgen.recordings.reader import load_recordings


def test_this_format_is_read_and_a_newer_one_is_refused_with_what_to_do(tmp_path):
    runs = shutil.copytree(SCENARIOS / "lever_runs", tmp_path / "runs")
    run = next(runs.glob("run*.toml"))
    name = read_toml(run)["device"]
    devices = SCENARIOS / "devices"
    model = build_model(load_device(next(p for p in devices.glob("*.toml") if read_toml(p).get("name") == name)))
    readers = {
        AXIS_FILE: load_device,
        SCENARIOS / "circle20" / "scenario.toml": lambda path: load_scenario(path, devices / "mems_hexapod.toml"),
        run: lambda path: load_recordings([path], model),
    }
    for file, read in readers.items():
        path = runs / f"of_{file.name}"
        path.write_text("format = 1\n" + file.read_text())
        read(path)
        for written, told in (
            ("2", "install a newer one"),
            ("0", "write format = 1"),
            ('"1"', "write"),
            ("true", "write"),
        ):
            path.write_text(f"format = {written}\n" + file.read_text())
            with pytest.raises(InputError, match=told):
                read(path)


def test_a_file_without_a_format_is_in_the_first():
    assert in_this_format({"kind": "servo"}, "x") == {"kind": "servo"}


def test_the_schemas_know_it():
    for kind in FILES:
        schema = schema_of(kind)
        Draft202012Validator.check_schema(schema)
    table = {"format": 1, **read_toml(AXIS_FILE)}
    validator = Draft202012Validator(schema_of("device"))
    assert validator.is_valid(table) and not validator.is_valid({**table, "format": 2})
