"""What long work is doing, in a file of the folder that it writes: for `ctrlgen view`, and for whoever finds a folder half written.

The file `.steps` has a line of JSON each: first the process ({"process": 4711, "computer": "name", "at": seconds since 1970}), then
every step ({"at": ..., "step": "fit of creep"}). `ctrlgen.core.files.whole_folder` removes it when the work is done.
"""

from __future__ import annotations

import json
import os
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

STEPS = ".steps"
LARGEST = 1_000_000  # bytes that are read: some 15,000 steps

Progress = Callable[[str], None]


def noted(folder: Path, progress: Progress | None = None) -> Progress:
    """`progress` that also writes each step into `folder`. A step that cannot be written is not: the work matters more."""
    _append(folder, {"process": os.getpid(), "computer": platform.node(), "at": time.time()})

    def step(what: str) -> None:
        _append(folder, {"at": time.time(), "step": what})
        if progress is not None:
            progress(what)

    return step


def _append(folder: Path, line: dict[str, Any]) -> None:
    try:
        with (folder / STEPS).open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")
    except OSError:
        pass


@dataclass(frozen=True)
class Steps:
    """What a folder that is being written tells: (time [s since 1970], step) in their order, when it `began`, and whether its process
    `runs`, which is None where that cannot be known: it is of another computer.
    """

    steps: tuple[tuple[float, str], ...]
    began: float
    runs: bool | None


def read_steps(folder: Path) -> Steps | None:
    """The steps noted in `folder`; None where none are. Lines that are cut off or not ours are skipped."""
    try:
        with (folder / STEPS).open(encoding="utf-8", errors="replace") as file:
            lines = file.read(LARGEST).splitlines()
        began, process, computer, steps = 0.0, None, "", []
        for line in lines:
            entry = _entry(line)
            if "step" in entry:
                steps.append((float(entry["at"]), str(entry["step"])))
            elif "process" in entry:
                began, process, computer = float(entry["at"]), entry["process"], str(entry["computer"])
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return Steps(tuple(steps), began, _runs(process, computer))


def _entry(line: str) -> dict[str, Any]:
    try:
        entry = json.loads(line)
    except (ValueError, RecursionError):
        return {}
    return entry if isinstance(entry, dict) else {}


def _runs(process: Any, computer: str) -> bool | None:
    """Whether the process is alive. Only asked where asking does nothing to it: signal 0 ends a process on Windows."""
    if computer != platform.node() or os.name != "posix" or not isinstance(process, int) or not 0 < process < 1 << 31:
        return None
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:  # there, and somebody else's
        return True
    return True
