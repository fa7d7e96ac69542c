"""Reading measurement files: one reader per format, each giving named columns of numbers.

Text (.csv, .dat, .txt), MATLAB (.mat up to 7, and 7.3), HDF5, TDMS, MDF4 and JSON. A column of a matrix is named `matrix[k]`, a field
of a MATLAB or JSON structure `structure.field`, a dataset of HDF5 and a channel of TDMS by its path `group/name`.
"""

from __future__ import annotations

import csv
import difflib
import io
import json
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from itertools import groupby
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import scipy

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.files import read_text

MISSING = {"", "nan", "na", "n/a", "null", "none", "-nan", "nan(ind)", "-nan(ind)", "1.#qnan"}
FEWEST_ROWS = 2  # of a table among other text
MOST_LISTED = 5  # bad cells or lines of a file that a message lists; the others are counted


@dataclass(frozen=True)
class MeasurementTable:
    """The columns of one file by name: numbers (n,), or cells of text (CSV) that `numbers` converts.

    `units`: those that the file itself states. `lines`: the line number of each row in a text file.
    """

    path: Path
    columns: dict[str, Any]
    units: dict[str, str] = field(default_factory=dict)
    lines: tuple[int, ...] = ()

    def find(self, wanted: str | int) -> str:
        """The full name of a column that is given by name, by number from 0, without its `[unit]`, or without its group.

        Raises InputError that lists the columns, or the nearest name.
        """
        names = list(self.columns)
        if isinstance(wanted, int):
            if 0 <= wanted < len(names):
                return names[wanted]
            raise self._fault(f"has columns 0 to {len(names) - 1}, not {wanted}")
        for shorten in (str, lambda name: name.partition("[")[0].strip(), lambda name: re.split(r"[/.]", name)[-1]):
            matching = [name for name in names if shorten(name) == wanted]
            if len(matching) == 1:
                return matching[0]
            if matching:
                raise self._fault(f"has {len(matching)} columns {wanted!r}: write one of {', '.join(matching)}")
        near = difflib.get_close_matches(wanted, names, n=1)
        listed = ", ".join(names[:20]) + (", ..." if len(names) > 20 else "")
        raise self._fault(
            f"has no column {wanted!r}; "
            + (f"did you mean {near[0]!r}?" if near else f"its columns are: {listed or 'none'}")
        )

    def numbers(self, name: str) -> np.ndarray:
        """Column `name` as float64 (n,), NaN where a cell is empty or a word for missing. Raises InputError for other text."""
        column = self.columns[name]
        if isinstance(column, np.ndarray):
            return column
        values, faults = np.full(len(column), np.nan), []
        comma = not any("." in cell for cell in column) and any("," in cell for cell in column)
        for k, cell in enumerate(column):
            if cell.lower() in MISSING:
                continue
            try:
                values[k] = float(cell.replace(",", ".") if comma else cell)
            except ValueError:
                faults.append(f"line {self.lines[k]} {cell!r}")
        if faults:
            more = f" and {len(faults) - MOST_LISTED} more" if len(faults) > MOST_LISTED else ""
            listed = ", ".join(faults[:MOST_LISTED]) + more
            raise self._fault(
                f"column {name!r} holds text that is no number ({listed}); write numbers, leave missing ones empty"
            )
        return values

    def _fault(self, what: str) -> InputError:
        return InputError(self.path, [Fault(self.path.name, what)])


def read_table(path: Path, which: int | None = None) -> MeasurementTable:
    """The columns of a measurement file, of its table `which` from 1 where it holds several.

    Raises InputError where it does not exist, cannot be read, needs a package, or has no such table.
    """
    if path.is_dir():
        raise InputError(path, [Fault(path.name, "is a folder; name the file inside it")])
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        known = ", ".join(READERS)
        raise InputError(
            path,
            [
                Fault(
                    path.name,
                    f"has the ending {path.suffix or 'none'!r}, which is no known format; known are {known}: export it as one of these",
                )
            ],
        )
    if not path.is_file():
        raise InputError(path, [Fault(path.name, f"does not exist in {path.parent}; check the name")])
    if which is not None and reader is not read_csv:
        raise InputError(path, [Fault(path.name, "table: is for text files with several tables; leave it out")])
    try:
        if which is None:
            return reader(path)
        tables = read_tables(path)
        if which > len(tables):
            raise InputError(path, [Fault(path.name, f"holds tables 1 to {len(tables)}, not {which}")])
        return tables[which - 1]
    except InputError:
        raise
    except Exception as error:  # the libraries raise dozens of types for a damaged file
        what = f"cannot be read as {path.suffix}: {type(error).__name__}: {error}; export it again"
        raise InputError(path, [Fault(path.name, what)]) from None


def read_csv(path: Path) -> MeasurementTable:
    """The only table of a text file. Raises InputError where it holds several."""
    tables = read_tables(path)
    if len(tables) > 1:
        each = ", ".join(f"{k} from line {t.lines[0]}, {len(t.lines)} rows" for k, t in enumerate(tables, 1))
        raise InputError(path, [Fault(path.name, f"holds {len(tables)} tables ({each}); write table = 1 or another")])
    return tables[0]


def read_tables(path: Path) -> list[MeasurementTable]:
    """The tables of a text file, separated by comma, semicolon or tab; lines with # are skipped.

    A table is a run of rows of numbers under a header, unless the rows begin at once. Where other text stands around it, its
    header is the last line above of as many cells; where that repeats a name, columns go by number. Raises InputError.
    """
    text = read_text(path).removeprefix("\ufeff")
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    separator = next((mark for mark in "\t;," if lines and mark in lines[-1]), ",")
    reader = csv.reader(io.StringIO(text), delimiter=separator)
    rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader]
    rows = [(line, row) for line, row in rows if any(row) and not row[0].startswith("#")]
    if not rows:
        raise InputError(path, [Fault(path.name, "has no rows; write a header and one row per sample")])
    if len({len(row) for _, row in rows}) > 1 and (tables := _runs_of_numbers(rows, path)):
        return tables
    width = len(rows[0][1])
    ragged = [f"line {line} has {len(row)}" for line, row in rows if len(row) != width]
    if ragged:
        listed = ", ".join(ragged[:MOST_LISTED]) + (", ..." if len(ragged) > MOST_LISTED else "")
        raise InputError(path, [Fault(path.name, f"line {rows[0][0]} has {width} cells, but {listed}; repair these")])
    header = not all(_is_number(cell) for cell in rows[0][1])
    names = rows[0][1] if header else [str(k) for k in range(width)]
    twice = sorted({name for name in names if names.count(name) > 1 and name})
    if twice and all(_is_number(cell) for _, row in rows[-FEWEST_ROWS:] for cell in row) and not _is_table(rows[1:]):
        return _runs_of_numbers(rows, path)  # several lines of header
    if twice:
        raise InputError(path, [Fault(path.name, f"column {twice[0]!r} occurs twice in the header; rename one")])
    return [_text_table(path, names, rows[header:])]


def _is_table(rows: Sequence[tuple[int, list[str]]]) -> bool:
    return all(_is_number(cell) for _, row in rows for cell in row)


def _text_table(path: Path, names: list[str], body: Sequence[tuple[int, list[str]]]) -> MeasurementTable:
    cells = list(zip(*(row for _, row in body), strict=True)) or [()] * len(names)
    units = {name: match[1].strip() for name in names if (match := re.search(r"\[([^]]+)\]$", name))}
    return MeasurementTable(path, dict(zip(names, cells, strict=True)), units, tuple(line for line, _ in body))


def _runs_of_numbers(rows: Sequence[tuple[int, list[str]]], path: Path) -> list[MeasurementTable]:
    """The tables among other text: runs of at least `FEWEST_ROWS` rows of numbers of one width. None where rows of numbers of
    different widths follow each other: there the file is damaged."""
    tables: list[MeasurementTable] = []
    above: list[list[str]] = []
    for numeric, group in groupby(rows, key=lambda row: _is_table([row]) and any(row[1])):
        run = list(group)
        if not numeric:
            above = [row for _, row in run]
            continue
        width = len(run[0][1])
        if any(len(row) != width for _, row in run):
            return []
        names = next((row for row in reversed(above) if len(row) == width), [])
        if len(set(names)) < width:
            names = [str(k) for k in range(width)]
        if len(run) >= FEWEST_ROWS:
            tables.append(_text_table(path, names, run))
    return tables


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return cell.lower() in MISSING
    return True


def read_mat(path: Path) -> MeasurementTable:
    """Variables of a .mat file, structures flattened; version 7.3 is HDF5 with rows and columns exchanged, read by h5py."""
    try:
        content = scipy.io.loadmat(path, simplify_cells=True)
    except NotImplementedError:
        return _read_h5(path, ".", turned=True)
    return MeasurementTable(path, dict(_flat({k: v for k, v in content.items() if not k.startswith("__")}, "")))


def read_hdf5(path: Path) -> MeasurementTable:
    """Datasets by their path; their unit is the attribute `unit` or `units`."""
    return _read_h5(path, "/", turned=False)


def _read_h5(path: Path, joint: str, turned: bool) -> MeasurementTable:
    h5py = _package("h5py", path)
    columns: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}

    def visit(name: str, node: Any) -> None:
        if not isinstance(node, h5py.Dataset) or name.startswith("#") or node.dtype.kind not in "fiub":
            return
        value = node[()]
        name = name.replace("/", joint)
        for column, numbers in _flat(value.T if turned else value, name):
            columns[column] = numbers
            unit = node.attrs.get("unit", node.attrs.get("units"))
            if unit is not None:
                units[column] = unit.decode() if isinstance(unit, bytes) else str(unit)

    with h5py.File(path, "r") as file:
        file.visititems(visit)
    return MeasurementTable(path, columns, units)


def read_tdms(path: Path) -> MeasurementTable:
    """Channels of LabVIEW's TDMS as `group/channel`; their unit is the property `unit_string`."""
    nptdms = _package("nptdms", path)
    columns, units = {}, {}
    with nptdms.TdmsFile.open(path) as file:
        for group in file.groups():
            for channel in group.channels():
                for name, numbers in _flat(np.asarray(channel[:]), f"{group.name}/{channel.name}"):
                    columns[name] = numbers
                    if channel.properties.get("unit_string"):
                        units[name] = str(channel.properties["unit_string"])
    return MeasurementTable(path, columns, units)


def read_mdf4(path: Path) -> MeasurementTable:
    """Channels of ASAM MDF; `time` is the master channel, and all channels must have the same one."""
    asammdf = _package("asammdf", path)
    columns: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    clocks: list[np.ndarray] = []
    with asammdf.MDF(path) as file:
        for signal in file.iter_channels(skip_master=True):
            if signal.name in columns:
                raise InputError(
                    path, [Fault(path.name, f"channel {signal.name!r} occurs in several groups; keep one")]
                )
            columns.update(_flat(np.asarray(signal.samples), signal.name))
            units[signal.name] = signal.unit
            clocks.append(np.array(signal.timestamps))
    if any(not np.array_equal(clock, clocks[0]) for clock in clocks):
        what = "holds channels sampled at different times; resample them to one raster (MDF.resample) and save"
        raise InputError(path, [Fault(path.name, what)])
    if clocks:
        columns = {"time": clocks[0], **{name: column for name, column in columns.items() if name != "time"}}
    return MeasurementTable(path, columns, {name: unit for name, unit in units.items() if unit})


def read_json(path: Path) -> MeasurementTable:
    """An object of lists, a list of row objects, or a matrix (list of rows) under a name; null is a missing number."""
    content = json.loads(read_text(path))
    if isinstance(content, list):
        if content and all(isinstance(row, dict) for row in content):
            names = list(dict.fromkeys(name for row in content for name in row))
            content = {name: [row.get(name) for row in content] for name in names}
        else:
            content = {"data": content}
    return MeasurementTable(path, dict(_flat(content, "")))


def _flat(value: Any, name: str) -> Iterator[tuple[str, np.ndarray]]:
    """Every numeric vector in nested structures with its name; scalars, text and ragged lists are left out."""
    if isinstance(value, dict):
        for key, member in value.items():
            yield from _flat(member, f"{name}.{key}" if name else str(key))
        return
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        return
    if array.ndim == 2 and 1 in array.shape:
        array = array.ravel()
    if array.ndim == 1:
        yield name, array
    elif array.ndim == 2:
        for k in range(array.shape[1]):
            yield f"{name}[{k}]", array[:, k]


def _package(name: str, path: Path) -> ModuleType:
    """An optional package. Raises InputError with the command that installs it."""
    try:
        return import_module(name)
    except ImportError:
        installed = {"nptdms": "npTDMS"}.get(name, name)
        what = f"needs the package {installed}; install it with: pip install {installed} (or pip install 'ctrlgen[recordings]')"
        raise InputError(path, [Fault(path.name, what)]) from None


READERS: dict[str, Callable[[Path], MeasurementTable]] = {
    ".csv": read_csv,
    ".dat": read_csv,
    ".txt": read_csv,
    ".mat": read_mat,
    ".h5": read_hdf5,
    ".hdf5": read_hdf5,
    ".tdms": read_tdms,
    ".mf4": read_mdf4,
    ".json": read_json,
}
