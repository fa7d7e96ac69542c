"""The JSON Schemas that are shipped: written from the models of the result files, and strict.

That the files which the commands write conform stands with the tests of each command.
"""

from __future__ import annotations

import json
from copy import deepcopy

import pytest
from jsonschema import Draft202012Validator
from result_files import faults, schema_of

from ctrlgen.app.write_schemas import RESULTS, schemas, write_schemas
from ctrlgen.reporting.result_file import SCHEMAS, origin
from ctrlgen.version import __version__

EMPTY = {
    "excess": 0.1,
    "by_reading": [],
    "by_actuator": [],
    "coordinates": {"participation_ratio": {}, "explained_by_one": {}, "located_in": "cannot be told from one reading"},
    "by_frequency": [],
    "by_travel": {},
    "by_direction": {},
    "by_time": [],
    "by_temperature": [],
    "spectral_lines": [],
    "statements": [],
}
RECORD = {
    **origin({"device.toml": "0" * 64}, 7, ("a note",)),
    "verdict": "consistent",
    "sentence": "Consistent.",
    "implausible": [],
    "findings": [],
    "shares": None,
    "empirical_terms": [],
    "attribution": {"explained": 0.0, "rest": None, "left": {}, "held_out": True},
    "residual_location": {"before": EMPTY, "after": EMPTY},
    "held_out": {},
    "spikes": {},
    "detectability": {"smallest": {}, "undetectable": []},
    "next_experiment": None,
    "search_history": [],
}


def test_the_schemas_that_are_shipped_are_those_of_the_models(tmp_path):
    """Change a model, then run `make schemas`."""
    assert {path.name: path.read_text() for path in SCHEMAS.iterdir()} == schemas()
    write_schemas(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {f"{kind}.schema.json" for kind in RESULTS}


@pytest.mark.parametrize("kind", RESULTS)
def test_a_schema_is_a_json_schema_and_describes_what_it_requires(kind):
    schema = schema_of(kind)
    Draft202012Validator.check_schema(schema)
    assert schema["title"] == f"{kind}.json" and schema["description"]
    assert {"schema_version", "program", "inputs", "seed", "notes"} <= set(schema["required"])
    for name, section in schema["$defs"].items():
        assert section["description"] and section["additionalProperties"] is False, name


def test_a_record_says_which_program_made_it_from_what():
    assert faults(RECORD, "diagnosis") == []
    assert RECORD["program"]["version"] == __version__ and RECORD["inputs"] == {"device.toml": "0" * 64}
    assert RECORD["seed"] == 7 and RECORD["notes"] == ["a note"]


@pytest.mark.parametrize("key", RECORD)
def test_a_record_without_one_of_its_keys_does_not_conform(key):
    assert faults({k: v for k, v in RECORD.items() if k != key}, "diagnosis")


@pytest.mark.parametrize(
    "path, value",
    [
        (("verdict",), "perhaps"),
        (("schema_version",), 2),
        (("inputs", "device.toml"), "0" * 63),
        (("seed",), "7"),
        (("where",), {}),
        (("program", "name"), "other"),
        (("residual_location", "before", "excess"), "much"),
        (("residual_location", "before", "said"), []),
        (("detectability", "smallest"), []),
    ],
)
def test_a_record_with_another_key_or_kind_of_value_does_not_conform(path, value):
    record = deepcopy(json.loads(json.dumps(RECORD)))
    node = record
    for key in path[:-1]:
        node = node[key]
    node[path[-1]] = value
    assert faults(record, "diagnosis")
