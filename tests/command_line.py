"""The command line in a process of its own, forked from one that has imported it already: what tests of it wait for is work."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
import tempfile
from functools import cache
from multiprocessing.forkserver import ensure_running
from pathlib import Path
from unittest.mock import patch

# What the commands import when they do it
WORK = (
    "ctrlgen.app.batch",
    "ctrlgen.app.check_files",
    "ctrlgen.app.scenario_pipeline",
    "ctrlgen.calibration.budgets_compared",
    "ctrlgen.diagnosis.diagnosis_folder",
    "ctrlgen.learning.learn",
    "ctrlgen.path_timing.fastest",
    "ctrlgen.budget.budget_page",
    "ctrlgen.calibration.calibration_page",
    "ctrlgen.path_timing.fastest_page",
    "ctrlgen.learning.learning_page",
)


def ctrlgen(*words: object, **environment: str) -> subprocess.CompletedProcess[str]:
    """`python -m ctrlgen WORDS` with what it prints and its status; `environment` is added to that of the tests."""
    command = list(map(str, words))
    with tempfile.TemporaryDirectory() as folder:
        printed = [Path(folder) / name for name in ("stdout", "stderr")]
        child = _server().Process(target=_main, args=(command, environment, os.getcwd(), printed))
        child.start()
        child.join()
        return subprocess.CompletedProcess(command, child.exitcode, *(file.read_text() for file in printed))


@cache
def _server() -> multiprocessing.context.ForkServerContext:
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["ctrlgen.app.commands.cli", *WORK])
    # Read where the consoles are made, at import: in that process alone, so that no other test depends on this one
    with patch.dict(os.environ, COLUMNS="200"):
        ensure_running()
    return context


def _main(words: list[str], environment: dict[str, str], folder: str, printed: list[Path]) -> None:
    for number, file in enumerate(printed, 1):
        os.dup2(os.open(file, os.O_WRONLY | os.O_CREAT), number)
    os.environ.update(environment)
    os.chdir(folder)
    sys.argv = ["ctrlgen", *words]
    from ctrlgen.__main__ import main

    main()
