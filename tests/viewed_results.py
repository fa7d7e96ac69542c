"""Result folders as commands leave them, with little in them."""

from __future__ import annotations

import json
import os
import platform
from pathlib import Path
from typing import Any

ORIGIN = {
    "schema_version": 1,
    "program": {"name": "ctrlgen", "version": "0.1.0", "commit": "abc"},
    "seed": None,
    "notes": [],
}


def a_run(folder: Path, left: float = 0.3, title: str = "a circle", passed: bool = True) -> Path:
    """A result of `ctrlgen run` with a C folder."""
    margin = {
        "limit": "travel",
        "label": "travel of coil",
        "unit": "um",
        "channel": "coil",
        "value": 200.0,
        "bound": 500.0,
    }
    margin |= {"margin": 500 * left, "margin_unit": "um", "share_left": left}
    record = ORIGIN | {
        "inputs": {"device": "0" * 64},
        "scenario": "circle",
        "title": title,
        "passed": passed,
        "samples": 200,
    }
    record |= {
        "tracking_error": {"delta_x [um]": 0.01},
        "margins": [margin],
        "tightest": "travel",
        "expected": [],
        "comparison": [],
    }
    written(folder / "summary.json", record)
    written(folder / "report.html", "<!doctype html><title>report</title><script>1</script>")
    written(folder / "c" / "manifest.json", {"name": "circle", "files": {}})
    written(folder / "c" / "circle.c", "int circle;\n")
    written(folder / "c" / "test" / "test.c", "int test;\n")
    return folder


def a_diagnosis(
    folder: Path, after: float = 0.3, verdict: str = "explained", sentence: str = "Creep explains it."
) -> Path:
    """A result of `ctrlgen diagnose`."""
    value = {"value": after / 10, "ci95": [after / 20, after / 5], "unit": "1"}
    finding = {"effect": "creep", "location": "axis", "parameters": {"gain": value}}
    held = {"rms_before": 1.5, "rms_after": after, "noise_floor": 0.1, "unit": "um"}
    record = ORIGIN | {"inputs": {"runs/log.csv": "1" * 64}, "verdict": verdict, "sentence": sentence}
    written(folder / "diagnosis.json", record | {"findings": [finding], "held_out": {"y": held}})
    return folder


def written(path: Path, content: Any) -> Path:
    """The file, JSON of what is no text."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def a_draft(folder: Path, *lines: Any, process: int | None = None) -> Path:
    """A folder that is being written into `folder`, with these steps; of this process unless another is given."""
    draft = folder.with_name(f".{folder.name}.abcd1234")
    head = {"process": os.getpid() if process is None else process, "computer": platform.node(), "at": 1e9}
    written(draft / ".steps", "".join(json.dumps(line) + "\n" for line in (head, *lines)))
    return draft
