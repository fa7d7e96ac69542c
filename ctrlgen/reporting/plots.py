"""What every figure of ctrlgen has in common: colours, style, SVG text."""

from __future__ import annotations

import io
import os
import re
import sys
from typing import Any

import matplotlib

# Without a window, but a notebook or a script that has chosen how it shows its own figures keeps that
if "MPLBACKEND" not in os.environ and "matplotlib.pyplot" not in sys.modules:
    matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatterMathtext, LogFormatterSciNotation

# safe for the colour-blind, a pair per stage
COLOURS = ("#0072b2", "#56b4e9", "#d55e00", "#e69f00", "#009e73", "#7fc97f")
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
STYLE: dict[Any, Any] = {
    "font.size": 9,
    "font.family": "DejaVu Sans",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e6e6e6",
    "axes.edgecolor": "#666666",
    "axes.axisbelow": True,
    "legend.frameon": False,
    "text.parse_math": False,  # a $ in a name is a $
    "svg.fonttype": "none",
    "svg.hashsalt": "ctrlgen",
    "figure.constrained_layout.use": True,
}


class Powers(LogFormatterSciNotation):
    """Labels of a logarithmic axis as text, '10⁻³': without mathematics, which stays off (`text.parse_math`)."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        """The label of the value `x`."""
        return plain_powers(super().__call__(x, pos))


def plain_powers(label: str) -> str:
    """'10⁻³' for '$\\mathdefault{10^{-3}}$', '2×10⁻³' for one with a factor."""
    label = label.replace("$\\mathdefault{", "").replace("}$", "").replace("\\times", "\u00d7")
    return re.sub(r"\^\{([^}]*)\}", lambda found: found[1].translate(RAISED), label)


def legend_above(panel: Axes, size: float = 8, columns: int = 6) -> None:
    """The legend of a panel above it, where it hides no data; columns of at most as many entries."""
    handles, labels = panel.get_legend_handles_labels()
    panel.legend(
        handles, labels, fontsize=size, ncols=min(columns, len(labels)), loc="lower center", bbox_to_anchor=(0.5, 1.0)
    )


def legend_over(figure: Figure, panel: Axes, columns: int = 6, size: float = 8, below: bool = False) -> None:
    """The legend of a panel above the whole figure, or `below` it: where panels have titles, or share their lines."""
    handles, labels = panel.get_legend_handles_labels()
    columns = min(columns, len(labels))
    if below:
        figure.legend(handles, labels, fontsize=size, ncols=columns, loc="outside lower center")
    else:
        figure.legend(handles, labels, fontsize=size, ncols=columns, loc="outside upper center")


def svg(figure: Figure) -> str:
    """The figure as SVG text without a date: the same for the same figure, which is closed."""
    _plain_ticks(figure)
    buffer = io.StringIO()
    # what savefig does, without its drawing once more before
    canvas: Any = FigureCanvasSVG(figure)
    canvas.print_svg(buffer, metadata={"Date": None, "Creator": "ctrlgen"})
    plt.close(figure)
    text = buffer.getvalue()
    return re.sub(r"<\?xml.*?<svg", "<svg", text, count=1, flags=re.DOTALL)


def image(figure: Figure, suffix: str) -> bytes:
    """The figure as a file of .svg or .png; the figure is closed."""
    if suffix == ".svg":
        return svg(figure).encode()
    _plain_ticks(figure)
    buffer = io.BytesIO()
    figure.savefig(buffer, format=suffix[1:], dpi=150)
    plt.close(figure)
    return buffer.getvalue()


def _plain_ticks(figure: Figure) -> None:
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            if isinstance(axis.get_major_formatter(), LogFormatterMathtext):
                axis.set_major_formatter(Powers())
            if isinstance(axis.get_minor_formatter(), LogFormatterMathtext):
                axis.set_minor_formatter(Powers(minor_thresholds=(1, 0.4)))
