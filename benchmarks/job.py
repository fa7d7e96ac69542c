"""The whole job: `ctrlgen run scenarios/circle20` as a process, against importing its two largest libraries."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from benchmarks.measure import Line, Note, interleave
from benchmarks.samples import SCENARIO, Disagreement

PEER = "import casadi, matplotlib.pyplot"
AIM = 6.0  # s of processor time, compilers included


def run(repeat: int) -> list[Line | Note]:
    """Processor time of both processes and of those that they started, after one untimed run of each."""
    with tempfile.TemporaryDirectory(prefix="ctrlgen-bench-") as scratch:
        out = Path(scratch) / "out"

        def ours() -> None:
            _process([sys.executable, "-m", "ctrlgen", "run", str(SCENARIO), "--out", str(out)])

        def peer() -> None:
            _process([sys.executable, "-c", PEER])

        ours()
        peer()
        missing = [f for f in ("report.html", "trajectory.csv", "c") if not (out / f).exists()]
        if missing or not json.loads((out / "summary.json").read_text())["passed"]:
            raise Disagreement(f"ctrlgen run left out {', '.join(missing) or 'nothing, but is out of tolerance'}")
        seconds = interleave({"ours": _spent(ours), "peer": _spent(peer)}, repeat)
    return [Line("ctrlgen run circle20", seconds["ours"], f"python -c '{PEER}'", seconds["peer"], AIM)]


def _spent(work: Callable[[], object]) -> Callable[[], float]:
    """A contender: processor time [s] of the processes that `work` waits for, with that of the system for them."""

    def children() -> float:
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        return usage.ru_utime + usage.ru_stime

    def run() -> float:
        begin = children()
        work()
        return children() - begin

    return run


def _process(command: list[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        said = f"{done.stdout[-1000:]}{done.stderr[-2000:]}"
        raise Disagreement(f"{' '.join(command)} ended with {done.returncode}:\n{said}")
