"""JSON Schemas of the files that users write, for their editors: made of what reads these files.

An editor with taplo (Even Better TOML in VS Code) completes, describes and checks a file whose first line is
`#:schema ./device.schema.json`.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Union

from pydantic import Field, TypeAdapter

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.file_format import FORMAT
from ctrlgen.core.files import write_text
from ctrlgen.devices import Device
from ctrlgen.devices.python_file import KIND
from ctrlgen.recordings.schema import RecordingFile
from ctrlgen.reporting.described_schema import DescribedSchema
from ctrlgen.trajectory.scenario_file import ScenarioFile

FORMAT_KEY = {"const": FORMAT, "description": "Format of this file; left out, it is the first."}
FILES = ("device", "scenario", "recording")


def schema_of(kind: str) -> dict[str, Any]:
    """The JSON Schema of one of `FILES`, with the laws that are installed. Raises InputError for another name."""
    if kind not in FILES:
        raise InputError("schema", [Fault(kind, f"is no file that you write; known are {', '.join(FILES)}")])
    made = _of({"scenario": ScenarioFile, "recording": RecordingFile}[kind]) if kind != "device" else _device()
    made.pop("title", None)
    whole = [made, *made.get("oneOf", ())]
    for part in (made["$defs"][p["$ref"].rpartition("/")[2]] if "$ref" in p else p for p in whole):
        if "properties" in part:
            part["properties"] = {"format": FORMAT_KEY, **part["properties"]}
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": f"{kind}.toml", **made}


def _of(described: Any) -> dict[str, Any]:
    return TypeAdapter(described).json_schema(schema_generator=DescribedSchema)


def _device() -> dict[str, Any]:
    """Of every kind, told apart by `kind`; one that a Python file makes has the numbers of that file."""
    kinds: Any = Union[tuple(Device.library.values())]  # noqa: UP007, its members are not known before
    made = _of(Annotated[kinds, Field(discriminator="kind")])
    own = {"kind": {"const": KIND}, "file": {"type": "string", "pattern": r"\.py$"}}
    python = {"type": "object", "properties": own, "required": list(own)}
    made.pop("discriminator", None)  # of OpenAPI, not of JSON Schema
    return {**made, "oneOf": [*made["oneOf"], python]}


def schema_text(kind: str) -> str:
    """The schema as it is written."""
    return json.dumps(schema_of(kind), indent=1) + "\n"


def schema_line(kind: str, file: Path) -> str:
    """The first line of `file`, which names its schema; the schema is written beside it."""
    name = f"{kind}.schema.json"
    write_text(file.parent / name, schema_text(kind))
    return f"#:schema ./{name}\n"


def name_schema(kind: str, file: Path) -> None:
    """Puts that line before a file that was just written."""
    write_text(file, schema_line(kind, file) + file.read_text(encoding="utf-8"))
