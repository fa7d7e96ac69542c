"""Tables that fill some of their columns in each row, as programs write them that get one message after the other: PlotJuggler's CSV."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ctrlgen.recordings.formats.measurement_table import MeasurementTable
from ctrlgen.recordings.formats.number_cells import are_filled
from ctrlgen.recordings.formats.time_stamps import TIME_NAME
from ctrlgen.recordings.formats.unit_texts import bare_name

Column = np.ndarray[Any, Any]


def gathered(table: MeasurementTable) -> MeasurementTable:
    """The table with the rows of one instant as one, where no column is filled twice in an instant; itself for any other."""
    names = list(table.columns)
    time = next((name for name in names if TIME_NAME.match(bare_name(name))), None)
    if time is None or len(names) < 3 or table.clocks or table.own_times:
        return table
    clock = np.asarray(table.columns[time])
    begins = np.flatnonzero(np.r_[True, clock[1:] != clock[:-1]])
    if clock.dtype.kind not in "iufO" or not 1 < len(begins) < len(clock):
        return table
    place = np.repeat(np.arange(len(begins)), np.diff(np.r_[begins, len(clock)]))
    columns: dict[str, Column] = {time: clock[begins]}
    whole = True
    for name in names:
        if name == time:
            continue
        column = np.asarray(table.columns[name])
        filled = are_filled(column)
        if len(np.unique(place[filled])) < filled.sum():
            return table
        whole &= bool(filled.all())
        texts = column.dtype.kind == "O"
        columns[name] = np.full(len(begins), None if texts else np.nan, dtype=object if texts else float)
        columns[name][place[filled]] = column[filled]
    told = f"{len(clock)} rows fill some columns each: those of one {time} are read as one row, {len(begins)} in all"
    lines = [table.lines[k] for k in begins.tolist()] if len(table.lines) else ()
    ordered = {name: columns[name] for name in names}
    return table if whole else replace(table, columns=ordered, lines=lines, notes=(*table.notes, told))
