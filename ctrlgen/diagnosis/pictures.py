"""Figures of a diagnosis, as SVG: residuals on held-out data, their spectrum, where they live, rivals, confusability, intervals."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.signal import freqz, welch

from ctrlgen.diagnosis.diagnosis import Diagnosis
from ctrlgen.diagnosis.record import plain
from ctrlgen.diagnosis.search import RIVAL, Round
from ctrlgen.diagnosis.words import hypothesis_name, number, short
from ctrlgen.figures import COLOURS, STYLE, svg
from ctrlgen.recording import Record
from ctrlgen.units import from_si

BEFORE, AFTER, NOISE = COLOURS[2], COLOURS[0], "#d9d9d9"
WIDTH = 8.6
POINTS = 700  # columns of a long curve; each keeps its smallest and its largest sample
SUSPECTS = 8  # in the confusability matrix
PARTS = 24  # bars of one group in the where-map
SEGMENT = 2048  # samples of the spectrum's windows
LABEL = 26  # characters of a label before it is broken


def draw_all(diagnosis: Diagnosis) -> dict[str, str]:
    """Every figure that this diagnosis has something to show in: name -> SVG text."""
    left = Residuals(diagnosis)
    drawings: dict[str, Callable[[], Figure | None]] = {
        "residuals": lambda: draw_residuals(left),
        "spectrum": lambda: draw_spectrum(left),
        "where": lambda: draw_where(diagnosis),
        "rivals": lambda: draw_rivals(diagnosis),
        "confusability": lambda: draw_confusability(diagnosis),
        "intervals": lambda: draw_intervals(diagnosis),
    }
    with plt.rc_context(STYLE):
        figures = {name: draw() for name, draw in drawings.items()}
        return {name: svg(figure) for name, figure in figures.items() if figure is not None}


class Residuals:
    """What the nominal and the chosen fit leave on the held-out records, in the reader's units."""

    def __init__(self, diagnosis: Diagnosis) -> None:
        self.diagnosis, self.recording, fitter = diagnosis, diagnosis.recording, diagnosis.fitter
        self.records: list[Record] = fitter.held
        self.settled = self.recording.kind == "poses"
        search = diagnosis.search
        self.scales = [from_si(1.0, unit) - from_si(0.0, unit) for unit in self.recording.units]
        self.before, self.after = (
            [np.where(r.valid, r.observed - fitter.predicted(trial.fit, r), np.nan) * self.scales for r in self.records]
            for trial in (search.nominal, search.chosen)
        )
        self.changed = bool(diagnosis.findings)

    def spans(self) -> Iterator[tuple[int, np.ndarray]]:
        """(record, its place on one axis): seconds, or poses, one record behind the other."""
        first = 0.0
        for k, record in enumerate(self.records):
            n, step = len(record.time), 1.0 if self.settled else record.sample_time
            yield k, first + step * np.arange(n)
            first += step * n

    def floor(self, i: int) -> float | None:
        """Standard deviation of the noise of channel i, in its unit."""
        return self.diagnosis.held_out[self.recording.channels[i]].noise_floor


def draw_residuals(left: Residuals) -> Figure:
    """Channel by channel: before with after, and after alone on its own scale with the noise."""
    channels, n = left.recording.channels, len(left.recording.channels)
    figure, axes = plt.subplots(n, 2, figsize=(WIDTH, 0.9 + 1.55 * n), sharex=True, squeeze=False)
    style: dict[str, Any] = {"lw": 0.9} if not left.settled else {"ls": "", "marker": "o", "ms": 3}
    for i, (channel, unit) in enumerate(zip(channels, left.recording.units, strict=True)):
        for k, x in left.spans():
            for panel in axes[i] if not left.changed else axes[i, :1]:
                panel.plot(*thinned(x, left.before[k][:, i]), color=BEFORE, label="before" if k == 0 else None, **style)
            if left.changed:
                for panel in axes[i]:
                    panel.plot(*thinned(x, left.after[k][:, i]), color=AFTER, label="after" if k == 0 else None, **style)
            if k > 0:
                for panel in axes[i]:
                    panel.axvline(x[0], color="#999999", lw=0.7, ls=":")
        axes[i, 0].set_ylabel(f"{short(channel)} [{unit}]")
        floor = left.floor(i)
        if floor is not None:
            axes[i, 1].axhspan(-2 * floor, 2 * floor, color=NOISE, zorder=0)
    axes[0, 0].set_title("before and after" if left.changed else "what is left", fontsize=9)
    known = all(left.floor(i) is not None for i in range(n))
    title = "after, on its own scale" if left.changed else "the same"
    axes[0, 1].set_title(title + (" (grey: noise, ± 2 sd)" if known else ""), fontsize=9)
    for panel in axes[-1]:
        panel.set_xlabel("held-out pose" if left.settled else "time in the held-out records [s]")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    if left.changed:
        figure.legend(handles, labels, loc="outside upper center", ncols=2, fontsize=8)
    return figure


def thinned(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A long curve by the smallest and largest sample of each of `POINTS` columns, which looks the same."""
    if len(x) <= 2 * POINTS:
        return x, y
    pieces = np.array_split(np.arange(len(x)), POINTS)
    places = []
    for piece in pieces:
        seen = piece[np.isfinite(y[piece])]
        ends = {int(seen[np.argmin(y[seen])]), int(seen[np.argmax(y[seen])])} if len(seen) else {int(piece[0])}
        places += sorted(ends)
    return x[places], y[places]


def draw_spectrum(left: Residuals) -> Figure | None:
    """Amplitude density of what is left, before and after, and of the noise; None for poses and short records."""
    records = [k for k, r in enumerate(left.records) if len(r.time) >= 64]
    if left.settled or not records:
        return None
    n = len(left.recording.channels)
    columns = min(n, 2)
    rows = -(-n // columns)
    figure, axes = plt.subplots(rows, columns, figsize=(WIDTH, 0.8 + 2.3 * rows), squeeze=False)
    for i, channel in enumerate(left.recording.channels):
        panel, unit = axes.flat[i], left.recording.units[i]
        for parts, colour, label in ((left.before, BEFORE, "before"), (left.after, AFTER, "after"))[: 1 + left.changed]:
            f, density = _density(left, parts, records, i)
            panel.loglog(f, density, color=colour, lw=1.1, label=label)
        noise = _noise_density(left, i, f)
        if noise is not None:
            panel.loglog(f, noise, color="#777777", lw=1.1, ls="--", label="noise")
        panel.set_ylabel(f"{short(channel)} [{unit}/√Hz]")
        panel.set_xlabel("frequency [Hz]")
        panel.set_ylim(bottom=0.2 * np.min(density[density > 0], initial=np.inf))
        panel.legend(fontsize=8)
    for panel in axes.flat[n:]:
        panel.set_visible(False)
    return figure


def _density(
    left: Residuals, parts: list[np.ndarray], records: list[int], i: int
) -> tuple[np.ndarray, np.ndarray]:
    """Welch's amplitude density over the held-out records of the longest one's sample time; marked samples count as zero."""
    longest = max(records, key=lambda k: len(left.records[k].time))
    h = left.records[longest].sample_time
    alike = [k for k in records if left.records[k].sample_time == h]
    size = min(SEGMENT, *(len(left.records[k].time) for k in alike))
    total, weight = 0.0, 0
    for k in alike:
        values = np.nan_to_num(parts[k][:, i])
        f, power = welch(values, 1 / h, nperseg=size, detrend=False)
        total, weight = total + len(values) * power, weight + len(values)
    return f[1:], np.sqrt(total / weight)[1:]


def _noise_density(left: Residuals, i: int, f: np.ndarray) -> np.ndarray | None:
    noise = left.diagnosis.fitter.noise
    if not noise.known[i]:
        return None
    h = max(left.records, key=lambda r: len(r.time)).sample_time
    _, response = freqz([1.0], np.concatenate([[1.0], -noise.ar[i]]), worN=2 * np.pi * f * h)
    return np.abs(response) * noise.sd[i] * left.scales[i] * np.sqrt(2 * h)


def draw_where(diagnosis: Diagnosis) -> Figure | None:
    """Excess of squares over the noise's by output, actuator, band, region, time, direction; None where nothing is known."""
    groups = {name: rows[:PARTS] for name, value in plain(diagnosis.where).items() if (rows := excesses(value))}
    if not groups:
        return None
    heights = [0.45 + 0.21 * len(rows) for rows in groups.values()]
    figure, axes = plt.subplots(
        len(groups), 1, figsize=(WIDTH, 0.6 + sum(heights)), height_ratios=heights, sharex=True, squeeze=False
    )
    for panel, (name, rows) in zip(axes[:, 0], groups.items(), strict=True):
        y = np.arange(len(rows))
        values = np.array([value for _, value, _ in rows])
        panel.barh(y, values, color=[BEFORE if v > 0 else NOISE for v in values], height=0.65)
        for k, (_, _, ci) in enumerate(rows):
            if ci:
                panel.plot(ci, [k, k], color="#333333", lw=1)
        panel.set_yticks(y, [label for label, *_ in rows], fontsize=7.5)
        panel.invert_yaxis()
        panel.set_xscale("symlog", linthresh=1.0)
        panel.axvline(0.0, color="#666666", lw=0.8)
        panel.set_title(name, fontsize=9, loc="left")
    axes[-1, 0].set_xlabel("what is left, in squares over the noise's: 0 nothing, 1 as much again as the noise")
    return figure


def excesses(value: Any, prefix: str = "") -> list[tuple[str, float, list[float] | None]]:
    """(label, excess, its interval) of every part in one group of `where`."""
    rows = []
    if isinstance(value, dict) and isinstance(value.get("excess"), (int, float)):
        bounds = [value.get("low"), value.get("high")]
        label = value.get("label") or (f"{number(bounds[0], 3)} ... {number(bounds[1], 3)} Hz" if all(bounds) else "")
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


def draw_rivals(diagnosis: Diagnosis) -> Figure | None:
    """Round by round: by how much each suspect explains worse than the best one of its round."""
    rounds = [r for r in diagnosis.search.rounds if r.trials]
    if not rounds:
        return None
    heights = [0.55 + 0.3 * len(r.trials) for r in rounds]
    figure, axes = plt.subplots(
        len(rounds), 1, figsize=(WIDTH, 0.6 + sum(heights)), height_ratios=heights, sharex=True, squeeze=False
    )
    kept = set(diagnosis.search.chosen.fit.structure.causes)
    for k, (panel, round_) in enumerate(zip(axes[:, 0], rounds, strict=True)):
        _rival_bars(panel, round_, kept)
        gained = round_.before.total - round_.trials[0].total
        panel.set_title(f"round {k + 1}: the best one gains {number(gained, 3)}", fontsize=9, loc="left")
    axes[-1, 0].set_xlabel("worse than the best of the round, difference of T (dotted: nearer than that is alike)")
    return figure


def _rival_bars(panel: Axes, round_: Round, kept: set[Any]) -> None:
    best = round_.trials[0].total
    far = max(10 * RIVAL, *(t.total - best for t in round_.trials))
    for row, trial in enumerate(round_.trials):
        worse = trial.total - best
        colour = AFTER if trial.cause in kept else BEFORE if worse < RIVAL else "#b0b0b0"
        panel.barh(row, worse, color=colour, height=0.6)
        panel.plot(0, row, "o", color=colour, ms=5, clip_on=False)
        _beside(panel, worse, row, number(worse, 3) if row else "best")
    panel.set_yticks(range(len(round_.trials)), [hypothesis_name(t.cause) for t in round_.trials], fontsize=8)
    panel.invert_yaxis()
    panel.set_xscale("symlog", linthresh=RIVAL)
    panel.set_xlim(0, 30 * far)
    panel.set_xticks([0, *(10.0**k for k in range(1, int(np.log10(30 * far)) + 1))])
    panel.axvline(RIVAL, color="#666666", lw=1, ls=":")


def _beside(panel: Axes, x: float, y: float, text: str) -> None:
    """Text a little to the right of a mark."""
    panel.annotate(text, (x, y), xytext=(6, 0), textcoords="offset points", va="center", fontsize=8)


def draw_confusability(diagnosis: Diagnosis) -> Figure | None:
    """|cos| between what the most conspicuous suspects of the first round do to the readings."""
    search = diagnosis.search
    screened = search.rounds[0].screened if search.rounds else search.last
    top = screened.suspects[:SUSPECTS]
    if len(top) < 2:
        return None
    values = np.array([[screened.alike(a, b) for b in top] for a in top])
    labels = [textwrap.fill(hypothesis_name(s.hypothesis), LABEL, break_long_words=False) for s in top]
    figure, panel = plt.subplots(figsize=(WIDTH, 1.9 + 0.42 * len(top)))
    panel.imshow(values, cmap="Blues", vmin=0, vmax=1, aspect="auto")
    for row, column in np.ndindex(values.shape):
        dark = values[row, column] > 0.6
        panel.text(column, row, _cosine(values[row, column]), ha="center", va="center", fontsize=8, color="w" if dark else "k")
    panel.set_yticks(range(len(top)), [f"{label}  |z| {number(abs(s.z), 2)}" for label, s in zip(labels, top, strict=True)])
    panel.set_xticks(range(len(top)), labels, rotation=35, ha="right")
    panel.tick_params(labelsize=7.5)
    panel.grid(False)
    return figure


def _cosine(value: float) -> str:
    """Two digits, more where it is nearly one: 0.998 is not 0.98."""
    return f"{value:.2f}" if value < 0.985 or value > 0.99995 else f"{value:.4f}"


def draw_intervals(diagnosis: Diagnosis) -> Figure | None:
    """Every parameter found, its 95 % interval in percent of its value; left of zero it may be absent."""
    rows = []
    for finding in diagnosis.findings:
        for name, e in finding.parameters.items():
            if e.value and np.all(np.isfinite([e.value, *e.ci95])):
                ends = sorted(100 * np.array(e.ci95) / e.value)
                rows.append((f"{hypothesis_name(finding.cause)}: {name}", ends))
    if not rows:
        return None
    figure, panel = plt.subplots(figsize=(WIDTH, 0.8 + 0.32 * len(rows)))
    for k, (_, (low, high)) in enumerate(rows):
        panel.plot([low, high], [k, k], color=AFTER, lw=3, solid_capstyle="butt")
        panel.plot(100, k, "o", color=AFTER, ms=6)
        _beside(panel, max(high, 100), k, f"{_percent(low - 100)} ... {_percent(high - 100)}")
    panel.set_yticks(range(len(rows)), [label for label, _ in rows], fontsize=8)
    panel.set_ylim(len(rows) - 0.5, -0.5)
    low, high = min(0.0, *(e[0] for _, e in rows)), max(100.0, *(e[1] for _, e in rows))
    panel.set_xlim(low - 0.03 * (high - low), high + 0.3 * (high - low))
    panel.axvline(0.0, color="#666666", lw=1)
    panel.set_xlabel("95 % interval in percent of the value found")
    return figure


def _percent(value: float) -> str:
    """'+0.16 %'; nothing below a thousandth, where a number stands on its bound."""
    return f"{value:+.2g} %" if abs(value) > 1e-3 else "0 %"
