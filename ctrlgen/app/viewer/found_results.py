"""The results that the shown folders hold."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from ctrlgen.app.viewer.result_answers import GENERATED, KINDS, Mood, ResultKind, answer_of
from ctrlgen.app.viewer.viewed_folders import Absent, Place, ViewedFolders, read_record

READ_AGAIN = 4096  # answers kept of files that did not change since


@dataclass(frozen=True)
class Found:
    """A result: where it is, what it is and says; `of` is the scenario or the files that it was made from, `at` its time [s since 1970].

    `fault` says why its file cannot be read, and is empty where it can.
    """

    place: Place
    kind: ResultKind
    name: str
    of: str
    verdict: str
    mood: Mood
    sentence: str
    at: float
    fault: str = ""

    def matches(self, words: Iterable[str]) -> bool:
        """Whether every word is in what the list shows of it."""
        text = " ".join((self.name, self.kind.name, self.of, self.verdict, self.sentence, self.fault)).lower()
        return all(word.lower() in text for word in words)


def found_results(folders: ViewedFolders) -> list[Found]:
    """Every result, the newest first; the C in the folder of a run is part of that."""
    kinds = {
        place: kind
        for place, inside in folders.walk()
        if (kind := kind_of({e.name for e in inside if e.is_file(follow_symlinks=False)})) is not None
    }
    found = [
        _found(folders, place, kind)
        for place, kind in kinds.items()
        if kind.name != GENERATED or place.parts[-1:] != ("c",) or Place(place.root, place.parts[:-1]) not in kinds
    ]
    return sorted(found, key=lambda f: (-f.at, f.place.parts))


def kind_of(names: set[str]) -> ResultKind | None:
    """What a folder with files of these names is."""
    return next((kind for kind in KINDS if kind.file in names), None)


def result_at(folders: ViewedFolders, place: Place) -> tuple[Found, dict[str, Any]]:
    """The result at a place and what its file holds; nothing where it cannot be read. Raises Absent where there is none."""
    inside = {entry.name for entry in os.scandir(folders.folder(place))}
    kind = kind_of(inside)
    if kind is None:
        raise Absent(place.address)
    path = folders.file(place.below(kind.file))
    try:
        record = read_record(path)
    except ValueError:
        record = {}
    return _found(folders, place, kind), record


def _found(folders: ViewedFolders, place: Place, kind: ResultKind) -> Found:
    name = "/".join(place.parts) or folders.name(place.root)
    path = folders.roots[place.root].joinpath(*place.parts, kind.file)
    try:
        about = path.stat()
        of, verdict, mood, sentence, fault = _read(path, kind, about.st_mtime_ns, about.st_size)
    except OSError as error:  # replaced at this moment
        return Found(place, kind, name, "", "", "so", "", 0.0, f"{kind.file} cannot be read: {error.strerror}")
    return Found(place, kind, name, of, verdict, mood, sentence, about.st_mtime, fault)


@lru_cache(READ_AGAIN)
def _read(path: Path, kind: ResultKind, _: int, __: int) -> tuple[str, str, Mood, str, str]:
    """What it is of, verdict, mood, sentence and fault of a file that was changed last at this time and has this size."""
    try:
        record = read_record(path)
    except ValueError as error:
        return "", "", "bad", "", f"{kind.file} {error}"
    verdict, mood, sentence = answer_of(kind, record)
    inputs = record.get("inputs")
    files = [re.sub(r"^.*/", "", str(name)) for name in inputs] if isinstance(inputs, dict) else []
    of = record.get("title") or record.get("scenario") or ", ".join(files[:4])
    return str(of or ""), verdict, mood, sentence, ""
