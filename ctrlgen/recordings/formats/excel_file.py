"""Workbooks of Excel: each sheet is read as the text that its cells show."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import Any
from zipfile import ZipFile

from ctrlgen.core.errors import InputError
from ctrlgen.recordings.formats.checked_files import check_archive, fault, package
from ctrlgen.recordings.formats.measurement_table import MeasurementTable
from ctrlgen.recordings.formats.text_file import tables_of_text
from ctrlgen.recordings.formats.written_layout import Layout

HEAD = 4096  # bytes of a part in which a document type would stand


def read(path: Path, layout: Layout) -> dict[str, MeasurementTable]:
    """The tables of a workbook by the names of their sheets. Raises InputError where no sheet holds one."""
    openpyxl = package("openpyxl", path)
    _check_parts(path)
    book = openpyxl.load_workbook(path, read_only=True, data_only=True, keep_links=False)
    tables: dict[str, MeasurementTable] = {}
    faults: list[InputError] = []
    typed = layout.model_copy(update={"separator": "tab", "encoding": None})
    for sheet in book.worksheets:
        text = "\n".join("\t".join(map(_text, row)) for row in sheet.iter_rows(values_only=True))
        if not text.strip():
            continue
        try:
            found = tables_of_text(path, text, typed)
        except InputError as error:
            faults.append(error)
            continue
        tables |= {sheet.title if len(found) == 1 else f"{sheet.title}, {k}": table for k, table in enumerate(found, 1)}
    book.close()
    if not tables:
        raise faults[0] if faults else fault(path, "holds no rows; write a header and one row per sample")
    return tables


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


def _text(value: Any) -> str:
    """A cell as text: numbers with all their digits, dates as ISO 8601."""
    if value is None:
        return ""
    if isinstance(value, (datetime.datetime, datetime.date, datetime.time)):
        return value.isoformat()
    if isinstance(value, datetime.timedelta):
        return repr(value.total_seconds())
    if isinstance(value, (int, float)):
        return repr(value)
    return " ".join(str(value).replace('"', " ").split())
