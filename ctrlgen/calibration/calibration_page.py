"""The report of a calibration: constants.json, a figure, one self-contained calibration.html."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ctrlgen.budget.error_budget import ErrorBudget
from ctrlgen.calibration.calibrate import CalibratedConstant, Calibration
from ctrlgen.calibration.constants_files import device_hash, write_constants
from ctrlgen.core.files import write_text
from ctrlgen.core.units import difference, from_si
from ctrlgen.reporting.html import render
from ctrlgen.reporting.plots import COLOURS, STYLE, plt, svg
from ctrlgen.reporting.result_file import origin

Budgets = tuple[ErrorBudget, ErrorBudget] | None


def write_calibration(out: Path, calibration: Calibration, budgets: Budgets = None) -> None:
    """Writes constants.h, constants.bin, constants.json, figures/constants.svg and calibration.html into the folder `out`."""
    record = calibration_record(calibration, budgets)
    with plt.rc_context(STYLE):
        figure = svg(draw_constants(calibration))
    write_constants(out, calibration)
    write_text(out / "constants.json", json.dumps(record, indent=1, allow_nan=False) + "\n")
    write_text(out / "figures" / "constants.svg", figure)
    write_text(
        out / "calibration.html",
        render(
            Path(__file__).with_name("calibration.html.j2"), c=record, figure=figure, title=calibration.device.title
        ),
    )


def calibration_record(calibration: Calibration, budgets: Budgets = None) -> dict[str, Any]:
    """What constants.json holds."""
    inputs = {name: read.sha256 for name, read in calibration.inputs.items()}
    if budgets is not None:
        inputs |= budgets[0].solution.scenario.digest
    sds = np.sqrt(np.diag(calibration.covariance))
    return {
        **origin(inputs, None, calibration.notes),
        "device": calibration.device.name, "device_hash": f"{device_hash(calibration):08x}", "recording": calibration.recording.title,
        "constants": [_constant(row) for row in calibration.constants],
        "correlation": (calibration.covariance / np.outer(sds, sds)).tolist(),
        "channels": [
            {"channel": e.channel, "unit": e.unit, **{k: float(difference(getattr(e, k), e.unit)) for k in ("before", "after", "noise")}}
            for e in calibration.errors
        ],
        "scenario": None if budgets is None else budgets[0].solution.scenario.name,
        "budget": [] if budgets is None else [
            {"group": g.name, "unit": g.unit, "before": g.shown(budgets[0].peak(g)), "after": g.shown(budgets[1].peak(g))}
            for g in budgets[0].groups
        ],
    }  # fmt: skip


def _constant(row: CalibratedConstant) -> dict[str, Any]:
    c = row.constant

    def shown(si: float) -> float:
        return float(from_si(si, c.unit))

    return {
        "name": c.name, "path": c.path, "unit": c.unit, "value": shown(row.value), "value_si": row.value,
        "interval95": [shown(v) for v in row.interval], "sd_si": row.sd, "default": shown(c.default),
        "bounds": [shown(c.low), shown(c.high)], "determined": row.determined, "remark": row.remark,
    }  # fmt: skip


def draw_constants(calibration: Calibration) -> Figure:
    """Each constant between its bounds, scaled to 0 ... 1: the file's value, and that of the specimen with its 95 % interval."""
    rows = calibration.constants
    figure, ax = plt.subplots(figsize=(7.2, 0.9 + 0.42 * len(rows)))
    for k, row in enumerate(rows):
        c = row.constant
        span = c.high - c.low
        low, value, high, default = (
            (v - c.low) / span for v in (row.interval[0], row.value, row.interval[1], c.default)
        )
        ax.plot([0, 1], [k, k], color="#cccccc", linewidth=1, zorder=0)
        ax.plot(default, k, "|", color="black", markersize=14, label="device file" if k == 0 else None)
        if row.determined:
            ax.errorbar(
                value, k, xerr=[[value - low], [high - value]], fmt="o", color=COLOURS[0], markersize=4, capsize=4
            )
        text = c.shown(row.value) if row.determined else "not determined"
        ax.text(1.03, k, text, va="center", fontsize=8)
    ax.plot([], [], "o", color=COLOURS[0], markersize=4, label="specimen, 95 %")
    ax.set_yticks(range(len(rows)), [row.constant.name for row in rows])
    ax.set_xlim(-0.02, 1.3)
    ax.set_ylim(len(rows) - 0.5, -0.7)
    ax.set_xticks([0, 1], ["low", "high"])
    ax.set_xlabel("within the bounds")
    ax.spines[["top", "right"]].set_visible(False)
    ax.legend(
        loc="upper center", bbox_to_anchor=(0.4, 1.3 if len(rows) < 5 else 1.12), ncols=2, frameon=False, fontsize=8
    )
    return figure
