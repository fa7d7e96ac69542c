"""What every result file states of its origin.

The JSON Schemas in `ctrlgen/reporting/schemas/` are written from these models (`make schemas`).
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, WithJsonSchema

from ctrlgen.core.to_json import plain
from ctrlgen.version import __version__, commit

SCHEMAS = Path(__file__).parent / "schemas"
SCHEMA_VERSION = 1  # raised when a key changes its name or meaning; one version for all files

Sha256 = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
Number = float | None  # None where it is not finite
FiniteOrNull = Annotated[float, WithJsonSchema({"anyOf": [{"type": "number"}, {"type": "null"}]})]
"""A float that may be infinite or not a number, which the file states as null."""


def _without_remarks(schema: dict[str, Any]) -> None:
    """What pydantic remarks of a key that follows from others says nothing of the file."""
    for entry in schema.get("properties", {}).values():
        entry.pop("readOnly", None)


class Keys(BaseModel):
    """An object of a result file: it has these keys and no others."""

    # built where first used: a command does not wait for the records of others
    model_config = ConfigDict(
        extra="forbid", frozen=True, defer_build=True, arbitrary_types_allowed=True, json_schema_extra=_without_remarks
    )

    def as_json(self) -> dict[str, Any]:
        """Its keys in the types of JSON, without those that have a default and were not given; null for what is not finite."""
        return plain(self.model_dump(exclude_unset=True))


def json_text(record: Keys) -> str:
    """The text of a result file."""
    return json.dumps(record.as_json(), indent=1, allow_nan=False) + "\n"


class Program(Keys):
    """The program that wrote the file."""

    name: Literal["ctrlgen"] = Field(description="Always ctrlgen.")
    version: str = Field(description="Version of the program.")
    commit: str | None = Field(
        description="Commit of its source, with -dirty where files differ from it; null if unknown."
    )


class Origin(Keys):
    """What every result file states of its origin."""

    schema_version: Literal[1] = Field(description="Version of this schema.")
    program: Program = Field(description="Name, version and commit of the program.")
    inputs: dict[str, Sha256] = Field(description="SHA-256 of every file that was read, by name.")
    seed: int | None = Field(description="Seed of everything drawn at random; null where nothing is.")
    notes: list[str] = Field(description="What a reader should know of the inputs or of how the result was made.")


def origin(inputs: dict[str, str], seed: int | None = None, notes: tuple[str, ...] = ()) -> dict[str, Any]:
    """The keys of `Origin` for files with these SHA-256 `inputs`."""
    return {
        "schema_version": SCHEMA_VERSION,
        "program": {"name": "ctrlgen", "version": __version__, "commit": commit() or None},
        "inputs": dict(inputs),
        "seed": seed,
        "notes": list(notes),
    }


class ChannelGroup(Keys):
    """Channels of the followed signal with one kind of unit."""

    name: str = Field(description="translation, rotation, or 'in' a unit of another kind.")
    unit: str = Field(description="Unit of every number of this group in the file.")
    channels: list[str] = Field(description="Its channels.")


def schema_text(model: type[BaseModel], name: str) -> str:
    """The JSON Schema (draft 2020-12) of a result file as text."""
    schema = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **model.model_json_schema(mode="serialization"),
    }
    schema["title"] = name
    return json.dumps(schema, indent=1) + "\n"
