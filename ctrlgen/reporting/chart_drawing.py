"""The drawing of a chart for paper and for screens without JavaScript: the same panels, lines and limits."""

from __future__ import annotations

from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ctrlgen.reporting.chart import Chart, Panel
from ctrlgen.reporting.line_patterns import dashes, mark
from ctrlgen.reporting.plots import COLOURS, STYLE, plt, svg

WIDTH, PANEL = 8.6, 2.3  # inches: width of the drawing, height of a panel
SIZE, LONG = (
    7,
    4,
)  # points of the letters of a legend; length of its lines in letters, a whole turn of the longest dashes
LETTER, HANDLE = 0.06, 0.85  # inches: width of a letter of a legend, of the line beside it with its space
NAMED = 40  # places that are named on the axis; more of them cover each other


def chart_svg(chart: Chart) -> str:
    """The chart as SVG text."""
    with plt.rc_context(STYLE):
        return svg(draw_chart(chart))


def draw_chart(chart: Chart) -> Figure:
    """The chart as a figure, in the style of the rc context that it is drawn in."""
    n = len(chart.panels)
    figure, axes = plt.subplots(n, 1, figsize=(WIDTH, 0.6 + PANEL * n), sharex=True, squeeze=False)
    for axis, panel in zip(axes[:, 0], chart.panels, strict=True):
        for curve in panel.curves:
            style: dict[str, Any] = (
                {"ls": "", "marker": mark(curve.line), "ms": 3}
                if curve.points
                else {"ls": dashes(curve.line), "lw": curve.width}
            )
            axis.plot(panel.x, curve.values, color=COLOURS[2 * curve.colour % 6], label=curve.name, **style)
        if panel.band is not None:
            axis.axhspan(*panel.band, color="#e2e2e2", zorder=0)
        for value, what in panel.rules:
            axis.axhline(value, color="#666666", lw=0.9, ls="--")
            axis.text(1.0, value, what, ha="right", va="bottom", fontsize=7, transform=axis.get_yaxis_transform())
        if panel.log:
            axis.set_yscale("log")
        if chart.log_x:
            axis.set_xscale("log")
        axis.set_ylabel(panel.label)
        if panel.curves:
            _name(axis, panel)
    last = axes[-1, 0]
    last.set_xlabel(chart.x_label)
    if chart.places and len(chart.places) <= NAMED:
        last.set_xticks(range(1, len(chart.places) + 1), chart.places, rotation=60, ha="right", fontsize=7)
    return figure


def _name(axis: Axes, panel: Panel) -> None:
    """The legend above the panel, where it covers nothing, in as many columns as fit."""
    fit = int(WIDTH / (HANDLE + LETTER * max(len(curve.name) for curve in panel.curves)))
    columns = min(max(fit, 1), len(panel.curves))
    axis.legend(fontsize=SIZE, handlelength=LONG, ncols=columns, loc="lower center", bbox_to_anchor=(0.5, 1.0))
