"""The files that recordings consist of: each recording.toml and every measurement file that it names."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from ctrlgen.core.files import read_toml
from ctrlgen.recordings.schema import FILE


def recording_files(recordings: Sequence[Path | str]) -> Iterator[tuple[str, Path]]:
    """Name and path of every file of the recordings, each a recording.toml or its folder; named from the folder that all of theirs
    stand in."""
    tables = [given / FILE if given.is_dir() else given for given in map(Path, recordings)]
    above = os.path.commonpath([table.resolve().parent.parent for table in tables])
    for table in tables:
        folder = Path(os.path.relpath(table.resolve().parent, above)).as_posix()
        for name in dict.fromkeys([table.name, *_named(read_toml(table))]):
            yield f"{folder}/{name}", table.parent / name


def sha256(path: Path) -> str:
    """The SHA-256 of a file, which is not read into memory."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _named(node: Any) -> Iterator[str]:
    """Every `file` that a recording.toml names, in any of its tables."""
    if isinstance(node, dict):
        if isinstance(node.get("file"), str):
            yield node["file"]
        for member in node.values():
            yield from _named(member)
    elif isinstance(node, list):
        for member in node:
            yield from _named(member)
