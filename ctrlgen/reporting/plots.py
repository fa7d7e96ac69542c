"""What every figure of ctrlgen has in common: colours, style, SVG text."""

from __future__ import annotations

import io
import re
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.figure import Figure

# safe for the colour-blind, a pair per stage
COLOURS = ("#0072b2", "#56b4e9", "#d55e00", "#e69f00", "#009e73", "#7fc97f")
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


def svg(figure: Figure) -> str:
    """The figure as SVG text without a date: the same for the same figure, which is closed."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": "ctrlgen"})
    plt.close(figure)
    text = buffer.getvalue()
    return re.sub(r"<\?xml.*?<svg", "<svg", text, count=1, flags=re.DOTALL)


def image(figure: Figure, suffix: str) -> bytes:
    """The figure as a file of .svg or .png; the figure is closed."""
    if suffix == ".svg":
        return svg(figure).encode()
    buffer = io.BytesIO()
    figure.savefig(buffer, format=suffix[1:], dpi=150)
    plt.close(figure)
    return buffer.getvalue()
