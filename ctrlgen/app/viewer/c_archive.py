"""The generated C of a result as one zip file."""

from __future__ import annotations

import io
import os
import zipfile
from pathlib import Path

from ctrlgen.app.viewer.viewed_folders import Absent, Place, ViewedFolders

MOST_FILES = 2000  # of the generated C: it has some forty
LARGEST = 200_000_000  # bytes together: the player's tables of a million samples are 100 million
A_DAY = (1980, 1, 1, 0, 0, 0)  # in the archive, the earliest it can state: the same C gives the same archive


def c_folder(folders: ViewedFolders, place: Place) -> Place | None:
    """Where the C of a result is: its folder c/, or the result itself as `ctrlgen generate` leaves it; None without any."""
    for inside in (place.below("c"), place):
        try:
            folder = folders.folder(inside)
        except Absent:
            continue
        if (folder / "manifest.json").is_file() and any(folder.glob("*.c")):
            return inside
    return None


def c_archive(folders: ViewedFolders, place: Place) -> bytes:
    """The zip file of that folder: regular files alone, no links, nothing hidden. Raises Absent where there is no C."""
    inside = c_folder(folders, place)
    if inside is None:
        raise Absent(place.address)
    folder, total, packed = folders.folder(inside), 0, io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in _files(folder):
            total += path.stat().st_size
            if total > LARGEST:
                raise Absent(place.address)
            name = Path(inside.parts[-1] if inside.parts else folder.name, path.relative_to(folder)).as_posix()
            archive.writestr(zipfile.ZipInfo(name, A_DAY), path.read_bytes(), zipfile.ZIP_DEFLATED)
    return packed.getvalue()


def _files(folder: Path) -> list[Path]:
    found: list[Path] = []
    for above, folders, names in os.walk(folder):  # does not follow links to folders
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        paths = [Path(above, name) for name in sorted(names) if not name.startswith(".")]
        found += [path for path in paths if path.is_file() and not path.is_symlink()]
        if len(found) > MOST_FILES:
            raise Absent(str(folder.name))
    return found
