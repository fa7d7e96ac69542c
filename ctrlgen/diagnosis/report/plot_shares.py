"""The figure of model-free shares: bars by channel and kind, and the residual over what predicts it best."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ctrlgen.core.to_digits import to_digits
from ctrlgen.core.units import difference
from ctrlgen.diagnosis.shares.design import Columns, Kind
from ctrlgen.diagnosis.shares.shares_table import ChannelShares, SharesTable
from ctrlgen.reporting.line_patterns import mark
from ctrlgen.reporting.plots import COLOURS, legend_over

WIDTH = 8.6
# kinds of a channel that are shown, besides the selected ones
BARS = 7
PANELS = 3
# samples drawn in a panel: each costs a hundred bytes of the page
POINTS = 600
# shares below it have no bar
SMALL = 0.01
SELECTED, OTHER, PAST, ADDED, RESIDUAL = COLOURS[0], "#c4d7e6", "#d9d9d9", COLOURS[3], "#b0b0b0"


def draw_shares(table: SharesTable, units: dict[str, str] | None = None) -> Figure | None:
    """Bars of the shares by channel with their intervals and the total, and up to three panels of the residual over its best
    regressors with what the smoother predicts out of block. `units` of the residuals by channel; SI without.

    None where no kind of signal has a bar in any channel.
    """
    rows = [_shown(c) for c in table.channels]
    if not any(rows):
        return None
    panels = _panels(table)
    heights = [0.5 + 0.19 * max(len(kinds), 1) for kinds in rows]
    below = 2.3 if panels else 0.0
    size = (WIDTH, sum(heights) + below + 0.55)
    figure = plt.figure(figsize=size)
    grid = figure.add_gridspec(len(rows) + bool(panels), 1, height_ratios=[*heights, *([below] if panels else [])])
    first: Axes | None = None
    for i, (channel, kinds) in enumerate(zip(table.channels, rows, strict=True)):
        panel = figure.add_subplot(grid[i], sharex=first)
        first = first or panel
        _bars(panel, channel, kinds)
        if i < len(rows) - 1:
            panel.tick_params(labelbottom=False)
        else:
            panel.set_xlabel("share of the residual's energy, predicted in blocks not used [%]")
    if first is not None:
        first.set_xlim(0, 100)
        handles, labels = first.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), fontsize=8)
    if panels:
        lower = grid[-1].subgridspec(1, len(panels))
        for k, (channel, kind) in enumerate(panels):
            panel = figure.add_subplot(lower[k])
            _residual(panel, table, channel, kind, (units or {}).get(channel.channel, ""))
        legend_over(figure, panel, below=True)
    return figure


def _shown(channel: ChannelShares) -> list[Kind]:
    """Kinds with a bar: the selected ones in their order, then the largest others."""
    chosen = [row.kind for row in channel.selected]
    others = [row.kind for row in channel.kinds if row.kind not in chosen and row.alone.share >= SMALL]
    return [*chosen, *others[: max(BARS - len(chosen), 0)]]


def _bars(panel: Axes, channel: ChannelShares, kinds: list[Kind]) -> None:
    """One channel: a bar a kind, its interval, what it adds, and the total as a line."""
    by_kind = {row.kind: row for row in channel.kinds}
    y = np.arange(len(kinds))
    shares = [100 * by_kind[kind].alone.share for kind in kinds]
    colours = [SELECTED if by_kind[k].selected else PAST if k is Kind.PAST else OTHER for k in kinds]
    panel.barh(y, shares, color=colours, height=0.62)
    for k, kind in enumerate(kinds):
        row = by_kind[kind]
        panel.plot([100 * end for end in row.alone.ci95], [k, k], color="#333333", lw=1)
        if row.selected:
            label = "adds to those above" if row.selected == 1 else None
            panel.plot([100 * row.additional], [k], "D", ms=4, color=ADDED, mec="white", mew=0.5, label=label)
    total = 100 * channel.total.share
    panel.axvline(total, color=COLOURS[2], lw=1.3, ls="--", label="all kinds together")
    names = [f"{by_kind[k].selected}. {k.value}" if by_kind[k].selected else k.value for k in kinds]
    panel.set_yticks(y, names, fontsize=7.5)
    panel.set_ylim(max(len(kinds), 1) - 0.4, -0.6)
    panel.set_title(
        f"{channel.channel}: all kinds {total:.0f} %, rest {100 * channel.rest:.0f} %", fontsize=9, loc="left"
    )


def _panels(table: SharesTable) -> list[tuple[ChannelShares, Kind]]:
    """The selected kinds of all channels with the largest shares alone."""
    every = [
        (row.alone.share, c, row.kind)
        for c in table.channels
        for row in c.selected
        if row.kind is not Kind.RECORD and row.alone.share >= SMALL
    ]
    return [(c, kind) for _, c, kind in sorted(every, key=lambda item: -item[0])[:PANELS]]


def _residual(panel: Axes, table: SharesTable, channel: ChannelShares, kind: Kind, unit: str) -> None:
    """The residual over one signal, and the smoother's prediction out of block."""
    x, name, of = _abscissa(table, channel, kind)
    predicted = channel.predictions[kind]
    seen = np.flatnonzero(np.isfinite(channel.residual))
    seen = seen[:: max(len(seen) // POINTS, 1)]
    y, smooth = ((difference(v[seen], unit) if unit else v[seen]) for v in (channel.residual, predicted))
    panel.plot(x[seen], y, mark(0), ms=2, mfc="none", color=RESIDUAL, label="residual")
    panel.plot(x[seen], smooth, mark(1), ms=2, color=COLOURS[2], label="smoother")
    limits = np.percentile(y, [0.2, 99.8])
    margin = 0.1 * float(np.ptp(limits)) or 1.0
    panel.set_ylim(float(limits[0]) - margin, float(limits[1]) + margin)
    panel.set_xlabel(f"{name} [{of}]" if of else name, fontsize=8)
    panel.set_title(f"{channel.channel} over {kind.value}" + (f" [{unit}]" if unit else ""), fontsize=8)
    panel.locator_params(nbins=5)
    panel.tick_params(labelsize=7.5)


def _abscissa(table: SharesTable, channel: ChannelShares, kind: Kind) -> tuple[np.ndarray, str, str]:
    """Values, name and unit of the signal of a kind that goes best with its prediction."""
    if kind is Kind.LINE:
        period = channel.periods[kind]
        time = next(b for b in table.design.blocks if b.kind is Kind.TIME).abscissa
        return (time / period) % 1.0, f"phase of {to_digits(1 / period)} Hz", "periods"
    stands_for = {Kind.PITCH: Kind.POSITION, Kind.RATE: Kind.SPEED}
    blocks = list(table.design.of_kind(stands_for.get(kind, kind), channel.axes))
    blocks = blocks or [b for b in table.design.blocks if b.kind is Kind.TIME]
    best = max(blocks, key=lambda block: _explained(block, channel.predictions[kind]))
    x, name = best.abscissa, best.signal
    if kind is Kind.PITCH:
        period = channel.periods[kind]
        return (x / period) % 1.0, f"{name} in the pitch", "periods"
    return (np.asarray(difference(x, best.unit)) if best.unit else x), name, best.unit


def _explained(block: Columns, prediction: np.ndarray) -> float:
    """Squared multiple correlation of a prediction with the columns of a block."""
    seen = np.isfinite(prediction)
    y, X = prediction[seen] - prediction[seen].mean(), block.values[seen] - block.values[seen].mean(axis=0)
    fitted = X @ np.linalg.lstsq(X, y, rcond=1e-8)[0]
    return float(fitted @ fitted)
