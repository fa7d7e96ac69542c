"""One table on several pages of a text, or in several segments, each of which repeats the names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ctrlgen.core.errors import InputError
from ctrlgen.recordings.formats.measurement_table import MeasurementTable
from ctrlgen.recordings.formats.time_stamps import TIME_NAME
from ctrlgen.recordings.formats.unit_texts import bare_name

NEAR = 0.5  # of a step: how exactly a page goes on in time where the one before it ends


def joined(tables: Sequence[MeasurementTable]) -> list[MeasurementTable]:
    """The tables as one where they have the same names and units and each goes on in time, by its usual step, where the one before it ends;
    as they are where one does not: it may be another run."""
    first = tables[0] if tables else None
    if first is None or len(tables) < 2 or not _are_alike(tables):
        return list(tables)
    columns = {
        name: np.concatenate([np.asarray(table.columns[name], dtype=_kind(tables, name)) for table in tables])
        for name in first.columns
    }
    whole = replace(first, columns=columns, lines=[line for table in tables for line in table.lines])
    timed = next((name for name in columns if TIME_NAME.match(bare_name(name))), None)
    try:
        time = whole.time(timed, "s").values if timed is not None else np.empty(0)
    except InputError:
        return list(tables)
    steps = np.diff(time)
    usual = float(np.median(steps)) if len(steps) and np.isfinite(time).all() else 0.0
    seams = np.cumsum([len(table.lines) for table in tables])[:-1] - 1
    if not usual > 0 or np.any(steps <= 0) or np.any(np.abs(steps[seams] / usual - 1) > NEAR):
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


def _kind(tables: Sequence[MeasurementTable], name: str) -> type:
    texts = any(np.asarray(table.columns[name]).dtype.kind == "O" for table in tables)
    return object if texts else float
