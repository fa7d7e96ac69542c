"""The report of a solution and its comparison: summary.json, trajectory.csv, figures, one self-contained report.html."""

from __future__ import annotations

import csv
import io
import json
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np

from ctrlgen.budget.budget_section import BudgetSection
from ctrlgen.core.files import write_text
from ctrlgen.core.units import difference, from_si, show, shown_difference_unit
from ctrlgen.devices import Signal
from ctrlgen.firmware.folder import CFolder
from ctrlgen.reporting.html import render
from ctrlgen.reporting.result_file import origin
from ctrlgen.trajectory.metrics import ExpectationResult, in_unit
from ctrlgen.trajectory.solution import Margin, Solution
from ctrlgen.verification.comparison import Comparison

CSV_SIGNALS = ("pose", "displacement", "force", "state", "power")


def write_trajectory(solution: Solution, path: Path) -> None:
    """Writes trajectory.csv: time, pose, displacement, force, temperature, power, each column with its unit.

    Row k holds the state at sample k and the power that acts from there to sample k + 1. The drive's columns come last
    where the drive is not the power.
    """
    signals = solution.model.signals
    roles = [role for role in CSV_SIGNALS if role in signals]
    if signals["drive"].columns not in [signals[role].columns for role in roles]:
        roles.append("drive")
    static = solution.scenario.sample_time is None
    header = ["sample" if static else "time [s]"]
    columns = [(np.arange(len(solution.command)) if static else solution.trace.time)[:, None]]
    for role in roles:
        signal = solution.model.signals[role]
        header += signal.columns
        values = solution.trace.signals[role]
        columns.append(np.column_stack([from_si(values[:, i], unit) for i, unit in enumerate(signal.units)]))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    for row in np.hstack(columns):
        writer.writerow([f"{value:.12g}" for value in row])
    write_text(path, text.getvalue())


def summary(
    solution: Solution, comparison: Comparison | None, expected: tuple[ExpectationResult, ...], c: CFolder | None
) -> dict[str, Any]:
    """What summary.json holds: plain numbers in the stated units; nothing that changes from run to run."""
    scenario = solution.scenario
    error = np.abs(solution.trace.signals[scenario.file.follow] - solution.command).max(axis=0)
    signal = solution.model.signals[scenario.file.follow]
    return {
        **origin(scenario.digest),
        "scenario": scenario.name,
        "title": scenario.file.title,
        "device": solution.model.name,
        "passed": passed(comparison, expected),
        "samples": len(solution.command),
        "sample_rate_Hz": 1 / scenario.sample_time if scenario.sample_time else None,
        "closed": scenario.closed,
        "ipopt_iterations": solution.iterations,
        "limits_added": list(solution.rows_added),
        "tracking_error": _by_channel(signal, error),
        "error_between_samples": None if (between := solution.between_samples) is None else _by_channel(signal, between),
        "robust": _robust(solution),
        "margins": [_margin(m, solution) for m in solution.margins],
        "tightest": solution.tightest.limit.name,
        "expected": [
            {
                "value": e.value, "unit": e.unit, "measured": in_unit(e.measured, e.unit), "low": in_unit(e.low, e.unit),
                "high": in_unit(e.high, e.unit), "passed": e.passed, "source": e.source,
            }
            for e in expected
        ],
        "c": None if c is None else {
            "operations_per_sample": c.operations, "operations_worst": c.worst_operations,
            "player": {real.value: [vars(candidate) for candidate in held.candidates] for real, held in c.compression.items()},
        },
        "compilers": comparison.compilers if comparison else {},
        "compilers_not_run": list(comparison.missing) if comparison else [],
        "comparison": [{**vars(row), "passed": row.passed} for row in comparison.rows] if comparison else [],
    }  # fmt: skip


def _by_channel(signal: Signal, values: np.ndarray) -> dict[str, float]:
    """'channel [unit]' -> value in that unit."""
    channels = zip(signal.channels, signal.units, values, strict=True)
    return {f"{channel} [{unit}]": float(from_si(value, unit)) for channel, unit, value in channels}


def passed(comparison: Comparison | None, expected: tuple[ExpectationResult, ...]) -> bool:
    """Whether every expectation and every comparison that was made is within tolerance."""
    return (comparison is None or comparison.passed) and all(e.passed for e in expected)


def _robust(solution: Solution) -> dict[str, Any] | None:
    """With which probability the limits hold, and to where the path was moved for that; None for the device as described."""
    if solution.model.probability is None:
        return None
    signal = solution.model.signals[solution.scenario.file.follow]
    units, home = dict(zip(signal.channels, signal.units, strict=True)), solution.scenario.home
    moved = {f"{channel} [{units[channel]}]": float(difference(by, units[channel])) for channel, by in home.items()}
    return {"probability": solution.model.probability, "moved": moved, "sentence": robust_sentence(solution)}


def robust_sentence(solution: Solution) -> str | None:
    """Such as 'all limits hold with 99.9 % for what is not known exactly; moved by delta_z = -8.41 um'; None where nothing is reserved."""
    if solution.model.probability is None:
        return None
    signal = solution.model.signals[solution.scenario.file.follow]
    units = dict(zip(signal.channels, signal.units, strict=True))
    moved = ", ".join(f"{c} = {'+' if v > 0 else ''}{show(v, units[c])}" for c, v in solution.scenario.home.items())
    sentence = (
        f"all limits hold with {100 * solution.model.probability:.10g} % along the path for what is not known exactly"
    )
    return sentence + (f"; for the least error it is moved by {moved}" if moved else "")


def _margin(m: Margin, solution: Solution) -> dict[str, Any]:
    unit = m.limit.unit
    distance, reserve = (float(difference(v, unit)) for v in (m.distance, m.reserve))
    return {
        "limit": m.limit.name, "label": m.limit.label, "unit": unit, "channel": m.channel, "sample": m.sample,
        "time_s": float(solution.trace.time[m.sample]) if solution.scenario.sample_time else None, 
        "value": float(from_si(m.value, unit)), "bound": float(from_si(m.limit.described(m.bound), unit)),
        "reserve": reserve, "margin": distance, "margin_unit": shown_difference_unit(unit), "share_left": m.share,
    }  # fmt: skip


def worst_rows(comparison: Comparison) -> list[dict[str, Any]]:
    """The worst build of each arithmetic, comparison and signal: a table short enough to read."""
    groups: dict[tuple[str, str, str, str], list[Any]] = defaultdict(list)
    for row in comparison.rows:
        groups[(row.build.split()[1], row.what, row.signal, row.unit)].append(row)
    table = []
    for (real, what, signal, unit), rows in groups.items():
        worst = max(rows, key=lambda r: (not r.passed, r.worst))
        table.append({
            "real": real, "what": what, "signal": signal, "unit": unit, "worst": worst.worst, "rms": worst.rms, "limit": worst.limit,
            "passed": worst.passed, "first": worst.first, "build": worst.build, "samples": worst.samples,
        })  # fmt: skip
    return table


def write_report(
    out: Path,
    solution: Solution,
    comparison: Comparison | None,
    expected: tuple[ExpectationResult, ...],
    c: CFolder | None,
    figures: dict[str, str],
    budget: BudgetSection | None = None,
) -> None:
    """Writes what a reader looks at: summary.json, trajectory.csv, figures/*.svg, report.html.

    `figures`: name -> SVG text, as `ctrlgen.reporting.plots.draw_all` gives; `budget` as `budget_section` gives.
    """
    result = summary(solution, comparison, expected, c)
    write_text(out / "summary.json", json.dumps(result, indent=1) + "\n")
    write_trajectory(solution, out / "trajectory.csv")
    for name, text in figures.items():
        write_text(out / "figures" / f"{name}.svg", text)
    page = render(
        Path(__file__).with_name("report.html.j2"),
        s=result,
        figures=figures,
        rows=worst_rows(comparison) if comparison else [],
        source=solution.model.device.source,
        device_title=solution.model.device.title,
        budget=None if budget is None else budget.shown(),
        sourced=[(path, q.text, q.source or "") for path, q in solution.model.device.quantities()],
    )
    write_text(out / "report.html", page)
