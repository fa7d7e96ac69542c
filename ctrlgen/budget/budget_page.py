"""The report of an error budget: budget.json, figures, one self-contained budget.html."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ctrlgen.budget.contributors import BudgetLine
from ctrlgen.budget.error_budget import COVERAGE, TOLERANCE, ErrorBudget
from ctrlgen.budget.limits import Safety
from ctrlgen.core.files import write_text
from ctrlgen.core.units import difference, from_si, shown_difference_unit
from ctrlgen.reporting.html import render
from ctrlgen.reporting.plots import COLOURS, STYLE, plt, svg
from ctrlgen.reporting.result_file import origin

MAGNIFIED = (1, 2, 5)  # times a power of ten
WIDEST = 0.12  # of the path's extent: half the width of the band as it is drawn
SHOWN = 12  # contributors in the figure of shares


def write_budget(out: Path, budget: ErrorBudget) -> None:
    """Writes budget.json, figures/band.svg, figures/contributors.svg and budget.html into the folder `out`."""
    record = budget_record(budget)
    figures = draw_budget(budget)
    write_text(out / "budget.json", json.dumps(record, indent=1) + "\n")
    for name, text in figures.items():
        write_text(out / "figures" / f"{name}.svg", text)
    page = render(
        Path(__file__).with_name("budget.html.j2"), b=record, figures=figures, device_title=budget.solution.model.device.title,
        sentences=[safety_sentence(s, budget.probability) for s in budget.safeties],
    )  # fmt: skip
    write_text(out / "budget.html", page)


def budget_record(budget: ErrorBudget) -> dict[str, Any]:
    """What budget.json holds; nothing that changes from run to run with one seed."""
    solution = budget.solution
    scenario, stated = solution.scenario, budget.uncertainties
    signal = solution.model.signals[scenario.file.follow]
    finer = {} if budget.model_difference is None else budget.model_difference.finer.inputs
    inputs = {**scenario.digest, **{name: read.sha256 for name, read in (*stated.inputs.items(), *finer.items())}}
    return {
        **origin(inputs, budget.seed if budget.draws else None, budget.notes),
        "scenario": scenario.name, "title": scenario.file.title, "device": solution.model.name, "signal": scenario.file.follow,
        "samples": len(solution.command), "coverage_factor": budget.factor,
        "groups": [
            {
                "name": g.name, "unit": g.unit, "channels": [signal.channels[i] for i in g.channels],
                "combined_peak": g.shown(budget.peak(g)), "combined_rms": g.shown(budget.rms(g)),
                "band95": g.shown(budget.factor * budget.peak(g)),
            }
            for g in budget.groups
        ],
        "contributors": [_contributor(budget, line, k) for k, line in enumerate(budget.lines, 1)],
        "model_difference": _model_difference(budget), "draws": budget.draws,
        "agreement": [
            {
                "group": a.group.name, "linear": a.group.shown(a.linear), "drawn": a.group.shown(a.drawn), "difference": a.difference,
                "difference_of_interval": a.difference_of_interval, "mean": a.group.shown(a.mean), "tolerance": TOLERANCE,
                "passed": a.passed,
            }
            for a in budget.agreements
        ],
        "reasons": list(budget.reasons), "probability": budget.probability,
        "limits": [_safety(budget, s) for s in budget.safeties],
        "broken": budget.broken,
        "band": {
            f"{signal.channels[i]} [{g.unit}]": difference(budget.combined[:, i], g.unit).tolist()
            for g in budget.groups for i in g.channels
        },
    }  # fmt: skip


def _contributor(budget: ErrorBudget, line: BudgetLine, rank: int) -> dict[str, Any]:
    effects = [
        {
            "group": g.name, "sensitivity": g.shown(line.sensitivity[g.name]), "peak": g.shown(line.peak[g.name]),
            "rms": g.shown(line.rms[g.name]), "combined_if_halved": g.shown(line.halved[g.name]),
            "second_order": g.shown(line.alone[g.name]) if budget.draws else None,
        }
        for g in budget.groups
    ]  # fmt: skip
    return {
        "rank": rank, "name": line.name, "called": line.called, "sd": line.sd, "source": line.source, "per": line.per, "share": line.share,
        "effects": effects,
    }  # fmt: skip


def _model_difference(budget: ErrorBudget) -> dict[str, Any] | None:
    """How the finer model moves; None without one."""
    if budget.model_difference is None:
        return None
    signal = budget.solution.model.signals[budget.solution.scenario.file.follow]
    deviation = budget.model_difference.deviation
    return {
        "kind": "model difference", "device": budget.model_difference.finer.model.name,
        "effects": [
            {"group": g.name, "peak": g.shown(budget.difference_peak(g)), "rms": g.shown(budget.difference_rms(g))}
            for g in budget.groups
        ],
        "deviation": {
            f"{signal.channels[i]} [{g.unit}]": difference(deviation[:, i], g.unit).tolist()
            for g in budget.groups for i in g.channels
        },
    }  # fmt: skip


def _safety(budget: ErrorBudget, s: Safety) -> dict[str, Any]:
    unit, solution = s.limit.unit, budget.solution
    return {
        "limit": s.limit.name, "label": s.limit.label, "channel": s.channel, "side": s.side, "sample": s.sample,
        "time_s": float(solution.trace.time[s.sample]) if solution.scenario.sample_time else None,
        "unit": unit, "bound": float(from_si(s.bound, unit)), "margin_unit": shown_difference_unit(unit),
        "margin": float(difference(s.margin, unit)), "sd": float(difference(s.sd, unit)),
        "margin_at_probability": float(difference(s.kept, unit)),
        "margin_drawn": None if s.drawn is None else float(difference(s.drawn, unit)),
        "probability": s.probability, "kept": s.kept >= 0,
    }  # fmt: skip


def percent(probability: float) -> str:
    """99.9 % for 0.999."""
    return f"{100 * probability:.10g} %"


def safety_sentence(s: Safety, probability: float) -> str:
    """Such as 'actuator temperature keeps 550 degC with 99.9 %: margin 3.1 K'."""
    unit = s.limit.unit
    bound = f"{from_si(s.bound, unit):.5g} {unit}"
    left = f"{abs(difference(s.kept, unit)):.3g} {shown_difference_unit(unit)}"
    if s.kept >= 0:
        return f"{s.limit.label} keeps {bound} with {percent(probability)}: margin {left}"
    likely = f"it does with {100 * s.probability:.3g} %"
    return f"{s.limit.label} does not keep {bound} with {percent(probability)}: short by {left}; {likely}"


def draw_budget(budget: ErrorBudget) -> dict[str, str]:
    """The band round the path, and the contributors: name -> SVG text."""
    with plt.rc_context(STYLE):
        return {"band": svg(draw_band(budget)), "contributors": svg(_draw_contributors(budget))}


def draw_band(budget: ErrorBudget) -> Figure:
    """Left the path in the two channels of one unit that move most, with its 95 % band across it, magnified; right the half width of
    the band of each channel of that unit along the path, by the first order and, as points, by the draws."""
    solution = budget.solution
    signal, command = solution.model.signals[solution.scenario.file.follow], solution.command
    group = max(budget.groups, key=lambda g: np.ptp(command[:, g.channels], axis=0).max() / signal.scale[g.channels[0]])
    shown = sorted(sorted(group.channels, key=lambda i: -np.ptp(command[:, i]))[:2])
    figure, (left, right) = plt.subplots(1, 2, figsize=(8.2, 3.9), width_ratios=(1, 1.15))
    _draw_path_with_band(left, budget, shown)
    static = solution.scenario.sample_time is None
    at = np.arange(len(command)) if static else solution.trace.time
    for i, colour in zip(group.channels, (COLOURS[0], COLOURS[2], COLOURS[4]), strict=False):
        half = difference(budget.factor * budget.combined[:, i], group.unit)
        right.plot(at, half, color=colour, lw=1.3, label=signal.channels[i])
        if budget.drawn is not None:
            ends = np.quantile(budget.drawn.pose[:, :, i], [0.5 - COVERAGE / 2, 0.5 + COVERAGE / 2], axis=0)
            right.plot(at[budget.drawn.kept], difference((ends[1] - ends[0]) / 2, group.unit), ".", ms=3, color=colour)
    right.set_ylim(bottom=0)
    right.set_xlabel("sample" if static else "time [s]")
    right.set_ylabel(f"half width of the 95 % band [{group.unit}]")
    right.set_title("lines: first order" + ("" if budget.drawn is None else "; points: draws"), fontsize=8)
    right.legend(fontsize=8, ncols=3, loc="best")
    return figure


def _draw_path_with_band(axes: Axes, budget: ErrorBudget, shown: list[int]) -> None:
    """One channel is shown over the samples, two against each other with the band along the normal of the path."""
    signal = budget.solution.model.signals[budget.solution.scenario.file.follow]
    unit, path = signal.units[shown[0]], budget.solution.command[:, shown]
    if len(shown) == 1 or not np.ptp(path, axis=0).min():
        i = shown[int(np.ptp(path, axis=0).argmax())]
        centre, half = budget.solution.command[:, i], budget.factor * budget.combined[:, i]
        times = _magnification(half.max(), np.ptp(centre))
        at = np.arange(len(centre))
        axes.fill_between(at, *(from_si(centre + s * times * half, unit) for s in (-1, 1)), color=COLOURS[1], alpha=0.5)
        axes.plot(at, from_si(centre, unit), color="#666666", lw=1)
        axes.set_xlabel("sample")
        axes.set_ylabel(f"{signal.channels[i]} [{unit}]")
    else:
        tangent = _tangent(path, budget.solution.scenario.closed)
        normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
        half = budget.factor * _across(budget, shown, normal)
        times = _magnification(half.max(), np.ptp(path, axis=0).max())
        ends = [path + s * times * half[:, None] * normal for s in (-1, 1)]
        closed = budget.solution.scenario.closed
        ring = [from_si(np.vstack([e, e[:1]]) if closed else e, unit) for e in (*ends, path)]
        axes.fill(*np.vstack([ring[0], ring[1][::-1]]).T, color=COLOURS[1], alpha=0.5, lw=0)
        axes.plot(*ring[2].T, color="#666666", lw=1)
        axes.set_aspect("equal", adjustable="datalim")
        axes.set_xlabel(f"{signal.channels[shown[0]]} [{unit}]")
        axes.set_ylabel(f"{signal.channels[shown[1]]} [{unit}]")
    width = "to scale" if times == 1 else f"{times:g} times as wide as it is"
    axes.set_title(f"95 % band across the path, {width}", fontsize=8)


def _tangent(path: np.ndarray, closed: bool) -> np.ndarray:
    """(n, 2) unit vectors along the path; where it rests, the one before."""
    ahead, behind = (np.roll(path, s, axis=0) for s in (-1, 1))
    if not closed:
        ahead[-1], behind[0] = path[-1], path[0]
    step = ahead - behind
    length = np.linalg.norm(step, axis=1)
    moving = np.flatnonzero(length > 1e-9 * length.max())
    last = moving[np.clip(np.searchsorted(moving, np.arange(len(path)), side="right") - 1, 0, None)]
    return step[last] / length[last, None]


def _across(budget: ErrorBudget, shown: list[int], normal: np.ndarray) -> np.ndarray:
    """(n,) combined standard uncertainty along the `normal` (n, 2) of the path in the channels `shown`."""
    Y = np.sum(budget.linear.sensitivity["pose"][:, shown, :] * normal[:, :, None], axis=1)
    variance = np.sum((Y @ budget.uncertainties.covariance) * Y, axis=1)
    for sd in budget.linear.scatter["pose"].values():  # of one channel as of the other: independent
        variance = variance + np.sum((sd[:, shown] * normal) ** 2, axis=1)
    return np.sqrt(np.maximum(variance, 0.0))


def _magnification(half: float, extent: float) -> float:
    """The largest of 1, 2, 5, 10, ... with which the band stays narrow beside the path."""
    if not half or not extent:
        return 1.0
    wanted = WIDEST * extent / half
    if wanted < 1:
        return 1.0
    decade = 10 ** np.floor(np.log10(wanted))
    return float(max(m * decade for m in MAGNIFIED if m * decade <= wanted))


def _draw_contributors(budget: ErrorBudget) -> Figure:
    """The largest contributors: the standard uncertainty that each causes, and all combined."""
    lines = [line for line in budget.lines if any(line.peak.values())][:SHOWN]
    figure, axes = plt.subplots(
        1, len(budget.groups), figsize=(8.2, 0.6 + 0.24 * (len(lines) + 1)), sharey=True, squeeze=False
    )
    names = [line.called for line in lines] + ["combined"]
    for axis, group in zip(axes[0], budget.groups, strict=True):
        values = [group.shown(line.peak[group.name]) for line in lines] + [group.shown(budget.peak(group))]
        axis.barh(range(len(names)), values, color=[COLOURS[0]] * len(lines) + [COLOURS[2]])
        axis.set_yticks(range(len(names)), names, fontsize=7)
        axis.set_xlabel(f"standard uncertainty, {group.name} [{group.unit}]")
    axes[0, 0].invert_yaxis()  # shared: the first contributor on top
    return figure
