"""Measurement files: one reader per format, each giving the columns of its tables by name.

A column of a matrix is named `matrix[k]`, a field of a MATLAB or JSON structure `structure.field`, a dataset of HDF5 and a channel of
TDMS by its path `group/name`. No reader executes what a file holds, and none begins with a file that is too large.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import InputError
from ctrlgen.recordings.formats.checked_files import check_size, fault
from ctrlgen.recordings.formats.long_form import widened
from ctrlgen.recordings.formats.measurement_table import MeasurementTable
from ctrlgen.recordings.formats.sparse_rows import gathered
from ctrlgen.recordings.formats.split_seconds import with_whole_time
from ctrlgen.recordings.formats.written_layout import Layout

Reader = Callable[[Path, Layout], dict[str, MeasurementTable]]
TEXT, MATLAB, HDF5, TDMS = "long_text_file", "matlab_file", "hdf5_file", "tdms_file"
MDF, JSON, EXCEL, PARQUET, NUMPY = "mdf_file", "json_file", "excel_file", "parquet_file", "numpy_file"
READERS: dict[str, str] = {
    ".csv": TEXT,
    ".dat": TEXT,
    ".txt": TEXT,
    ".tsv": TEXT,
    ".asc": TEXT,
    ".log": TEXT,
    ".lvm": TEXT,
    ".plt": TEXT,
    ".prn": TEXT,
    ".mat": MATLAB,
    ".h5": HDF5,
    ".hdf5": HDF5,
    ".tdms": TDMS,
    ".mf4": MDF,
    ".mdf": MDF,
    ".json": JSON,
    ".jsonl": JSON,
    ".ndjson": JSON,
    ".xlsx": EXCEL,
    ".xlsm": EXCEL,
    ".parquet": PARQUET,
    ".npz": NUMPY,
    ".npy": NUMPY,
}
"""Module of the reader of each ending."""
BEGINNINGS = (
    (b"\x89HDF\r\n\x1a\n", HDF5),
    (b"MATLAB 5.0 MAT", MATLAB),
    (b"MATLAB 7.3 MAT", MATLAB),
    (b"TDSm", TDMS),
    (b"MDF     ", MDF),
    (b"PAR1", PARQUET),
    (b"\x93NUMPY", NUMPY),
)
"""First bytes of files of one kind, whatever their ending."""
OBJECTS = (b'{"', b"[{", b"{\n", b"{\r")
"""First characters of JSON that a logger has written under the ending of a text."""
FOREIGN = {
    b"\xd0\xcf\x11\xe0": "is a workbook of Excel before 2007; save it as .xlsx or .csv",
    b"CDF": "is netCDF 3; write it as netCDF 4: nccopy -k nc4 old.nc new.nc",
    b"SQLite format 3": "is a data base, as ROS 2 bags are; export its topics as CSV",
    b"RIFF": "is sound (WAV); export its samples as CSV",
    b"\x1f\x8b": "is compressed by gzip; unpack it",
    b"LOGG": "is a log of a CAN bus (BLF); decode it with the data base of the bus (DBC), to CSV or MDF",
    b"#ROSBAG": "is a bag of ROS; print a topic as a table: rostopic echo -b run.bag -p /topic > log.csv",
    b"\x89MCAP": "is a bag of ROS 2 (MCAP); play it, and print a topic as a table: ros2 topic echo --csv /topic > log.csv",
    b"ULog\x01": "is a log of PX4; convert it: ulog2csv log.ulg",
    b"<?xml": "is XML, such as a header of DIAdem (.tdm); export it as TDMS or CSV",
}
"""First bytes of files that no reader here takes, and what to do."""
ARCHIVES = frozenset((".zip", ".7z", ".rar", ".tar", ".tgz"))


def read_table(path: Path, which: int | str | None = None, layout: Layout | None = None) -> MeasurementTable:
    """The columns of a measurement file, of its table `which` from 1, or by name, where it holds several.

    Raises InputError where it does not exist, cannot be read, needs a package, has no such table, or can be read two ways that
    `layout` does not decide.
    """
    if path.is_dir():
        raise fault(path, "is a folder; name the file inside it")
    if not path.is_file():
        if path.suffix.lower() not in READERS:
            raise fault(path, _unknown(path))
        raise fault(path, f"does not exist in {path.parent}; check the name")
    module = _module(path)
    try:
        check_size(path, path.stat().st_size)
        reader: Reader = import_module(f"ctrlgen.recordings.formats.{module}").read
        return with_whole_time(gathered(widened(_chosen(path, reader(path, layout or Layout()), which))))
    except InputError:
        raise
    except RecursionError:
        what = f"cannot be read as {path.suffix or module}: structures stand hundreds deep inside one another; export the columns alone"
        raise fault(path, what) from None
    except Exception as error:  # the libraries raise dozens of types for a damaged file
        what = f"cannot be read as {path.suffix or module}: {type(error).__name__}: {error}; export it again"
        raise fault(path, what) from None


def _module(path: Path) -> str:
    """The reader of a file, by its first bytes or its ending. Raises InputError where neither is known and it is no text."""
    with path.open("rb") as file:
        head = file.read(4096)
    for begin, remedy in FOREIGN.items():
        if head.startswith(begin):
            raise fault(path, remedy)
    for begin, module in BEGINNINGS:
        if head.startswith(begin):
            return MATLAB if path.suffix.lower() == ".mat" else module
    known = READERS.get(path.suffix.lower())
    if known is None and b"\0" in head:
        raise fault(path, _unknown(path))
    return JSON if known in (TEXT, None) and head.lstrip()[:2] in OBJECTS else known or TEXT


def _unknown(path: Path) -> str:
    if path.suffix.lower() in ARCHIVES:
        return "is an archive; unpack it"
    what = f"has the ending {path.suffix or 'none'!r}, which is no known format"
    return f"{what}; known are {', '.join(READERS)}: export it as one of these"


def _chosen(path: Path, tables: dict[str, MeasurementTable], which: int | str | None) -> MeasurementTable:
    """The table that is asked for, or the only one. Raises InputError that lists the tables."""
    names = list(tables)
    if which is None and len(tables) == 1:
        return tables[names[0]]
    each = ", ".join(f"{k}: {name}" for k, name in enumerate(names, 1))
    if which is None:
        raise fault(path, f"holds {len(tables)} tables ({each}); write table = 1 or another (ctrlgen look: --table 1)")
    if isinstance(which, str) and which in tables:
        return tables[which]
    if isinstance(which, int) and 1 <= which <= len(tables):
        return tables[names[which - 1]]
    raise fault(path, f"holds {number_of(len(tables), 'table')} ({each}), not table {which!r}")
