"""Interleaved timing, and the table it becomes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import TypeVar

K = TypeVar("K")
UNITS = ((1.0, "s"), (1e-3, "ms"), (1e-6, "us"), (1e-9, "ns"))
HEADER = ("measured", "ours", "peer", "", "ratio", "rounds from .. to", "aim")


@dataclass(frozen=True)
class Line:
    """One measurement: seconds of every round, ours and the peer's; `aim`: seconds ours should stay below."""

    what: str
    ours: list[float]
    peer_name: str
    peer: list[float]
    aim: float | None = None

    @property
    def held(self) -> bool | None:
        """Whether the aim holds; None without one."""
        return None if self.aim is None else median(self.ours) < self.aim

    def cells(self) -> tuple[str, ...]:
        """One text per column of HEADER."""
        rounds = [a / b for a, b in zip(self.ours, self.peer, strict=True)]
        aim = "" if self.aim is None else f"< {duration(self.aim)} {'ok' if self.held else 'MISSED'}"
        ratio = f"{median(self.ours) / median(self.peer):.3g}"
        spread = f"{min(rounds):.3g} .. {max(rounds):.3g}"
        return self.what, duration(median(self.ours)), self.peer_name, duration(median(self.peer)), ratio, spread, aim


@dataclass(frozen=True)
class Count:
    """Instructions of the longest call, ours and the peer's; `aim`: what ours should not exceed."""

    what: str
    ours: int
    peer_name: str
    peer: int
    aim: int | None = None

    @property
    def held(self) -> bool | None:
        """Whether the aim holds; None without one."""
        return None if self.aim is None else self.ours <= self.aim

    def cells(self) -> tuple[str, ...]:
        """One text per column of HEADER."""
        aim = "" if self.aim is None else f"<= {self.aim} {'ok' if self.held else 'MISSED'}"
        return self.what, str(self.ours), self.peer_name, str(self.peer), f"{self.ours / self.peer:.3g}", "exact", aim


@dataclass(frozen=True)
class Note:
    """A remark between the measurements, such as a peer that is not available."""

    text: str


def interleave(contenders: dict[K, Callable[[], float]], repeat: int) -> dict[K, list[float]]:
    """Runs every contender in turn, `repeat` rounds; a contender returns its own seconds."""
    seconds: dict[K, list[float]] = {name: [] for name in contenders}
    for _ in range(repeat):
        for name, run in contenders.items():
            seconds[name].append(run())
    return seconds


def timed(work: Callable[[], object], count: int = 1) -> Callable[[], float]:
    """A contender: wall time of `work` divided by `count`."""

    def run() -> float:
        start = perf_counter()
        work()
        return (perf_counter() - start) / count

    return run


def peak_memory() -> float:
    """Largest resident memory [MB] of this process alone: the system's ru_maxrss begins with what the process that started it held."""
    status = Path("/proc/self/status").read_text()
    return next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmHWM:")) / 1024


def duration(seconds: float) -> str:
    """Three digits in a unit that suits."""
    scale, unit = next((u for u in UNITS if seconds >= u[0]), UNITS[-1])
    return f"{seconds / scale:.3g} {unit}"


def print_table(results: list[Line | Count | Note]) -> None:
    """Aligned columns on standard output; notes below."""
    rows = [HEADER, *(r.cells() for r in results if not isinstance(r, Note))]
    widths = [max(len(row[i]) for row in rows) for i in range(len(HEADER))]
    right = {1, 3, 4}
    for row in rows:
        cells = (c.rjust(w) if i in right else c.ljust(w) for i, (c, w) in enumerate(zip(row, widths, strict=True)))
        print("  ".join(cells).rstrip())
    for note in results:
        if isinstance(note, Note):
            print(f"note: {note.text}")
