"""JSON: an object of lists, a list of row objects or one in each line, or a matrix under a name."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ctrlgen.recordings.formats.checked_files import fault
from ctrlgen.recordings.formats.measurement_table import MeasurementTable
from ctrlgen.recordings.formats.nested_columns import collected, columns_of
from ctrlgen.recordings.formats.text_encoding import decoded
from ctrlgen.recordings.formats.written_layout import Layout


def read(path: Path, layout: Layout) -> dict[str, MeasurementTable]:
    """The columns of a JSON file; null is a missing number. Raises InputError where a key stands twice, or what is no JSON."""
    text, notes = decoded(path, layout.encoding)

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        twice = (
            sorted({name for name, _ in pairs if [n for n, _ in pairs].count(name) > 1})
            if len(dict(pairs)) < len(pairs)
            else []
        )
        if twice:
            raise fault(
                path, f"holds the key {twice[0]!r} twice in one object, and one would hide the other; rename one"
            )
        return dict(pairs)

    try:
        rows = [line for line in text.split("\n") if line.strip()]
        several = len(rows) > 1 and all(line.lstrip().startswith("{") and line.rstrip().endswith("}") for line in rows)
        content = (
            [json.loads(row, object_pairs_hook=once) for row in rows]
            if several
            else json.loads(text, object_pairs_hook=once)
        )
    except json.JSONDecodeError as error:
        raise fault(path, f"is no JSON: line {error.lineno}: {error.msg}; export it again") from None
    if isinstance(content, list):
        content = _of_rows(content) if content and all(isinstance(row, dict) for row in content) else {"data": content}
    columns, units, aliases, said = collected(columns_of(content))
    return {
        "data": MeasurementTable(path, columns, units, notes=(*notes, *said), aliases=aliases, missing=layout.missing)
    }


def _of_rows(rows: list[dict[str, Any]]) -> dict[str, list[Any]]:
    """The columns of a list of rows; a key that a row does not have is missing there."""
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: [row.get(name) for row in rows] for name in names}
