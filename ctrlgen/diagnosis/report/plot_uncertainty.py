"""Plots of the certainty of a diagnosis: candidate models, confusability, intervals, profile likelihoods."""

from __future__ import annotations

import textwrap
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ctrlgen.diagnosis.evidence.diagnosis_result import Diagnosis
from ctrlgen.diagnosis.selection.candidate_model import Round
from ctrlgen.diagnosis.selection.cause_entry import cause_name
from ctrlgen.diagnosis.selection.confusable import likeness
from ctrlgen.diagnosis.settings import CONFUSABLE
from ctrlgen.estimation.profile_likelihood import Profile
from ctrlgen.estimation.settings import STATISTICS
from ctrlgen.reporting.numbers import number
from ctrlgen.reporting.plots import COLOURS

FIGURE_WIDTH = 8.6
# hypotheses in the confusability matrix
SUSPECTS = 8
# characters of a label before it is broken
LABEL, WIDE_LABEL = 26, 60
PROFILES = 9
# per cent: intervals are shown up to here
WIDEST = 300.0
FOUND, ALIKE, WORSE = COLOURS[0], COLOURS[2], "#b0b0b0"


def draw_rivals(diagnosis: Diagnosis) -> Figure | None:
    """Round by round, the criterion of each candidate model above that of the best one."""
    rounds = [r for r in diagnosis.search.rounds if r.candidates]
    if not rounds:
        return None
    heights = [0.55 + 0.3 * len(r.candidates) for r in rounds]
    figure, axes = plt.subplots(
        len(rounds), 1, figsize=(FIGURE_WIDTH, 0.6 + sum(heights)), height_ratios=heights, sharex=True, squeeze=False
    )
    kept = set(diagnosis.search.chosen.fit.structure.causes)
    for k, (panel, round_) in enumerate(zip(axes[:, 0], rounds, strict=True)):
        _rival_bars(panel, round_, kept)
        gained = round_.criterion_before - round_.criteria[0]
        panel.set_title(f"round {k + 1}: the best candidate lowers T by {number(gained, 3)}", fontsize=9, loc="left")
    axes[-1, 0].set_xlabel("T above that of the best candidate\n(left of the dotted line: explains equally well)")
    return figure


def _rival_bars(panel: Axes, round_: Round, kept: set[Any]) -> None:
    best = round_.criteria[0]
    far = max(10 * CONFUSABLE.criterion, *(T - best for T in round_.criteria))
    labels = []
    for row, (candidate, criterion) in enumerate(zip(round_.candidates, round_.criteria, strict=True)):
        worse = criterion - best
        # several where a set is tried
        added = [c for c in candidate.causes if c not in round_.before.causes]
        names = " + ".join(map(cause_name, added)) or "fewer causes"
        labels.append(textwrap.fill(names, WIDE_LABEL, break_long_words=False))
        colour = FOUND if added and kept.issuperset(added) else ALIKE if worse < CONFUSABLE.criterion else WORSE
        panel.barh(row, worse, color=colour, height=0.6)
        panel.plot(0, row, "o", color=colour, ms=5, clip_on=False)
        _beside(panel, worse, row, number(worse, 3) if row else "best")
    panel.set_yticks(range(len(labels)), labels, fontsize=8)
    panel.invert_yaxis()
    panel.set_xscale("symlog", linthresh=CONFUSABLE.criterion)
    panel.set_xlim(0, 30 * far)
    panel.set_xticks([0, *(10.0**k for k in range(1, int(np.log10(30 * far)) + 1))])
    panel.axvline(CONFUSABLE.criterion, color="#666666", lw=1, ls=":")


def _beside(panel: Axes, x: float, y: float, text: str) -> None:
    """Text to the right of a mark."""
    panel.annotate(text, (x, y), xytext=(6, 0), textcoords="offset points", va="center", fontsize=8)


def draw_confusability(diagnosis: Diagnosis) -> Figure | None:
    """|cos| between the sensitivities of the hypotheses with the largest scores in the first round."""
    search = diagnosis.search
    screened = search.rounds[0].screened if search.rounds else search.final_screen
    top = screened.suspects[:SUSPECTS]
    if len(top) < 2:
        return None
    values = np.array([[likeness(screened, a, b) for b in top] for a in top])
    labels = [textwrap.fill(cause_name(s.hypothesis), LABEL, break_long_words=False) for s in top]
    figure, panel = plt.subplots(figsize=(FIGURE_WIDTH, 1.9 + 0.42 * len(top)))
    panel.imshow(values, cmap="Blues", vmin=0, vmax=1, aspect="auto")
    for row, column in np.ndindex(values.shape):
        dark = values[row, column] > 0.6
        panel.text(
            column,
            row,
            _cosine(float(values[row, column])),
            ha="center",
            va="center",
            fontsize=8,
            color="w" if dark else "k",
        )
    conspicuous = [f"{label}, |z| = {number(abs(s.z), 2)}" for label, s in zip(labels, top, strict=True)]
    panel.set_yticks(range(len(top)), conspicuous)
    panel.set_xticks(range(len(top)), labels, rotation=35, ha="right")
    panel.tick_params(labelsize=7.5)
    panel.grid(False)
    return figure


def _cosine(value: float) -> str:
    """Two digits, four where it is nearly one."""
    return f"{value:.2f}" if value < 0.985 or value > 0.99995 else f"{value:.4f}"


def draw_intervals(diagnosis: Diagnosis) -> Figure | None:
    """The 95 % interval of every parameter found, in per cent of its value."""
    rows = []
    for finding in diagnosis.findings:
        for name, e in finding.parameters.items():
            if e.value and np.all(np.isfinite([e.value, *e.ci95])):
                ends = sorted(100 * np.array(e.ci95) / e.value)
                rows.append((f"{cause_name(finding.cause)}: {name}", ends))
    if not rows:
        return None
    figure, panel = plt.subplots(figsize=(FIGURE_WIDTH, 0.8 + 0.32 * len(rows)))
    for k, (_, (low, high)) in enumerate(rows):
        panel.plot([low, high], [k, k], color=FOUND, lw=3, solid_capstyle="butt")
        panel.plot(100, k, "o", color=FOUND, ms=6)
        _beside(panel, min(max(high, 100), WIDEST), k, f"{_percent(low - 100)} ... {_percent(high - 100)}")
    panel.set_yticks(range(len(rows)), [label for label, _ in rows], fontsize=8)
    panel.set_ylim(len(rows) - 0.5, -0.5)
    low, high = max(min(0.0, *(e[0] for _, e in rows)), -WIDEST), min(max(100.0, *(e[1] for _, e in rows)), WIDEST)
    panel.set_xlim(low - 0.03 * (high - low), high + 0.3 * (high - low))
    panel.axvline(0.0, color="#666666", lw=1)
    panel.set_xlabel("95 % interval in per cent of the estimate")
    return figure


def _percent(value: float) -> str:
    """'+0.16 %'; '0 %' below a thousandth, where an estimate lies on its bound."""
    return f"{value:+.2g} %" if abs(value) > 1e-3 else "0 %"


def draw_profiles(diagnosis: Diagnosis) -> Figure | None:
    """Profile likelihoods: the rise of the objective when one parameter is held and the others are refitted."""
    profiles = [p for p in diagnosis.profiles if len(p.points) > 2][:PROFILES]
    if not profiles:
        return None
    columns = min(3, len(profiles))
    rows = -(-len(profiles) // columns)
    figure, axes = plt.subplots(rows, columns, figsize=(FIGURE_WIDTH, 0.3 + 2.1 * rows), squeeze=False)
    for panel, p in zip(axes.flat, profiles, strict=False):
        _profile(panel, p)
    for panel in axes.flat[len(profiles) :]:
        panel.set_visible(False)
    for panel in axes[:, 0]:
        panel.set_ylabel("rise of the objective")
    return figure


def _profile(panel: Axes, p: Profile) -> None:
    x, rise = np.array(p.points, float).T
    root = np.sqrt(np.maximum(rise, 0.0)) * np.sign(x - p.value)
    fine = np.linspace(x[0], x[-1], 101)
    panel.plot(fine, np.interp(fine, x, root) ** 2, color=FOUND, lw=1.2)
    panel.plot(x, rise, "o", ms=3.5, color=FOUND)
    panel.axhline(STATISTICS.z_95**2, color="#666666", lw=1, ls=":")
    panel.axvspan(*p.ci95, color=FOUND, alpha=0.12, lw=0)
    unit = "" if p.unit == "1" else f" [{p.unit}]"
    panel.set_xlabel(f"{p.parameter}{unit}")
    panel.set_title(textwrap.fill(f"{p.effect} at {p.location}", LABEL), fontsize=8)
    panel.locator_params("x", nbins=4)
    panel.tick_params(labelsize=7.5)
