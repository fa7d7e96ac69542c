"""The schemas of the files that users write: what is shipped conforms, what is wrong does not, what is begun names its schema."""

from __future__ import annotations

import json
import tomllib
from copy import deepcopy

import pytest
from command_line import ctrlgen
from conftest import AXIS_FILE, SCENARIOS
from jsonschema import Draft202012Validator

from ctrlgen.app.editor_schemas import FILES, name_schema, schema_of
from ctrlgen.app.new_files.write import write_device, write_scenario
from ctrlgen.core.errors import InputError

SCHEMAS = {kind: Draft202012Validator(schema_of(kind)) for kind in FILES}
MARKS = {"recording": "record", "device": "kind", "scenario": "path"}  # the key that only one of them has, or has first


def kind_of(table) -> str | None:
    return next((kind for kind, key in MARKS.items() if key in table), None)


def test_every_shipped_file_conforms():
    seen = dict.fromkeys(FILES, 0)
    for file in sorted(SCENARIOS.rglob("*.toml")):
        table = tomllib.loads(file.read_text())
        if (kind := kind_of(table)) is not None:
            seen[kind] += 1
            assert not [f"{file}: {e.message}" for e in SCHEMAS[kind].iter_errors(table)]
    assert min(seen.values()) > 10


@pytest.mark.parametrize(
    ("kind", "file"),
    [
        ("device", "devices/flexure_axis.toml"),
        ("scenario", "circle20/scenario.toml"),
        ("recording", "emps/recording.toml"),
    ],
)
def test_a_schema_refuses_unknown_and_missing_keys_and_describes_the_others(kind, file):
    schema, table = schema_of(kind), tomllib.loads((SCENARIOS / file).read_text())
    Draft202012Validator.check_schema(schema)
    assert SCHEMAS[kind].is_valid(table)
    assert not SCHEMAS[kind].is_valid({**table, "tilte": "t"})
    for key in ("title", MARKS[kind]):
        less = deepcopy(table)
        del less[key]
        assert not SCHEMAS[kind].is_valid(less), key
    assert json.dumps(schema).count('"description"') > 30


def test_what_is_begun_names_the_schema_beside_it(tmp_path):
    write_device(tmp_path / "stage.toml", "piezo")
    write_scenario(tmp_path / "path", tmp_path / "stage.toml")
    for kind, file in (("device", tmp_path / "stage.toml"), ("scenario", tmp_path / "path" / "scenario.toml")):
        name_schema(kind, file)
        first, *rest = file.read_text().splitlines()
        schema = json.loads((file.parent / first.removeprefix("#:schema ./")).read_text())
        assert schema == schema_of(kind) and SCHEMAS[kind].is_valid(tomllib.loads("\n".join(rest)))


@pytest.mark.long
def test_the_commands_write_it(tmp_path):
    rows = "".join(f"{k / 1000},{k % 7},{50 * (k % 7)}\n" for k in range(1000))
    (tmp_path / "log.csv").write_text("time [s],drive [V],position [um]\n" + rows)
    commands = {
        "device": ("new", "device", tmp_path / "s.toml", "--kind", "piezo", "--no-ask"),
        "recording": ("look", tmp_path / "log.csv", "--device", AXIS_FILE, "--to", tmp_path / "r.toml"),
    }
    for kind, words in commands.items():
        assert ctrlgen(*words).returncode == 0
        assert (tmp_path / f"{kind}.schema.json").is_file()
    for file in ("s.toml", "r.toml"):
        assert (tmp_path / file).read_text().startswith("#:schema ./")
    printed = ctrlgen("schema", "scenario")
    assert printed.returncode == 0 and json.loads(printed.stdout) == schema_of("scenario")


def test_another_name_is_refused():
    with pytest.raises(InputError, match="known are device, scenario, recording"):
        schema_of("results")
