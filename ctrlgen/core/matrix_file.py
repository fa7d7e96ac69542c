"""A square matrix of numbers from a file: NumPy's .npy, text such as .csv, or Matrix Market's .mtx. Nothing in it is executed."""

from __future__ import annotations

import os
import stat
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.files import explained

LARGEST_FILE = 4_000_000
"""Bytes: a matrix of 192 rows has a megabyte with 25 characters a number."""
ENDINGS = (".npy", ".csv", ".txt", ".mtx")


@dataclass(frozen=True)
class StatedMatrix:
    """A square matrix, and the file that it is from, "" where the description has its rows; two with the same numbers are equal."""

    file: str
    rows: int
    content: bytes

    @classmethod
    def of(cls, file: str, numbers: np.ndarray) -> StatedMatrix:
        """That of `numbers` (n, n)."""
        return cls(file, len(numbers), np.ascontiguousarray(numbers, float).tobytes())

    @property
    def numbers(self) -> np.ndarray:
        """(n, n)."""
        return np.frombuffer(self.content).reshape(self.rows, self.rows)


def read_matrix(path: Path, name: str, most: int) -> StatedMatrix:
    """The matrix of a file that a description calls `name`, of at most `most` rows. Raises InputError; what is too large is refused
    before it is read."""
    try:
        about = os.stat(path)
        if not stat.S_ISREG(about.st_mode):
            raise _fault(path, "is no regular file; name the file of the matrix")
        if about.st_size > LARGEST_FILE:
            told = f"has {about.st_size / 1e6:.3g} MB; a matrix of {most} rows has at most {LARGEST_FILE / 1e6:g}"
            raise _fault(path, f"{told}: is it condensed to its ports?")
        reader = {".npy": _npy, ".mtx": _matrix_market, ".csv": _text, ".txt": _text}.get(path.suffix.lower())
        if reader is None:
            raise _fault(path, f"is none of {', '.join(ENDINGS)}; save the matrix as one of these")
        numbers = reader(path, most)
    except OSError as error:
        raise _fault(path, f"cannot be read: {explained(error)}") from None
    if (fault := square_fault(numbers, most)) is not None:
        raise _fault(path, fault)
    return StatedMatrix.of(name, numbers)


def square_fault(numbers: np.ndarray, most: int) -> str | None:
    """What keeps an array from being a matrix of finite numbers with at most `most` rows."""
    if numbers.ndim != 2 or numbers.shape[0] != numbers.shape[1]:
        return f"holds {' x '.join(map(str, numbers.shape))} numbers; a matrix has as many rows as columns"
    if not 0 < len(numbers) <= most:
        return f"has {len(numbers)} rows; 1 to {most} are read"
    if numbers.dtype.kind not in "fiu":
        return f"holds {numbers.dtype}, no real numbers"
    return None if np.all(np.isfinite(numbers)) else "holds numbers that are not finite"


def _npy(path: Path, most: int) -> np.ndarray:
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)  # its shape is known before it is read
    except (ValueError, EOFError) as error:
        raise _fault(path, f"holds no array of numbers ({error}); save it with numpy.save") from None
    if not isinstance(array, np.ndarray):
        raise _fault(path, "holds several arrays; save the matrix alone, with numpy.save")
    return array


def _text(path: Path, most: int) -> np.ndarray:
    """Rows of numbers with commas, semicolons or spaces between them; what follows # or % is a comment."""
    rows: list[list[float]] = []
    for number, line in enumerate(_lines(path), 1):
        cells = line.split("#")[0].split("%")[0].replace(",", " ").replace(";", " ").split()
        if not cells:
            continue
        if len(rows) == most or len(cells) > most:
            raise _fault(path, f"has more than {most} rows or columns; condense the part to its ports")
        try:
            rows.append([float(cell) for cell in cells])
        except ValueError:
            raise _fault(path, f"line {number}: {cells[0][:20]!r} ... are no numbers; begin a comment by #") from None
        if len(rows[-1]) != len(rows[0]):
            what = f"has {len(rows[-1])} numbers and the first row {len(rows[0])}"
            raise _fault(path, f"line {number}: {what}; write a row of the matrix in each line")
    return np.array(rows)


def _matrix_market(path: Path, most: int) -> np.ndarray:
    """Source of the format: R. F. Boisvert, R. Pozo, K. A. Remington, The Matrix Market Exchange Formats, NISTIR 5935 (1996)."""
    import scipy.io  # takes a moment to import

    _lines(path)
    try:
        rows, columns, entries, _, field, _ = scipy.io.mminfo(path)
        if not (rows <= most and columns <= most and entries <= most * most and field in ("real", "integer", "double")):
            raise _fault(path, f"has {rows} x {columns} {field} numbers; up to {most} x {most} real ones are read")
        found: Any = scipy.io.mmread(path)
    except (ValueError, TypeError, OverflowError, StopIteration) as error:
        raise _fault(path, f"is no Matrix Market file ({str(error)[:100]})") from None
    return np.asarray(found if isinstance(found, np.ndarray) else found.toarray(), float)


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise _fault(path, f"is not UTF-8 text (byte {error.start}); save the matrix as text, or as .npy") from None


def _fault(path: Path, what: str) -> InputError:
    return InputError(path, [Fault("file", what)])
