"""NumPy: .npy and .npz, without anything that would have to be executed to be read."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ctrlgen.recordings.formats.checked_files import check_archive, check_size, fault
from ctrlgen.recordings.formats.measurement_table import MeasurementTable
from ctrlgen.recordings.formats.nested_columns import collected, columns_of
from ctrlgen.recordings.formats.written_layout import Layout


def read(path: Path, layout: Layout) -> dict[str, MeasurementTable]:
    """The arrays of a file by name, a structured array by its fields. Raises InputError for arrays of Python objects."""
    try:
        if path.suffix.lower() == ".npy":
            array = np.load(path, mmap_mode="r", allow_pickle=False)  # its size is known before it is read
            check_size(path, array.nbytes)
            arrays = {"data": array if array.ndim == 2 else np.array(array)}  # of a matrix each column is a copy
        else:
            check_archive(path)
            with np.load(path, allow_pickle=False) as file:
                arrays = {name: file[name] for name in file.files}
    except ValueError as error:
        raise fault(path, f"holds what is no array of numbers ({error}); save arrays of numbers alone") from None
    named = arrays["data"] if list(arrays) == ["data"] and arrays["data"].dtype.names else arrays
    columns, units, aliases, notes = collected(columns_of(named))
    return {"data": MeasurementTable(path, columns, units, notes=notes, aliases=aliases, missing=layout.missing)}
