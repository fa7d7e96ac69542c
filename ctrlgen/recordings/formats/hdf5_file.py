"""HDF5 and netCDF: datasets by their path, compound tables by their fields, attributes applied."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.recordings.formats.checked_files import check_size, fault, package
from ctrlgen.recordings.formats.measurement_table import MeasurementTable
from ctrlgen.recordings.formats.nested_columns import columns_of
from ctrlgen.recordings.formats.stated_rate import rate_of
from ctrlgen.recordings.formats.unapplied import APPLIED, factors_of, scale_of_counts, unapplied
from ctrlgen.recordings.formats.written_layout import Layout

UNITS = ("unit", "units", "Unit", "Units", "UNIT")
FILL = ("_FillValue", "missing_value")


def read(path: Path, layout: Layout) -> dict[str, MeasurementTable]:
    """Datasets by their path; `scale_factor`, `add_offset` and `_FillValue` are applied, `units` compared.

    Raises InputError where a dataset takes its numbers from another file.
    """
    h5py = package("h5py", path)
    columns: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    notes: list[str] = []
    scales: dict[str, float] = {}

    beside: list[tuple[str, Any]] = []

    def visit(name: str, node: Any) -> None:
        beside.extend((key, _attribute(node, key)) for key in node.attrs)
        if isinstance(node, h5py.Dataset) and node.shape == () and node.dtype.kind in "iuf":
            beside.append((name.rpartition("/")[2], node[()]))
        if not isinstance(node, h5py.Dataset) or name.startswith("#") or not _may_be_columns(h5py, node.dtype):
            return
        if node.external or node.is_virtual:
            raise fault(path, f"dataset {name!r} takes its numbers from another file; copy them into this one")
        check_size(path, node.size * node.dtype.itemsize)
        if h5py.check_string_dtype(node.dtype) is not None:
            columns.update({c.name: c.values for c in columns_of(node.asstr(errors="replace")[()].tolist(), name, "/")})
            return
        attributes = {key: _attribute(node, key) for key in (*UNITS, *FILL, "scale_factor", "add_offset")}
        value, said = _applied(node[()], attributes, name)
        factors = factors_of((key, _attribute(node, key)) for key in node.attrs if key not in APPLIED)
        notes.extend([*said, *unapplied(name, factors)])
        scale = scale_of_counts(value, factors)
        for column in columns_of(value, name, "/"):
            scales.update({column.name: scale} if scale is not None else {})
            columns[column.name] = column.values
            notes.extend([column.note] if column.note else [])
            unit = next((attributes[key] for key in UNITS if attributes[key] is not None), None)
            if unit is not None:
                units[column.name] = str(unit)

    with h5py.File(path, "r") as file:
        beside.extend((key, _attribute(file, key)) for key in file.attrs)
        file.visititems(visit)
    said = tuple(dict.fromkeys(notes))
    return {
        "data": MeasurementTable(
            path, columns, units, notes=said, missing=layout.missing, stated_rate=rate_of(beside), scales=scales
        )
    }


def _may_be_columns(h5py: Any, dtype: Any) -> bool:
    return dtype.kind in "fiubc" or bool(dtype.names) or h5py.check_string_dtype(dtype) is not None


def _attribute(node: Any, key: str) -> Any:
    """An attribute as a number or a text; None where there is none."""
    value = node.attrs.get(key)
    if isinstance(value, np.ndarray):
        value = value.ravel()[0] if value.size else None
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else value


def _applied(value: Any, attributes: dict[str, Any], name: str) -> tuple[Any, list[str]]:
    """The numbers of a dataset after its attributes, in the order of the CF conventions: fill value, factor, offset."""
    if value.dtype.names or value.dtype.kind == "c":
        return value, []
    fill = next((attributes[key] for key in FILL if attributes[key] is not None), None)
    factor, offset = attributes["scale_factor"], attributes["add_offset"]
    notes = []
    if fill is not None and not isinstance(fill, str):
        none = value == fill
        if np.any(none):
            value = np.where(none, np.nan, value.astype(float))
            notes.append(
                f"{number_of(int(np.sum(none)), f'reading of {name} is', f'readings of {name} are')} its fill value {fill:g}: left out"
            )
    if factor is not None or offset is not None:
        factor, offset = (1.0 if factor is None else float(factor)), (0.0 if offset is None else float(offset))
        value = value * factor + offset
        notes.append(f"{name} is its numbers times {factor:g} plus {offset:g}, as its attributes say")
    return value, notes
