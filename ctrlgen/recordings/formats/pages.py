"""One table on several pages of a text, or in several segments, each of which repeats the names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ctrlgen.core.errors import InputError
from ctrlgen.recordings.formats.measurement_table import MeasurementTable
from ctrlgen.recordings.formats.time_stamps import TIME_NAME, epoch_unit
from ctrlgen.recordings.formats.unit_texts import bare_name

NEAR = 0.5  # of a step: how exactly a page goes on in time where the one before it ends


def joined(tables: Sequence[MeasurementTable]) -> list[MeasurementTable]:
    """The tables as one where they have the same names and units and each goes on in time, by its usual step, where the one before it ends;
    as they are where one does not: it may be another run."""
    first = tables[0] if tables else None
    if first is None or len(tables) < 2 or not _are_alike(tables):
        return list(tables)
    columns = {
        name: np.concatenate([np.asarray(table.columns[name]) for table in tables])  # texts make objects of numbers
        for name in first.columns
    }
    whole = replace(first, columns=columns, lines=[line for table in tables for line in table.lines])
    timed = [name for name in columns if TIME_NAME.match(bare_name(name))]
    seams = np.cumsum([len(table.lines) for table in tables])[:-1] - 1
    if not any(_goes_on(whole, name, seams) for name in timed):
        return list(tables)
    again = ", ".join(str(table.lines[0]) for table in tables[1:])
    told = (
        f"its names stand again above line{'s' * (len(tables) > 2)} {again}, and time goes on there: read as one table"
    )
    return [replace(whole, notes=tuple(dict.fromkeys((*(note for table in tables for note in table.notes), told))))]


def _are_alike(tables: Sequence[MeasurementTable]) -> bool:
    """Whether tables have the same named columns, in the same units and style, and clocks of their own in none."""
    first = tables[0]
    return (
        all(
            list(a.columns) == list(b.columns)
            and a.units == b.units
            and a.style == b.style
            and not b.clocks
            and not b.own_times
            for a, b in pairwise(tables)
        )
        and len(first.nameless) < len(first.columns)
        and not first.clocks
        and not first.own_times
    )


def _goes_on(table: MeasurementTable, name: str, seams: np.ndarray) -> bool:
    """Whether the time of a column rises, and from row `seams` (n,) to the next as it usually does."""
    column = table.columns[name]
    try:
        time = table.time(name, (None if column.dtype.kind == "O" else epoch_unit(column)) or "s").values
    except InputError:
        return False
    steps = np.diff(time)
    usual = float(np.median(steps)) if len(steps) and np.isfinite(time).all() else 0.0
    return usual > 0 and bool(np.all(steps > 0) and np.all(np.abs(steps[seams] / usual - 1) <= NEAR))
