"""MATLAB: .mat up to version 7 by scipy, version 7.3, which is HDF5, by h5py."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import scipy

from ctrlgen.recordings.formats.checked_files import check_size, fault, package
from ctrlgen.recordings.formats.measurement_table import MeasurementTable
from ctrlgen.recordings.formats.nested_columns import collected, columns_of, entries_beside
from ctrlgen.recordings.formats.stated_rate import rate_of
from ctrlgen.recordings.formats.written_layout import Layout

OBJECTS = "timeseries, tables, datetimes and strings are objects of MATLAB, which nothing else reads"
REMEDY = "save numbers: t = ts.Time; x = ts.Data; save(file, 't', 'x'), or Format: Structure with time in Simulink"
DEEPEST = 50  # structures inside one another


def read(path: Path, layout: Layout) -> dict[str, MeasurementTable]:
    """Variables of a .mat file, structures flattened, signals of Simulink and dSPACE also by their label.

    Raises InputError where it holds nothing but objects of MATLAB.
    """
    try:
        content = scipy.io.loadmat(path, simplify_cells=True)
    except NotImplementedError:
        content = _read_7_3(path)
    variables = {name: value for name, value in content.items() if not name.startswith("__")}
    columns, units, aliases, notes = collected(columns_of(variables))
    if not columns and content:
        raise fault(path, f"holds no columns of numbers ({OBJECTS}); {REMEDY}")
    rate = rate_of(entries_beside(variables))
    table = MeasurementTable(
        path, columns, units, notes=notes, aliases=aliases, missing=layout.missing, stated_rate=rate
    )
    return {"data": table}


def _read_7_3(path: Path) -> dict[str, Any]:
    """The variables of a version 7.3 file; rows and columns are exchanged there."""
    h5py = package("h5py", path)
    with h5py.File(path, "r") as file:
        return {name: _value(path, file, node, 0) for name, node in file.items() if not name.startswith("#")}


def _value(path: Path, file: Any, node: Any, depth: int) -> Any:
    """A variable of version 7.3: a structure, a list of structures, text, or numbers."""
    if depth > DEEPEST:
        raise fault(path, f"holds structures more than {DEEPEST} deep inside one another; save the columns alone")
    if hasattr(node, "items"):
        members = {name: _value(path, file, member, depth + 1) for name, member in node.items()}
        listed = {name: value for name, value in members.items() if isinstance(value, list)}
        lengths = {len(value) for value in listed.values()}
        if members and len(listed) == len(members) and len(lengths) == 1:  # an array of structures
            return [dict(zip(listed, row, strict=True)) for row in zip(*listed.values(), strict=True)]
        return members
    check_size(path, node.size * node.dtype.itemsize)
    kind = node.attrs.get("MATLAB_class", b"")
    if node.dtype.kind == "O":
        return [_value(path, file, file[reference], depth + 1) for reference in np.ravel(node[()], order="F")]
    if node.attrs.get("MATLAB_empty", 0) or "MATLAB_object_decode" in node.attrs:
        return None
    value = node[()]
    if kind == b"char":
        return "".join(map(chr, np.ravel(value)))
    if value.dtype.names == ("real", "imag"):
        value = value["real"] + 1j * value["imag"]
    return np.asarray(value).T
