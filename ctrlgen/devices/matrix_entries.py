"""Entries of a matrix that a file states, each with its unit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated

from ctrlgen.core.counts import number_of
from ctrlgen.core.units import In, Quantity, same_dimension, written_unit

Entry = Annotated[Quantity, In(None)]
SI = {"theta": "rad", "delta": "m", "F": "N", "M": "N*m"}


def units_of(components: Sequence[str]) -> dict[str, str]:
    """The SI unit of each component of a twist or wrench, such as theta_x or F_y."""
    return {name: SI[name.split("_")[0]] for name in components}


def entry_faults(
    key: str, stated: Sequence[Sequence[Quantity]], rows: Mapping[str, str], columns: Mapping[str, str]
) -> list[str]:
    """Rows and entries of the matrix `key` that are too few or too many, and entries that are not in the unit of their row by that of their
    column; `rows` and `columns`: the unit of each by its name. A zero needs no unit."""
    if len(stated) != len(rows) or any(len(row) != len(columns) for row in stated):
        shape = f"{number_of(len(rows), 'row')} of {number_of(len(columns), 'entry', 'entries')}"
        return [f"{key}: must have {shape}, for {', '.join(rows)} by {', '.join(columns)}"]
    faults = []
    for i, ((row, of), entries) in enumerate(zip(rows.items(), stated, strict=True)):
        for j, ((column, per), entry) in enumerate(zip(columns.items(), entries, strict=True)):
            written = written_unit(entry.text)
            if same_dimension(written, f"({of})/({per})") or (entry.si == 0 and written == "1"):
                continue
            faults.append(
                f'{key}[{i}][{j}]: {row} per {column} = {entry.text!r} has the wrong unit; write for example "1 {_unit(of, per)}", or 0'
            )
    return faults


def with_units(
    stated: Sequence[Sequence[Quantity]], rows: Mapping[str, str], columns: Mapping[str, str]
) -> tuple[tuple[Quantity, ...], ...]:
    """The entries, a zero without a unit in that of an entry of its dimension, first of its row, or in SI where none states one: a
    diagnosis that finds it otherwise tells and writes it in that unit."""
    units = [[unit for e in row if (unit := written_unit(e.text)) != "1"] for row in stated]

    def of_its_place(entry: Quantity, i: int, of: str, per: str) -> Quantity:
        if written_unit(entry.text) != "1" or entry.si:
            return entry
        own = _unit(of, per)
        near = [*units[i], *(unit for row in units for unit in row), own]
        return replace(entry, text=f"0 {next(unit for unit in near if same_dimension(unit, own))}")

    return tuple(
        tuple(of_its_place(entry, i, of, per) for entry, per in zip(row, columns.values(), strict=True))
        for i, (row, of) in enumerate(zip(stated, rows.values(), strict=True))
    )


def _unit(of: str, per: str) -> str:
    return "/".join(f"({unit})" if set(unit) & set("*/") else unit for unit in (of, per))
