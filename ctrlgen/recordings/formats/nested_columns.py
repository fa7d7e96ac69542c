"""Columns out of nested structures: of MATLAB, JSON, HDF5 and NumPy."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from ctrlgen.recordings.formats.number_cells import is_reading

LABELS = ("Name", "name", "label", "Label", "blockName", "title", "Title")
VALUES = ("Data", "data", "values", "Values", "value", "Value", "samples")
UNITS = ("Unit", "unit", "units", "Units")
WIDE = 4  # columns for each row, from which a matrix has its channels in rows: no record has so few rows


class Nested(NamedTuple):
    """A column of a structure: its name, numbers (n,) or instants, its unit where it is stated, another name, what was interpreted."""

    name: str
    values: np.ndarray
    unit: str | None = None
    alias: str | None = None
    note: str | None = None


def columns_of(value: Any, name: str = "", joint: str = ".") -> Iterator[Nested]:
    """Every numeric vector in nested structures with its name; scalars, text and ragged lists are left out.

    A structure with a label and values (a signal of Simulink, of dSPACE) is a column of that label.
    """
    if isinstance(value, Mapping):
        label = next((value[k].strip() for k in LABELS if isinstance(value.get(k), str) and value[k].strip()), None)
        key = next((k for k in VALUES if k in value and _is_numeric(value[k])), None)
        for member, content in value.items():
            path = f"{name}{joint}{member}" if name else str(member)
            unit = next((value[u] for u in UNITS if isinstance(value.get(u), str)), None)
            if label is not None and member == key:
                group = name.rpartition(joint)[0] if name.endswith("]") else name
                yield from _labelled(content, path, f"{group}{joint}{label}" if group else label, unit)
            elif unit is not None and member == key:  # named by what it stands in
                yield from _labelled(content, path, name, unit)
            else:
                yield from columns_of(content, path, joint)
        return
    if _is_list_of_structures(value):
        for k, member in enumerate(value):
            yield from columns_of(member, f"{name}[{k}]", joint)
        return
    yield from _vectors(value, name, joint)


def entries_beside(value: Any) -> Iterator[tuple[str, Any]]:
    """Every single number and text in nested structures, by its own name: `dt` and `Fs` stand beside columns."""
    for name, content in value.items() if isinstance(value, Mapping) else ():
        if isinstance(content, Mapping):
            yield from entries_beside(content)
        elif isinstance(content, str):
            yield str(name), content
        elif (
            isinstance(content, (int, float, np.ndarray))
            and np.size(content) == 1
            and np.asarray(content).dtype.kind in "iuf"
        ):
            yield str(name), float(np.asarray(content).ravel()[0])


def _labelled(content: Any, path: str, label: str, unit: str | None) -> Iterator[Nested]:
    for column in _vectors(content, path, "."):
        yield column._replace(unit=unit, alias=column.name.replace(path, label, 1))


def _is_list_of_structures(value: Any) -> bool:
    members = value.ravel().tolist() if isinstance(value, np.ndarray) and value.dtype == object else value
    return isinstance(members, list) and bool(members) and all(isinstance(m, Mapping) for m in members)


def _is_numeric(value: Any) -> bool:
    return any(True for _ in _vectors(value, "", "."))


def _vectors(value: Any, name: str, joint: str) -> Iterator[Nested]:
    """The columns of an array: its fields, its real and imaginary parts, its columns."""
    if isinstance(value, np.ndarray) and value.dtype.kind in "OU":
        value = value.ravel().tolist()
    array = value if isinstance(value, np.ndarray) else _as_array(value)
    if array is None:
        if stamps := _time_stamps(value):
            yield Nested(name, np.array(stamps, dtype=object))
        return
    if array.dtype.names:
        for member in array.dtype.names:
            yield from _vectors(array[member], f"{name}{joint}{member}" if name else member, joint)
        return
    if array.dtype.kind == "M" and array.ndim == 1:
        yield Nested(name, array)
        return
    if array.dtype.kind not in "fiubc":
        return
    if array.dtype.kind == "c":
        if not np.any(array.imag):
            yield from (
                v._replace(note=f"{v.name} is complex without imaginary part")
                for v in _vectors(array.real, name, joint)
            )
            return
        yield from _vectors(array.real, f"{name}{joint}real" if name else "real", joint)
        yield from _vectors(array.imag, f"{name}{joint}imag" if name else "imag", joint)
        return
    array = np.squeeze(array) if 1 in array.shape else array
    if array.ndim == 1:
        yield Nested(name, array if array.dtype.kind in "iu" else array.astype(float))
    elif array.ndim == 2:
        turned = array.shape[1] >= WIDE * array.shape[0]
        note = f"{name} is {array.shape[0]} x {array.shape[1]}: its rows are taken as columns" if turned else None
        for k, column in enumerate(array if turned else array.T):
            yield Nested(f"{name}[{k}]", column.astype(float), note=note)
    elif array.ndim == 3:  # Simulink: the last dimension is time
        for index in np.ndindex(array.shape[:2]):
            yield Nested(
                f"{name}[{','.join(map(str, index))}]",
                array[index].astype(float),
                note=f"{name}: its last dimension is taken as time",
            )


def _time_stamps(value: Any) -> list[str]:
    """A list of texts that are times or numbers; empty for any other."""
    cells = value if isinstance(value, list) else []
    return cells if cells and all(isinstance(c, str) for c in cells) and is_reading(cells[0]) and cells[0] else []


def _as_array(value: Any) -> np.ndarray | None:
    """A list of numbers as an array, None of text as no number; None for what is no array of numbers."""
    if isinstance(value, (str, bytes, bool)) or value is None:
        return None
    try:
        array = np.asarray(value)
        return array if array.dtype.kind in "fiubcM" or array.dtype.names else np.asarray(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        return None


def collected(
    columns: Iterator[Nested],
) -> tuple[dict[str, np.ndarray], dict[str, str], dict[str, str], tuple[str, ...]]:
    """Columns, units and further names by name, and notes. Raises ValueError where two columns would have one name."""
    found = list(columns)
    names, labels = Counter(c.name for c in found), Counter(c.alias for c in found)
    if twice := next((name for name, count in names.items() if count > 1), None):
        raise ValueError(f"two columns would be named {twice!r}; rename one")
    units = {c.name: c.unit for c in found if c.unit}
    aliases = {c.alias: c.name for c in found if c.alias and labels[c.alias] == 1}
    notes = tuple(dict.fromkeys(c.note for c in found if c.note))
    return {c.name: c.values for c in found}, units, aliases, notes
