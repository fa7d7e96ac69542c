"""Which format a device, scenario or recording file is written in: `format = 1`; a file that does not say is in the first."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ctrlgen.core.errors import Fault, InputError

FORMAT = 1
"""The one that this ctrlgen reads and writes. A change after which an older file would mean something else takes the next number, with
words in `in_this_format` for what to change."""


# what a file is by a key that only such a one has, and what is said of it where another was meant
_KINDS = {
    "record": ("recording", "describes a recording"),
    "job": ("jobs", "is a list of diagnoses, for ctrlgen batch"),
    "path": ("scenario", "is a scenario"),
    "kind": ("device", "describes a device"),
}
# all that a statement of uncertainties may hold
_UNCERTAIN = {"format", "title", "numbers", "surroundings", "drive", "sensor", "correlation"}


def refuse_another_kind(table: dict[str, Any], path: Path | str, wanted: str, instead: str) -> None:
    """Raises InputError for the `table` of a file that is of another kind than the `wanted` one, with what to name `instead`."""
    found, said = next((_KINDS[key] for key in _KINDS if key in table), (wanted, ""))
    if not said and table and table.keys() <= _UNCERTAIN:
        found, said = "uncertainty", "states uncertainties, and stands beside a scenario"
    if found != wanted:
        raise InputError(path, [Fault("file", f"{said}; {instead}")])


def in_this_format(table: dict[str, Any], path: Path | str) -> dict[str, Any]:
    """The `table` of a file without its `format`. Raises InputError for another one, with what to do."""
    found = table.get("format", FORMAT)
    if isinstance(found, bool) or not isinstance(found, int) or found < 1:
        raise InputError(
            path, [Fault("format", f"must be a whole number from 1; write format = {FORMAT}, or leave it out")]
        )
    if found > FORMAT:
        what = (
            f"is {found}, of a newer ctrlgen; this one reads {FORMAT}: install a newer one (pip install --upgrade ctrlgen). Do not lower "
            "the number: keys may have changed their meaning"
        )
        raise InputError(path, [Fault("format", what)])
    return {key: value for key, value in table.items() if key != "format"}
