"""Plots of where the residual is, and of the unknown input that would explain it."""

from __future__ import annotations

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ctrlgen.core.to_json import plain
from ctrlgen.diagnosis.report.narrative import number
from ctrlgen.diagnosis.selection.diagnosis_result import Diagnosis
from ctrlgen.reporting.plots import COLOURS

FIGURE_WIDTH = 8.6
PARTS = 14  # bars in one group
PANELS = 6  # dependence maps of the unknown input
SHARE = 0.01  # share of the variance: maps that explain less are left out


def draw_where(diagnosis: Diagnosis) -> Figure | None:
    """Excess of the residual of the device as described over the noise, by part of the recording; None without one."""
    located = plain(diagnosis.residual_location).get("before", {}).items()
    groups = {name: rows for name, value in located if (rows := excesses(value))}
    if not groups:
        return None
    heights = [0.35 + 0.2 * min(len(rows), PARTS) for rows in groups.values()]
    figure, axes = plt.subplots(
        len(groups), 1, figsize=(FIGURE_WIDTH, 0.6 + sum(heights)), height_ratios=heights, sharex=True, squeeze=False
    )
    for panel, (name, parts) in zip(axes[:, 0], groups.items(), strict=True):
        rows = _largest(parts)
        y = np.arange(len(rows))
        values = np.array([value for _, value, _ in rows])
        panel.barh(y, values, color=[COLOURS[2] if v > 0 else "#d9d9d9" for v in values], height=0.65)
        for k, (_, _, ci) in enumerate(rows):
            if ci:
                panel.plot(ci, [k, k], color="#333333", lw=1)
        panel.set_yticks(y, [label for label, *_ in rows], fontsize=7.5)
        panel.set_ylim(len(rows) - 0.4, -0.6)
        panel.set_xscale("symlog", linthresh=1.0)
        panel.axvline(0.0, color="#666666", lw=0.8)
        more = f", the {len(rows)} largest of {len(parts)}" if len(rows) < len(parts) else ""
        panel.set_title(name.replace("_", " ") + more, fontsize=9, loc="left")
    axes[-1, 0].set_xlabel("excess over the noise: 0 is noise alone, 1 as much power again as the noise")
    return figure


def _largest(rows: list[tuple[str, float, list[float] | None]]) -> list[tuple[str, float, list[float] | None]]:
    """The `PARTS` largest, in their order."""
    least = sorted((value for _, value, _ in rows), reverse=True)[:PARTS][-1]
    return [row for row in rows if row[1] >= least]


def excesses(value: Any, prefix: str = "") -> list[tuple[str, float, list[float] | None]]:
    """(label, excess, its interval) of every part in one group of the residual location."""
    rows = []
    if isinstance(value, dict) and isinstance(value.get("excess"), (int, float)):
        low, high = value.get("low"), value.get("high")
        label = value.get("label") or (f"{number(low, 3)} ... {number(high, 3)} Hz" if low and high else "")
        ci = value.get("ci95")
        known = ci if ci and all(isinstance(v, (int, float)) for v in ci) else None
        return [(f"{prefix} {label}".strip(), float(value["excess"]), known)]
    if isinstance(value, dict):
        for key, member in value.items():
            rows += excesses(member, f"{prefix} {key}".strip())
    elif isinstance(value, list):
        for member in value:
            rows += excesses(member, prefix)
    return rows


def draw_unknown(diagnosis: Diagnosis) -> Figure | None:
    """The unknown input against position, velocity, time and temperature; None where none was estimated."""
    force = plain(diagnosis.extra.get("unmodelled_force")) or {}
    maps = [(axis, m) for axis, several in (force.get("maps") or {}).items() for m in several]
    maps = sorted(
        (row for row in maps if row[1]["variance_share"] >= SHARE), key=lambda row: -row[1]["variance_share"]
    )[:PANELS]
    if not maps:
        return None
    rows = -(-len(maps) // 2)
    figure, axes = plt.subplots(rows, 2, figsize=(FIGURE_WIDTH, 0.4 + 2.1 * rows), squeeze=False)
    for panel, (axis, m) in zip(axes.flat, maps, strict=False):
        _map(panel, f"{force['quantity']} at {axis}", m)
    for panel in axes.flat[len(maps) :]:
        panel.set_visible(False)
    return figure


def _map(panel: Axes, title: str, m: dict[str, Any]) -> None:
    at, mean, low, high = (np.array(m[key], float) for key in ("centres", "mean", "low", "high"))
    panel.fill_between(at, low, high, color=COLOURS[0], alpha=0.25, lw=0)
    panel.plot(at, mean, "o-", ms=3, lw=1, color=COLOURS[0])
    panel.set_xlabel(f"{m['coordinate']} [{m['unit']}]")
    panel.set_ylabel(f"[{m['value_unit']}]")
    panel.locator_params("x", nbins=5)
    panel.set_title(f"{title}, {100 * m['variance_share']:.0f} % of its variance", fontsize=8.5)
