"""Result files against their published JSON Schemas."""

from __future__ import annotations

import json
from importlib.resources import files
from typing import Any

from jsonschema import Draft202012Validator


def schema_of(kind: str) -> dict[str, Any]:
    """The schema of diagnosis, summary or build, as it is shipped."""
    return json.loads((files("ctrlgen.reporting") / "schemas" / f"{kind}.schema.json").read_text(encoding="utf-8"))


def faults(record: dict[str, Any], kind: str) -> list[str]:
    """Where a record of this kind differs from its schema; empty where it conforms."""
    found = json.loads(json.dumps(record))
    return [f"{e.json_path}: {e.message}" for e in Draft202012Validator(schema_of(kind)).iter_errors(found)]
