"""The optima found so far, on disk: a diagnosis that was stopped goes on from them and ends with the same answer."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np

from ctrlgen.core.files import write_text


class Checkpoint:
    """Optimum by optimum, a line each, in the file `path`; begun anew unless it was `made_from` the same."""

    def __init__(self, path: Path, made_from: dict[str, Any]) -> None:
        self.path, self.made_from = path, made_from
        self.found = self._read(made_from)
        self.reused = len(self.found)
        self._begun = False

    def _read(self, made_from: dict[str, Any]) -> dict[str, list[float]]:
        """What is there of the same diagnosis; a line that was not written to its end does not count."""
        try:
            header, *lines = self.path.read_text(encoding="utf-8").splitlines(keepends=True)
            return (
                dict(json.loads(line) for line in lines if line.endswith("\n"))
                if json.loads(header) == made_from
                else {}
            )
        except (OSError, ValueError):
            return {}

    def recall(self, key: str) -> np.ndarray | None:
        """The optimum kept under `key`."""
        return np.array(self.found[key]) if key in self.found else None

    def keep(self, key: str, optimum: np.ndarray) -> None:
        """For the next time."""
        self.found[key] = optimum.tolist()
        if not self._begun:
            write_text(self.path, _line(self.made_from) + "".join(map(_line, self.found.items())))
            self._begun = True
            return
        with self.path.open("a", encoding="utf-8") as file:
            file.write(_line((key, self.found[key])))

    def done(self) -> None:
        """Nothing more is needed of it."""
        self.path.unlink(missing_ok=True)


def _line(value: Any) -> str:
    return json.dumps(value) + "\n"


def key_of(*parts: Any) -> str:
    """A digest of arrays, and of anything whose text tells what it is."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part.tobytes() if isinstance(part, np.ndarray) else repr(part).encode())
        digest.update(b"\0")
    return digest.hexdigest()[:32]
