"""The whole diagnosis: files in, a folder with report.html, diagnosis.json and device.next.toml out, whole or not at all."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from ctrlgen import diagnosis as engine
from ctrlgen.devices import Device, load_device
from ctrlgen.diagnosis.diagnosis import Diagnosis
from ctrlgen.diagnosis.page import Provenance, page
from ctrlgen.diagnosis.record import as_dict
from ctrlgen.diagnosis.writeback import write_next
from ctrlgen.files import read_toml, whole_folder, write_text
from ctrlgen.model import build_model
from ctrlgen.recording import Recording, load_recordings
from ctrlgen.recording_file import FILE

Progress = Callable[[str], None]
Paths = Path | str | Sequence[Path | str]


def diagnose(
    device: Device | Path | str, recording: Recording | Paths, seed: int = 0, progress: Progress | None = None
) -> Diagnosis:
    """What `device` leaves out that `recording` shows; each may be an object or its file, a recording also several files.

    Deterministic for a given `seed`; `progress` is called with a sentence before each step. Raises InputError.
    """
    device = device if isinstance(device, Device) else load_device(device)
    if not isinstance(recording, Recording):
        if progress:
            progress("reading")
        paths = [recording] if isinstance(recording, (str, Path)) else list(recording)
        recording = load_recordings(paths, build_model(device))
    return engine.diagnose(device, recording, seed, progress)


def diagnose_into(
    device: Path | str,
    recordings: Sequence[Path | str],
    out: Path | str,
    seed: int = 0,
    progress: Progress | None = None,
) -> Diagnosis:
    """The same, reported into the folder `out`, which is replaced whole or left alone. Raises InputError."""
    step = progress or (lambda _: None)
    with whole_folder(Path(out)) as draft:
        found = diagnose(device, recordings, seed, step)
        step("report")
        digests = {name: _digest(path) for name, path in _files(Path(device), recordings)}
        write_next(found, Path(device), draft / "device.next.toml")
        write_text(draft / "diagnosis.json", json.dumps(as_dict(found), indent=1, allow_nan=False) + "\n")
        write_text(draft / "report.html", page(found, Provenance(digests, seed)))
    return found


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _files(device: Path, recordings: Sequence[Path | str]) -> Iterator[tuple[str, Path]]:
    """Name and path of every file that was read; a recording's are named with its folder."""
    yield device.name, device
    for given in map(Path, recordings):
        path = given / FILE if given.is_dir() else given
        for name in dict.fromkeys([path.name, *_named(read_toml(path))]):
            yield f"{path.resolve().parent.name}/{name}", path.parent / name


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
