"""Writes build.html and build.json of `ctrlgen verify`: one self-contained page, the verdict first."""

from __future__ import annotations

from pathlib import Path

from ctrlgen.core.files import write_text
from ctrlgen.reporting.html import render
from ctrlgen.reporting.result_file import json_text
from ctrlgen.verification.build_plots import draw_build
from ctrlgen.verification.build_record import Build, record
from ctrlgen.verification.comparison_entry import ComparisonKind

CAPTIONS = {
    "error_length": "Distance of the model, driven by the generated C on this computer, from the command along the "
    "trajectory, which starts where IPOPT's solution does. The player's curve is compressed as far as its tolerance allows.",
    "error_angle": "The same for rotations. A curve is broken where the error is exactly zero.",
    "instructions": "Executed instructions of the costliest call: along the scenario; over random and hostile targets; of the player. "
    "Cycles are not emulated.",
}
MARKS = {"passed": "ok", "failed": "bad", "not run": "idle"}


def write_build(out: Path, build: Build) -> None:
    """Writes build.html and build.json into the folder `out`."""
    written, worst = record(build), build.comparison.worst
    write_text(out / "build.json", json_text(written))
    device = build.solution.model.device
    page = render(
        Path(__file__).with_name("build.html.j2"),
        b=written,
        figures=draw_build(build),
        captions=CAPTIONS,
        marks=MARKS,
        rows=worst,
        device_title=device.title,
        source=device.source,
        limits=[row for row in worst if row.what is ComparisonKind.EXCESS],
    )
    write_text(out / "build.html", page)
