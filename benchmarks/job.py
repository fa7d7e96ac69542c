"""The whole job: `ctrlgen run scenarios/circle20` as a process, against importing its two largest libraries."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.measure import Line, Note, interleave, timed
from benchmarks.samples import SCENARIO, Disagreement

PEER = "import casadi, matplotlib.pyplot"
AIM = 5.0  # s


def run(repeat: int) -> list[Line | Note]:
    """Wall time of both processes, after one untimed run of each."""
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
        seconds = interleave({"ours": timed(ours), "peer": timed(peer)}, repeat)
    return [Line("ctrlgen run circle20", seconds["ours"], f"python -c '{PEER}'", seconds["peer"], AIM)]


def _process(command: list[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        said = f"{done.stdout[-1000:]}{done.stderr[-2000:]}"
        raise Disagreement(f"{' '.join(command)} ended with {done.returncode}:\n{said}")
