"""The folders that are shown, and nothing outside them: every address of a page is turned into a path here."""

from __future__ import annotations

import json
import os
import stat
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ctrlgen.core.errors import Fault, InputError

DEEPEST = 8  # folders below a shown one: results of a battery stand four deep
MOST_FOLDERS = 20_000  # that are looked into, so that a whole disk is not walked through
LARGEST_RECORD = 64_000_000  # bytes of a result file: a learning.json of 100,000 samples and six drives has 12 million


class Absent(Exception):
    """An address that leads to nothing that is shown."""


@dataclass(frozen=True)
class Place:
    """A file or folder that is shown: `root` counts the shown folders, `parts` are the names below that one."""

    root: int
    parts: tuple[str, ...]

    @property
    def address(self) -> str:
        """As it stands in an address of a page: '0/circle/report.html'."""
        return "/".join((str(self.root), *self.parts))

    def below(self, *names: str) -> Place:
        """A file or folder in this one."""
        return Place(self.root, (*self.parts, *names))


class ViewedFolders:
    """The folders given to `ctrlgen view`. Raises InputError for one that is none."""

    def __init__(self, folders: Sequence[Path]) -> None:
        faults = [Fault(str(f), "is no folder; name one that holds results") for f in folders if not f.is_dir()]
        if faults:
            raise InputError("ctrlgen view", faults)
        self.roots = tuple(Path(os.path.realpath(folder)) for folder in folders)

    def name(self, root: int) -> str:
        """What a shown folder is called."""
        return self.roots[root].name or str(self.roots[root])

    def place(self, address: str) -> Place:
        """The place of an address such as '0/circle/report.html'. Raises Absent for names that are hidden, empty or lead upwards."""
        first, *parts = address.split("/")
        if not (first.isascii() and first.isdigit() and len(first) < 6 and int(first) < len(self.roots)):
            raise Absent(address)
        if any(not part or part.startswith(".") or set(part) & set("\\:\0") for part in parts):
            raise Absent(address)
        return Place(int(first), tuple(parts))

    def path(self, place: Place) -> Path:
        """Where a place is on the disk. Raises Absent where it is not there, or a link leads out of the shown folder."""
        root = self.roots[place.root]
        try:
            found = root.joinpath(*place.parts).resolve(strict=True)
        except (OSError, ValueError, RuntimeError):
            raise Absent(place.address) from None
        if not found.is_relative_to(root) or any(p.startswith(".") for p in found.relative_to(root).parts):
            raise Absent(place.address)
        return found

    def file(self, place: Place) -> Path:
        """A regular file. Raises Absent."""
        path = self.path(place)
        if not stat.S_ISREG(path.stat().st_mode):
            raise Absent(place.address)
        return path

    def folder(self, place: Place) -> Path:
        """A folder. Raises Absent."""
        path = self.path(place)
        if not path.is_dir():
            raise Absent(place.address)
        return path

    def walk(self) -> Iterator[tuple[Place, tuple[os.DirEntry[str], ...]]]:
        """Every folder that is shown, with what is in it; links are not followed, hidden folders are not entered."""
        left = MOST_FOLDERS
        waiting = [Place(root, ()) for root in range(len(self.roots))][::-1]
        while waiting and left:
            place, left = waiting.pop(), left - 1
            try:
                with os.scandir(self.roots[place.root].joinpath(*place.parts)) as entries:
                    inside = tuple(sorted(entries, key=lambda entry: entry.name))
            except OSError:  # removed meanwhile, or not ours to read
                continue
            yield place, inside
            if len(place.parts) < DEEPEST:
                waiting += [
                    place.below(e.name)
                    for e in reversed(inside)
                    if not e.name.startswith(".") and e.is_dir(follow_symlinks=False)
                ]


def read_record(path: Path) -> dict[str, Any]:
    """The table of a result file. Raises ValueError that says what is wrong with it."""
    try:
        size = path.stat().st_size
        if size > LARGEST_RECORD:
            raise ValueError(f"has {size / 1e6:.0f} MB; at most {LARGEST_RECORD / 1e6:.0f} are read here")
        record = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"cannot be read: {error.strerror}") from None
    except RecursionError:
        raise ValueError("is nested too deeply to be a result") from None
    except ValueError as error:
        raise ValueError(f"cannot be read: {error}") from None
    if not isinstance(record, dict):
        raise ValueError("holds no table, so it is no result")
    return record
