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
"""What a line of the marker of a folder begins with that tells its source, by the way from the folder to it; one line for the scenario,
device or recording, and one for another device than the scenario names."""


def out_option(default: str | None = None, about: str = WHOLE) -> Any:
    """--out, -o of a folder that is written; `default`: what `out_of` makes of a command where none is named, None where then nothing
    is written."""
    return typer.Option("--out", "-o", help=about, show_default=default or False)


def out_of(named: Path | None, of: Path, command: str = "", device: Path | None = None) -> Path:
    """The folder `named`, or out/NAME beside the current directory: NAME of the scenario, device or recording `of`, `_command` where
    that is not `run`, and `_on_DEVICE` where `device` is not that of the scenario, so that no result replaces another one.

    Raises InputError where nobody named a folder and that one holds the result of another file of the same name.
    """
    if named is not None:
        return named
    folder = Path(
        "out", "_".join([name_of(of), *([command] if command else []), *(["on", name_of(device)] if device else [])])
    )
    if (sources := sources_of(folder)) not in ([], [_source(file) for file in (of, device) if file]):
        what = f"holds the result of {' on '.join(map(str, sources))}; name another folder with -o, or that one to replace it"
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


def note_source(folder: Path, of: Path, device: Path | None = None) -> None:
    """Notes in a finished result what it is the result of, for `out_of`; in a folder that may not be written nothing is noted."""
    from ctrlgen.core.files import MARKER, write_text

    ways = [SOURCE + os.path.relpath(_source(file), folder.resolve()) for file in (of, device) if file]
    try:
        marker = folder / MARKER
        lines = marker.read_text(encoding="utf-8").splitlines() if marker.exists() else []
        kept = [line for line in lines if not line.startswith(SOURCE)]
        write_text(marker, "\n".join([*kept, *ways]) + "\n")
    except (OSError, InputError):
        return


def sources_of(folder: Path) -> list[Path]:
    """What the result in a folder is the result of, and of which other device; none where no result is there, or it was not noted."""
    from ctrlgen.core.files import MARKER

    try:
        lines = (folder / MARKER).read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError):
        return []
    return [(folder / line.removeprefix(SOURCE)).resolve() for line in lines if line.startswith(SOURCE)]
