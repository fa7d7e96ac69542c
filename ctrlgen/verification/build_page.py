"""Writes build.html and build.json of `ctrlgen verify`: one self-contained page, the verdict first."""

from __future__ import annotations

from pathlib import Path

from ctrlgen.core.files import write_text
from ctrlgen.reporting.html import render
from ctrlgen.reporting.page_figure import FirstScreen, PageFigure, page_figures
from ctrlgen.reporting.result_file import json_text
from ctrlgen.verification.build_plots import draw_build
from ctrlgen.verification.build_record import Build, BuildRecord, record
from ctrlgen.verification.comparison_entry import ComparisonKind

FIGURES = {
    "error_length": (
        "Distance from the command",
        "Distance of the model, driven by the generated C on this computer, from the command along the "
        "trajectory, which starts where IPOPT's solution does. The player's curve is compressed as far as its tolerance allows.",
    ),
    "error_angle": (
        "Angle from the command",
        "The same for rotations. A curve is broken where the error is exactly zero.",
    ),
    "instructions": (
        "Instructions a sample",
        "Executed instructions of the costliest call: along the scenario; over random and hostile targets; of the player. "
        "Cycles are not emulated.",
    ),
}
# processors beside the figure, and remedies in a step; all are in the tables
COSTS, REMEDIES = 3, 3
MARKS = {"passed": "ok", "failed": "bad", "not run": "idle"}


def write_build(out: Path, build: Build) -> None:
    """Writes build.html and build.json into the folder `out`."""
    written, worst = record(build), build.comparison.worst
    write_text(out / "build.json", json_text(written))
    device, figures = build.solution.model.device, page_figures(draw_build(build), FIGURES)
    page = render(
        Path(__file__).with_name("build.html.j2"),
        b=written,
        first=first_screen(written, figures.get("error_length") or figures.get("instructions")),
        figures=figures,
        marks=MARKS,
        rows=worst,
        device_title=device.title,
        source=device.source,
        limits=[row for row in worst if row.what is ComparisonKind.EXCESS],
    )
    write_text(out / "build.html", page)


def first_screen(b: BuildRecord, figure: PageFigure | None) -> FirstScreen:
    """Whether everything that ran passed, what did not run, and what the C costs on its processor."""
    answer = "Everything that ran passed" if b.passed else f"{len(b.failures)} failed"
    answer += f"; {len(b.not_run)} not run." if b.not_run else "."
    numbers = [("C against model", f"{sum(row.passed for row in b.comparison)} of {len(b.comparison)}")]
    states = [c.state for c in b.checks]
    numbers += [(f"checks by other tools, {state}", f"{states.count(state)}") for state in dict.fromkeys(states)]
    for run in b.targets[:COSTS]:
        counts = run.instructions
        numbers.append((f"{run.short_name}, instructions", f"{counts['scenario']} of {counts['worst']} at worst"))
    steps = [] if b.passed else ["Mend what failed: each line above names build, signal and tool."]
    if b.not_run:
        told = "; ".join(dict.fromkeys(row.remedy for row in b.not_run[:REMEDIES]))
        steps.append(f"Run what did not run: {told}{'; the rest is listed below' if b.not_run[REMEDIES:] else ''}.")
    steps.append(
        "Put `c/` into the firmware project: `c/README.md` says how, `c/manifest.json` has the hash of each file."
    )
    steps.append("Build `c/` with the target's own compiler and run its self test there.")
    return FirstScreen((answer,), "ok" if b.passed else "bad", figure, tuple(numbers), tuple(steps))
