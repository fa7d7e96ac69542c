"""Which format a device, scenario or recording file is written in: `format = 1`; a file that does not say is in the first."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ctrlgen.core.errors import Fault, InputError

FORMAT = 1
"""The one that this ctrlgen reads and writes. A change after which an older file would mean something else takes the next number, with
words in `in_this_format` for what to change."""


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
