"""Optima of finished fits on disk. A diagnosis that was interrupted continues from them and gives the same answer."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ctrlgen.core.files import write_text


class Checkpoint:
    """Optima by key in the text file `path`, one JSON pair a line after a header line.

    `made_from` describes the diagnosis: program version, seed, digests of its files. A file with another header is ignored
    and replaced by the first `begin`. `reused` counts the optima that were read.
    """

    def __init__(self, path: Path, made_from: dict[str, Any]) -> None:
        self.path, self.made_from = path, made_from
        self.optima = self._read()
        self.reused = len(self.optima)
        self._has_header = False

    def _read(self) -> dict[str, list[float]]:
        """The optima in the file; none where its header differs. A line without its end was cut off and is skipped."""
        try:
            header, *lines = self.path.read_text(encoding="utf-8").splitlines(keepends=True)
            if json.loads(header) != self.made_from:
                return {}
            return dict(_optimum(line) for line in lines if line.endswith("\n"))
        except (OSError, ValueError, RecursionError):  # of another program, or damaged
            return {}

    def recall(self, key: str) -> np.ndarray | None:
        """The optimum kept under `key`, None where there is none."""
        return np.array(self.optima[key]) if key in self.optima else None

    def keep(self, key: str, optimum: np.ndarray) -> None:
        """Appends an optimum (k,) to the file."""
        self.begin()
        self.optima[key] = optimum.tolist()
        with self.path.open("a", encoding="utf-8") as file:
            file.write(_line((key, self.optima[key])))

    def begin(self) -> None:
        """Writes the file with the optima that were read, so that forks of this process may append to it."""
        if not self._has_header:
            write_text(self.path, _line(self.made_from) + "".join(map(_line, self.optima.items())))
            self._has_header = True

    @contextmanager
    def branch(self) -> Iterator[dict[str, list[float]]]:
        """Gives a mapping that holds, at the end, the optima kept inside; they stay in the file, and here they are forgotten.

        Work that may be done in a fork of this process so recalls the same fits as in one, and what it found is added by `learn`.
        """
        before = self.optima
        new: dict[str, list[float]] = {}
        self.optima = dict(before)
        try:
            yield new
        finally:
            new.update((key, optimum) for key, optimum in self.optima.items() if key not in before)
            self.optima = before

    def learn(self, optima: dict[str, list[float]]) -> None:
        """Recalls from now on the `optima` of a branch, which are in the file."""
        self.optima.update(optima)

    def done(self) -> None:
        """Deletes the file: the diagnosis is complete."""
        self.path.unlink(missing_ok=True)


def _optimum(line: str) -> tuple[str, list[float]]:
    """The key and the optimum of a line. Raises ValueError."""
    pair = json.loads(line)
    if not (isinstance(pair, list) and len(pair) == 2 and isinstance(pair[0], str) and isinstance(pair[1], list)):
        raise ValueError("no line of a checkpoint")
    if not all(isinstance(number, int | float) for number in pair[1]):
        raise ValueError("no numbers")
    return pair[0], pair[1]


def _line(value: Any) -> str:
    return json.dumps(value) + "\n"


def key_of(*parts: Any) -> str:
    """SHA-256, 32 hexadecimal digits, of arrays by their bytes and of other objects by their `repr`."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part.tobytes() if isinstance(part, np.ndarray) else repr(part).encode())
        digest.update(b"\0")
    return digest.hexdigest()[:32]
