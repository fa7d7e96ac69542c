"""Folders into which commands write: the option, what they are called where nobody names one, and what each is the result of."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import typer

from ctrlgen.core.errors import Fault, InputError

USUAL = ("scenario.toml", "recording.toml", "device.toml", "jobs.toml")
WHOLE = "Result folder; replaced as a whole when the work is done, never half written, and only where it holds a result alone."
SOURCE = "# result of "
"""What a line of the marker of a folder begins with that tells its source, by the way from the folder to it."""


def out_option(default: str | None = None, about: str = WHOLE) -> Any:
    """--out, -o of a folder that is written; `default`: what `out_of` makes of a command where none is named, None where then nothing
    is written."""
    return typer.Option("--out", "-o", help=about, show_default=default or False)


def out_of(named: Path | None, of: Path, command: str = "") -> Path:
    """The folder `named`, or out/NAME beside the current directory: NAME of the scenario, device or recording `of`, and `_command` where
    that is not `run`, so that no command replaces what another one left.

    Raises InputError where nobody named a folder and that one holds the result of another file of the same name.
    """
    if named is not None:
        return named
    folder = Path("out", name_of(of) + (f"_{command}" if command else ""))
    if (source := source_of(folder)) not in (None, _source(of)):
        what = f"holds the result of {source}; name another folder with -o, or that one to replace it"
        raise InputError(folder, [Fault("--out", what)])
    return folder


def name_of(file: Path) -> str:
    """What a scenario, a device or a recording is called: by its folder where its file has the usual name."""
    source = _source(file)
    of_folder = source.is_dir() or file.name in USUAL
    return (source.name if of_folder else source.stem) or "result"


def _source(file: Path) -> Path:
    """The folder of a file with the usual name, the file itself for any other."""
    whole = file.resolve()
    return whole.parent if whole.name in USUAL else whole


def note_source(folder: Path, of: Path) -> None:
    """Notes in a finished result what it is the result of, for `out_of`; in a folder that may not be written nothing is noted."""
    from ctrlgen.core.files import MARKER, write_text

    way = os.path.relpath(_source(of), folder.resolve())
    try:
        marker = folder / MARKER
        lines = marker.read_text(encoding="utf-8").splitlines() if marker.exists() else []
        kept = [line for line in lines if not line.startswith(SOURCE)]
        write_text(marker, "\n".join([*kept, SOURCE + way]) + "\n")
    except (OSError, InputError):
        return


def source_of(folder: Path) -> Path | None:
    """What the result in a folder is the result of; None where none is there, or it was not noted."""
    from ctrlgen.core.files import MARKER

    try:
        lines = (folder / MARKER).read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError):
        return None
    ways = [line.removeprefix(SOURCE) for line in lines if line.startswith(SOURCE)]
    return (folder / ways[-1]).resolve() if ways else None
