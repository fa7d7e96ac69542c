"""Workbooks of Excel: each sheet is read as the text that its cells show."""

from __future__ import annotations

import datetime
import re
from collections.abc import Iterable, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any
from zipfile import ZipFile

from ctrlgen.core.errors import InputError
from ctrlgen.recordings.formats.checked_files import check_archive, fault, package
from ctrlgen.recordings.formats.layout_question import Ambiguous, AmbiguousFile
from ctrlgen.recordings.formats.measurement_table import MeasurementTable
from ctrlgen.recordings.formats.text_file import tables_of_text
from ctrlgen.recordings.formats.written_layout import Layout

COMMA = re.compile(r"[+-]?\d+,\d+([eE][+-]?\d+)?")
THREE = re.compile(r"^[+-]?\d{1,3},\d{3}$")
NUMBER = re.compile(r"[+-]?(\d+|\d{1,3}(\.\d{3})+)(,\d*)?([eE][+-]?\d+)?")
HEAD = 4096  # bytes of a part in which a document type would stand


def read(path: Path, layout: Layout) -> dict[str, MeasurementTable]:
    """The tables of a workbook by the names of their sheets. Raises InputError where no sheet holds one."""
    openpyxl = package("openpyxl", path)
    _check_parts(path)
    book = openpyxl.load_workbook(path, read_only=True, data_only=True, keep_links=False)
    tables: dict[str, MeasurementTable] = {}
    faults: list[InputError] = []
    typed = layout.model_copy(update={"separator": "tab", "encoding": None})
    written = openpyxl.load_workbook(path, read_only=True, keep_links=False) if _has_formulas(path) else None
    for sheet in book.worksheets:
        rows = list(sheet.iter_rows(values_only=True))
        if written is not None:
            rows = _with_formulas(rows, written[sheet.title].iter_rows(values_only=True))
        if not any(cell is not None for row in rows for cell in row):
            continue
        comma = _has_decimal_comma(path, rows, layout)
        text = "\n".join("\t".join(_text(cell, comma) for cell in row) for row in rows)
        plain = typed.model_copy(update={"decimal": "."}) if comma else typed
        try:
            found = tables_of_text(path, text, plain, ("decimal comma in cells of text",) if comma else ())
        except InputError as error:
            faults.append(error)
            continue
        tables |= {sheet.title if len(found) == 1 else f"{sheet.title}, {k}": table for k, table in enumerate(found, 1)}
    book.close()
    if written is not None:
        written.close()
    if not tables:
        raise faults[0] if faults else fault(path, "holds no rows; write a header and one row per sample")
    return tables


def _has_formulas(path: Path) -> bool:
    """Whether a sheet of a workbook holds formulas: only then it is read a second time, for what they are."""
    with ZipFile(path) as archive:
        names = [name for name in archive.namelist() if name.startswith("xl/worksheets/") and name.endswith(".xml")]
        return any(re.search(rb"<f[ >/]", archive.read(name)) for name in names)


def _with_formulas(rows: Sequence[tuple[Any, ...]], written: Iterable[tuple[Any, ...]]) -> list[tuple[Any, ...]]:
    """The rows of a sheet with the text of each formula that no program has calculated, of which the file holds no value."""
    return [
        tuple(
            text if value is None and isinstance(text, str) and text.startswith("=") else value
            for value, text in zip_longest(row, texts)
        )
        for row, texts in zip_longest(rows, written, fillvalue=())
    ]


def _check_parts(path: Path) -> None:
    """Raises InputError where a part of a workbook declares a document type: entities could fill the memory or fetch other files."""
    names = check_archive(path)
    with ZipFile(path) as archive:
        for name in names:
            if name.endswith((".xml", ".rels")):
                with archive.open(name) as part:
                    if b"<!DOCTYPE" in part.read(HEAD).upper():
                        raise fault(
                            path, f"declares a document type in {name}, which no workbook needs; save it again in Excel"
                        )


def _has_decimal_comma(path: Path, rows: Sequence[tuple[Any, ...]], layout: Layout) -> bool:
    """Whether numbers that stand as text in a sheet have a decimal comma; numbers proper have no mark at all.

    Raises `AmbiguousFile` where every such cell has its comma before exactly three digits.
    """
    cells = [cell.strip() for row in rows for cell in row if isinstance(cell, str) and COMMA.fullmatch(cell.strip())]
    if layout.decimal is not None or not cells:
        return layout.decimal == ","
    if any(not THREE.search(cell) or cell.lstrip("+-").startswith("0") for cell in cells):
        return True
    what = f"holds {cells[0]!r} as text, and no cell tells whether its comma is a decimal one"
    raise AmbiguousFile(path, Ambiguous(what, {'decimal = ","': "", 'decimal = "."': ""}))


def _text(value: Any, comma: bool) -> str:
    """A cell as text: numbers with all their digits, those with a decimal `comma` with a point, dates as ISO 8601."""
    if comma and isinstance(value, str) and (NUMBER.fullmatch(value.strip())):
        return value.strip().replace(".", "").replace(",", ".")
    if value is None:
        return ""
    if isinstance(value, (datetime.datetime, datetime.date, datetime.time)):
        return value.isoformat()
    if isinstance(value, datetime.timedelta):
        return repr(value.total_seconds())
    if isinstance(value, (int, float)):
        return repr(value)
    return " ".join(str(value).replace('"', " ").split())
