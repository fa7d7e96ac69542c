"""A pytest plugin: outcome and duration of every test, into the JSON file named by MUTANTS_TIMES."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

_times: dict[str, dict[str, Any]] = {}


def pytest_runtest_logreport(report: Any) -> None:
    """Setup, call and teardown of one test."""
    row = _times.setdefault(report.nodeid, {"seconds": 0.0, "passed": True})
    row["seconds"] += report.duration
    row["passed"] &= report.passed


def pytest_sessionfinish() -> None:
    """Writes how long each test took."""
    Path(os.environ["MUTANTS_TIMES"]).write_text(json.dumps(_times))
