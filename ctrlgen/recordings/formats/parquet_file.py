"""Parquet: columns by name, instants, units of a field's metadata."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ctrlgen.recordings.formats.checked_files import check_size, package
from ctrlgen.recordings.formats.measurement_table import MeasurementTable
from ctrlgen.recordings.formats.number_cells import is_reading
from ctrlgen.recordings.formats.written_layout import Layout


def read(path: Path, layout: Layout) -> dict[str, MeasurementTable]:
    """The columns of a Parquet file; structures are flattened, an empty cell is a missing number."""
    package("pyarrow", path)
    from pyarrow import parquet, types

    with parquet.ParquetFile(path) as file:
        check_size(path, 8.0 * file.metadata.num_rows * file.metadata.num_columns)
        table = file.read().flatten()
    columns: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    for field, chunks in zip(table.schema, table.columns, strict=True):
        values = _numbers(chunks, types)
        if values is not None:
            columns[field.name] = values
            unit = next(
                ((field.metadata or {}).get(key) for key in (b"unit", b"units") if (field.metadata or {}).get(key)),
                None,
            )
            if unit:
                units[field.name] = unit.decode("utf-8", "replace")
    return {"data": MeasurementTable(path, columns, units, missing=layout.missing)}


def _numbers(chunks: Any, types: Any) -> np.ndarray | None:
    """A column as numbers, instants, or cells of text; None for lists and bytes."""
    kind = chunks.type
    if types.is_timestamp(kind):
        return chunks.cast("timestamp[ns]").to_numpy().astype("datetime64[ns]")
    if types.is_duration(kind):
        return chunks.to_numpy().astype("timedelta64[ns]").astype(float) * 1e-9
    if types.is_decimal(kind) or types.is_boolean(kind):
        return chunks.cast("float64").to_numpy()
    if types.is_string(kind) or types.is_large_string(kind):
        cells = chunks.to_pylist()
        return np.array(cells, dtype=object) if any(c and is_reading(c) for c in cells[:1]) else None
    if types.is_integer(kind) or types.is_floating(kind):
        return chunks.to_numpy()
    return None
