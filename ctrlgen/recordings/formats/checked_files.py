"""Measurement files before any library reads them: their size, and packages that may not be installed."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from types import ModuleType
from zipfile import BadZipFile, ZipFile

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.files import explained

LARGEST = 4 << 30  # bytes of a file, or of the numbers that it says it holds: more is refused before any work
LARGEST_COLUMNS = 100_000  # names of one file
INSTALLED_AS = {"nptdms": "npTDMS"}


def fault(path: Path, what: str) -> InputError:
    """The error that says `what` is wrong with a file."""
    return InputError(path, [Fault(path.name or "file", what)])


def check_size(path: Path, size: float, what: str = "holds") -> None:
    """Raises InputError where a file, or what it says it holds, is larger than any reader here takes at once."""
    if size > LARGEST:
        told = f"{what} {size / 2**30:.3g} GB, and at most {LARGEST >> 30} GB are read at once"
        raise fault(path, f"{told}; write only the columns and rows that are used to a file")


def read_bytes(path: Path) -> bytes:
    """The content of a file. Raises InputError where it is too large or cannot be read."""
    try:
        check_size(path, path.stat().st_size)
        return path.read_bytes()
    except OSError as error:
        raise fault(path, f"cannot be read: {explained(error)}") from None


def package(name: str, path: Path) -> ModuleType:
    """An optional package. Raises InputError with the command that installs it."""
    try:
        return import_module(name)
    except ImportError:
        installed = INSTALLED_AS.get(name, name)
        what = f"needs the package {installed}; install it with: pip install {installed} (or pip install 'ctrlgen[recordings]')"
        raise fault(path, what) from None


def check_archive(path: Path) -> list[str]:
    """The names in a zip archive. Raises InputError where it is damaged, or unpacks to more than `LARGEST` bytes."""
    try:
        with ZipFile(path) as archive:
            check_size(path, sum(member.file_size for member in archive.infolist()), "unpacks to")
            return archive.namelist()
    except (BadZipFile, OSError) as error:
        raise fault(path, f"is damaged ({error}); export it again") from None
