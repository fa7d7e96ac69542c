"""The folder of compiled libraries, kept below a size: a diagnosis adds some hundred of them."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

MOST = 256_000_000  # bytes: 7 000 libraries of 35 kB, those of some tens of diagnoses
EVERY = 100  # libraries that a process adds from one look at all of them to the next, which takes 50 ms


class KeptLibraries:
    """Notes which libraries are used, and removes those used longest ago."""

    def __init__(self) -> None:
        self._added = 0

    def used(self, path: Path) -> None:
        """`path` was loaded; nothing is noted of one that is another user's."""
        with suppress(OSError):
            os.utime(path)

    def added(self, folder: Path) -> None:
        """A library was written to `folder`: at the first one of a process and after `EVERY` more, those used longest ago go until what is
        left takes `MOST` bytes. One that another process has loaded stays with that."""
        if self._added % EVERY == 0:
            _bounded(folder)
        self._added += 1


def _bounded(folder: Path) -> None:
    found = []
    with suppress(OSError):
        for entry in os.scandir(folder):
            if entry.name.endswith(".so"):
                with suppress(OSError):  # another process has removed it
                    about = entry.stat()
                    found.append((about.st_mtime, about.st_size, entry.path))
    total = 0
    for _, size, path in sorted(found, reverse=True):
        total += size
        if total > MOST:
            with suppress(OSError):
                os.unlink(path)
