"""The report of an error budget: budget.json, figures, one self-contained budget.html."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ctrlgen.budget.budget_record import BudgetRecord, budget_record, safety_sentence
from ctrlgen.budget.budget_shares import printed_shares
from ctrlgen.budget.error_budget import COVERAGE, ErrorBudget
from ctrlgen.core.counts import number_of
from ctrlgen.core.files import write_text
from ctrlgen.core.to_digits import to_digits
from ctrlgen.core.units import difference, from_si
from ctrlgen.reporting.chart import Chart, Curve, Panel
from ctrlgen.reporting.html import render
from ctrlgen.reporting.line_patterns import dashes, mark
from ctrlgen.reporting.page_figure import FirstScreen, PageFigure, page_figures
from ctrlgen.reporting.plots import COLOURS, STYLE, legend_over, plt, svg
from ctrlgen.reporting.result_file import json_text
from ctrlgen.trajectory.solution_charts import abscissa

MAGNIFIED = (1, 2, 5)  # times a power of ten
WIDEST = 0.12  # of the path's extent: half the width of the band as it is drawn
CHART = 170  # pixels of a panel
SHOWN = 12  # contributors in the figure of shares


def write_budget(out: Path, budget: ErrorBudget) -> None:
    """Writes budget.json, figures/band.svg, figures/contributors.svg and budget.html into the folder `out`."""
    record = budget_record(budget)
    figures = draw_budget(budget)
    write_text(out / "budget.json", json_text(record))
    for name, text in figures.items():
        write_text(out / "figures" / f"{name}.svg", text)
    words = {
        "band": ("Along the path", f"Combined standard uncertainty times {to_digits(record.coverage_factor, 3)}."),
        "contributors": ("Contributors", "The standard uncertainty that each of the largest causes, and all combined."),
    }
    drawn = page_figures(figures, words, {"band": chart_band(budget)}, ("band",))
    page = render(
        Path(__file__).with_name("budget.html.j2"),
        b=record,
        shares=printed_shares(record),
        first=first_screen(record, drawn["band"]),
        figures=drawn,
        device_title=budget.solution.model.device.title,
        sentences=[safety_sentence(s, budget.probability) for s in budget.safeties],
    )
    write_text(out / "budget.html", page)


def first_screen(b: BudgetRecord, figure: PageFigure) -> FirstScreen:
    """How far the device may be off, whether every limit is kept, what to measure or tighten next."""
    bands = ", ".join(f"± {to_digits(g.band95)} {g.unit} ({g.name})" for g in b.groups)
    lost = [row for row in b.limits if not row.kept]
    likely = f"{100 * b.probability:.10g} %"
    kept = (
        f"{len(lost)} of {number_of(len(b.limits), 'limit')} {'is' if len(lost) == 1 else 'are'} not kept at {likely}"
        if lost
        else f"every limit is kept at {likely}"
    )
    numbers = [(f"95 % band, {g.name}", f"± {to_digits(g.band95)} {g.unit}") for g in b.groups]
    numbers += [(f"rms, {g.name}", f"{to_digits(g.combined_rms)} {g.unit}") for g in b.groups]
    steps = []
    if lost:
        told = ", ".join(dict.fromkeys(row.label for row in lost))
        steps.append(
            f"State `[robust]` in the scenario: the path is then solved so that {told} keeps its bound at a probability."
        )
    for c in b.contributors[:1]:
        numbers.append((f"share of {c.called}", f"{to_digits(100 * c.share, 3)} %"))
        halved = ", ".join(
            f"{to_digits(e.combined_if_halved * b.coverage_factor)} instead of {to_digits(g.band95)} {g.unit}"
            for e, g in zip(c.effects, b.groups, strict=True)
        )
        steps.append(f"Measure or tighten `{c.called}` first (sd {c.sd}): with half of it the band is {halved}.")
    if differ := [a for a in b.agreement if not a.passed]:
        told = ", ".join(a.group for a in differ)
        steps.append(f"First order and draws differ for {told}: take the numbers of the draws.")
    elif not b.draws:
        steps.append("Draw from the nonlinear model too: `--draws 10000`.")
    state = "bad" if lost else "ok" if all(a.passed for a in b.agreement) else "so"
    answer = f"What is not known exactly moves the {b.signal} within {bands}, 95 % where it is widest; {kept}."
    return FirstScreen((answer,), state, figure, tuple(numbers), tuple(steps))


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
    for k, (i, colour) in enumerate(zip(group.channels, (COLOURS[0], COLOURS[2], COLOURS[4]), strict=False)):
        half = difference(budget.factor * budget.combined[:, i], group.unit)
        right.plot(at, half, color=colour, ls=dashes(k), lw=1.3, label=signal.channels[i])
        if budget.drawn is not None:
            ends = np.quantile(budget.drawn.pose[:, :, i], [0.5 - COVERAGE / 2, 0.5 + COVERAGE / 2], axis=0)
            right.plot(
                at[budget.drawn.kept], difference((ends[1] - ends[0]) / 2, group.unit), mark(k), ms=3, color=colour
            )
    right.set_ylim(bottom=0)
    right.set_xlabel("sample" if static else "time [s]")
    right.set_ylabel(f"half width of the 95 % band [{group.unit}]")
    right.set_title("lines: first order" + ("" if budget.drawn is None else "; points: draws"), fontsize=8)
    legend_over(figure, right)
    return figure


def chart_band(budget: ErrorBudget) -> Chart:
    """The half width of the 95 % band of each channel along the path, a panel a kind; the draws as points."""
    solution = budget.solution
    signal, (label, x) = solution.model.signals[solution.scenario.file.follow], abscissa(solution)
    panels = []
    for group in budget.groups:
        curves = []
        for k, i in enumerate(group.channels):
            half = difference(budget.factor * budget.combined[:, i], group.unit)
            curves.append(Curve(signal.channels[i], half, k, k))
            if budget.drawn is not None:
                ends = np.quantile(budget.drawn.pose[:, :, i], [0.5 - COVERAGE / 2, 0.5 + COVERAGE / 2], axis=0)
                drawn = np.full(len(x), np.nan)
                drawn[budget.drawn.kept] = difference((ends[1] - ends[0]) / 2, group.unit)
                curves.append(Curve(f"{signal.channels[i]}, draws", drawn, k, k, points=True))
        panels.append(Panel(f"95 % band, {group.name} [± {group.unit}]", x, tuple(curves), height=CHART))
    return Chart(label, tuple(panels))


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
