"""One mutant in a copy of the tree, against its tests."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mutants.draw import Mutant

LEFT = (".git", ".venv", "out", "build", "dist", "__pycache__", ".pytest_cache", ".ruff_cache", "*.egg-info")
SHARE = 0.25  # of the limit, that the chosen tests take without a mutant: beyond the limit it is the mutant that hangs
CAUGHT, SURVIVED, TIMEOUT, UNSEEN = "caught", "survived", "timeout", "unseen"


@dataclass(frozen=True)
class Outcome:
    """What became of a mutant; `by` the test that failed; how many tests ran, were `left` out for time; seconds."""

    mutant: Mutant
    what: str
    diff: str
    by: str
    tests: int
    left: int
    seconds: float


class Copy:
    """A copy of the tree below a new temporary folder, beside a link to what stands beside the tree."""

    def __init__(self, root: Path) -> None:
        self._folder = Path(tempfile.mkdtemp(prefix="mutants-"))
        self.root = self._folder / "tree"
        shutil.copytree(root, self.root, ignore=shutil.ignore_patterns(*LEFT))
        shared = root.parent / "shared"
        if shared.exists():
            (self._folder / "shared").symlink_to(shared.resolve())

    def remove(self) -> None:
        """Deletes the copy from the disk."""
        shutil.rmtree(self._folder, ignore_errors=True)

    def tried(self, mutant: Mutant, tests: Sequence[str], seconds: dict[str, float], limit: float) -> Outcome:
        """The mutant against `tests`, in this order, until one fails; as many of them as fit into `SHARE` of the `limit` [s]."""
        path = self.root / mutant.file
        source = path.read_text()
        changed, diff = mutant.code(source), mutant.diff(source)
        chosen = fitting(tests, seconds, SHARE * limit)
        if not chosen or changed is None:
            return Outcome(mutant, UNSEEN, diff, "", 0, len(tests), 0.0)
        names = self._folder / "tests.txt"
        names.write_text("\n".join(chosen))
        path.write_text(changed)
        begin = time.monotonic()
        try:
            code, text = self._run(names, limit)
        finally:
            path.write_text(source)
        what = TIMEOUT if code is None else SURVIVED if code == 0 else CAUGHT
        failed = next((line for line in text.splitlines() if line.startswith(("FAILED", "ERROR"))), "")
        by = failed.partition(" ")[2].partition(" - ")[0]
        return Outcome(mutant, what, diff, by, len(chosen), len(tests) - len(chosen), time.monotonic() - begin)

    def _run(self, names: Path, limit: float) -> tuple[int | None, str]:
        """Exit code, None where it took too long, and output of pytest."""
        command = [
            sys.executable,
            "-B",
            "-m",
            "pytest",
            "-x",
            "-q",
            "-p",
            "no:cacheprovider",
            "-p",
            "no:xdist",
            f"@{names}",
        ]
        environment = os.environ | {"PYTHONPATH": str(self.root), "MPLBACKEND": "Agg"}
        process = subprocess.Popen(
            command,
            cwd=self.root,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        try:
            text, _ = process.communicate(timeout=limit)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)  # its own group, with what its tests have started
            process.communicate()
            return None, ""
        return process.returncode, text


def fitting(tests: Sequence[str], seconds: dict[str, float], budget: float) -> list[str]:
    """The first tests that together take no longer than the budget, at least one."""
    chosen, total = [], 0.0
    for test in tests:
        total += seconds[test]
        if chosen and total > budget:
            break
        chosen.append(test)
    return chosen
