"""Tables that lie on their side: a row a signal, its name in the first cell, a column a sample."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.recordings.formats.measurement_table import MeasurementTable
from ctrlgen.recordings.formats.number_cells import NumberStyle
from ctrlgen.recordings.formats.unit_texts import split_name, unit_of
from ctrlgen.recordings.formats.written_layout import Layout

LONGER = 5  # times as many columns as rows
FEWEST = 20  # columns
Columns = Sequence[np.ndarray[Any, Any]]


def lies_on_its_side(columns: Columns) -> bool:
    """Whether every row of a table without a header is a name and far more numbers than there are rows."""
    names, numbers = columns[0], columns[1:]
    if len(numbers) < max(FEWEST, LONGER * len(names)) or names.dtype.kind != "O":
        return False
    distinct = len(set(names)) == len(names) and all(isinstance(name, str) and name for name in names)
    return distinct and all(column.dtype.kind in "iuf" for column in numbers)


def on_its_side(
    path: Path, columns: Columns, notes: Sequence[str], layout: Layout, style: NumberStyle
) -> MeasurementTable:
    """The table with a column a signal; a unit that stands behind a name is its unit."""
    names = [str(name) for name in columns[0]]
    values = np.array([np.asarray(column, dtype=float) for column in columns[1:]])
    units = {name: unit for name in names if (unit := split_name(name)[1] or _last_word(name)) is not None}
    told = f"each of {len(names)} rows is a signal, named by its first cell: read as columns of {number_of(len(values), 'sample')}"
    return MeasurementTable(
        path,
        {name: values[:, k] for k, name in enumerate(names)},
        units,
        notes=(*notes, told),
        style=style,
        missing=layout.missing,
    )


def _last_word(name: str) -> str | None:
    """The unit that a name of two words ends in, as `drive V`."""
    words = name.split()
    return unit_of(words[1]) if len(words) == 2 else None
