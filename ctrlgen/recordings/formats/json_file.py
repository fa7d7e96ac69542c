"""JSON: an object of lists, a list of row objects or one in each line, or a matrix under a name."""

from __future__ import annotations

import json
from collections.abc import Collection
from pathlib import Path
from typing import Any

from ctrlgen.recordings.formats.checked_files import fault
from ctrlgen.recordings.formats.measurement_table import MeasurementTable
from ctrlgen.recordings.formats.nested_columns import collected, columns_of, entries_beside
from ctrlgen.recordings.formats.stated_rate import rate_of
from ctrlgen.recordings.formats.text_encoding import decoded
from ctrlgen.recordings.formats.unit_columns import units_beside
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
    content = _as_columns(content)
    columns, units, aliases, said = collected(columns_of(content))
    units = _units_of_rows(content, columns) | units
    return {
        "data": MeasurementTable(
            path,
            columns,
            units,
            notes=(*notes, *said),
            aliases=aliases,
            missing=layout.missing,
            stated_rate=rate_of(entries_beside(content)),
        )
    }


def _as_columns(content: Any) -> Any:
    """What a JSON file holds as columns by name: rows, a matrix with names, or numbers by row as pandas writes all three."""
    if isinstance(content, list):
        rows = bool(content) and all(isinstance(row, dict) for row in content)
        return _of_rows([_flat(row) for row in content]) if rows else {"data": content}
    if (
        isinstance(content, dict)
        and len(content) > 1
        and all(isinstance(part, dict) and part for part in content.values())
    ):
        first = next(iter(content.values()))
        if all(list(part) == list(first) for part in content.values()) and not any(map(_is_nested, first.values())):
            by_row = {name: [row[name] for row in content.values()] for name in first}
            return (
                by_row if len(content) > len(first) else {name: list(part.values()) for name, part in content.items()}
            )
    return _with_names(content)


def _units_of_rows(content: Any, columns: Collection[str]) -> dict[str, str]:
    """Units that stand in every row beside their number, by the name of its column."""
    lists = (
        {name: cells for name, cells in content.items() if isinstance(cells, list)} if isinstance(content, dict) else {}
    )
    names = list(lists)
    texts = {
        k: lists[name]
        for k, name in enumerate(names)
        if name not in columns and all(isinstance(c, str) for c in lists[name])
    }
    beside = units_beside(names, texts, {k for k, name in enumerate(names) if name in columns})
    return {names[k]: texts[j][0] for k, j in beside.items()}


def _with_names(content: Any) -> Any:
    """The same with every matrix of rows that stands beside the names of its columns as these columns."""
    if isinstance(content, list):
        return [_with_names(part) for part in content]
    if not isinstance(content, dict):
        return content
    names = content.get("columns")
    key = next((key for key in ("data", "values", "rows") if isinstance(content.get(key), list)), None)
    if key is not None and isinstance(names, list) and names and all(isinstance(name, str) for name in names):
        rows = content[key]
        if len(set(names)) == len(names) and all(isinstance(row, list) and len(row) == len(names) for row in rows):
            return {name: [row[k] for row in rows] for k, name in enumerate(names)}
    return {name: _with_names(part) for name, part in content.items()}


def _is_nested(value: Any) -> bool:
    return isinstance(value, (dict, list))


def _flat(row: dict[str, Any], above: str = "") -> dict[str, Any]:
    """A row with the values of its inner objects as `outer.inner`."""
    flat: dict[str, Any] = {}
    for name, value in row.items():
        inner = _flat(value, f"{above}{name}.") if isinstance(value, dict) else {f"{above}{name}": value}
        if twice := sorted(set(inner) & set(flat)):
            raise ValueError(f"two keys would be named {twice[0]!r}; rename one")
        flat |= inner
    return flat


def _of_rows(rows: list[dict[str, Any]]) -> dict[str, list[Any]]:
    """The columns of a list of rows; a key that a row does not have is missing there."""
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: [row.get(name) for row in rows] for name in names}
