"""Data of a figure that zooms, pans and shows its values: curves over one abscissa in panels that share it.

`chart.js` draws it by uPlot (vendor/README.md). Charts of one `group` on a page show the same stretch and link their cursors. Inlined
is a bounded part of the data: of each of so many stretches of a long curve the smallest and the largest sample, at their own places,
so that no peak is lost and the range is the whole one.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from markupsafe import Markup

from ctrlgen.core.escaping import json_in_html
from ctrlgen.reporting.line_patterns import DASHES, LINE, mark

# numbers of a panel: about 100 kB of text, so that a page of ten panels stays in the order of a megabyte
MOST_NUMBERS = 12_000
# digits: of a value, more than a screen has dots; of the abscissa, where a sample is far from the first one
DIGITS, PLACE_DIGITS = 6, 9


@dataclass(frozen=True)
class Curve:
    """One curve or row of points: its `values` (n,), NaN where there is none; `line` is its place in `line_patterns`: of its dashes, or
    of the mark of its `points`.

    `held`: from each place to the next, as a drive is.
    `colour`: the place in the palette of the page, whose colours differ in the dark.
    """

    name: str
    values: np.ndarray
    colour: int = 0
    line: int = 0
    width: float = LINE
    held: bool = False
    points: bool = False


@dataclass(frozen=True)
class Panel:
    """Curves over `x` (n,), which increases; `label` of the ordinate with its unit, whether it is logarithmic, a grey `band` (low, high)
    and level `rules` (value, what it is)."""

    label: str
    x: np.ndarray
    curves: tuple[Curve, ...]
    log: bool = False
    band: tuple[float, float] | None = None
    rules: tuple[tuple[float, str], ...] = ()
    height: int = 220


@dataclass(frozen=True)
class Chart:
    """Panels above each other over one abscissa."""

    x_label: str
    panels: tuple[Panel, ...]
    log_x: bool = False
    group: str = ""
    # names of single places, such as recordings; the abscissa is then their number
    places: tuple[str, ...] = ()
    _kept: tuple[np.ndarray, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_kept", tuple(kept_places(panel) for panel in self.panels))

    @property
    def thinned(self) -> str:
        """What is said of data that were left out; empty where none were."""
        cut = [(len(p.x), len(k)) for p, k in zip(self.panels, self._kept, strict=True) if len(k) < len(p.x)]
        if not cut:
            return ""
        whole, kept = max(cut)
        return f"Of {whole:,} samples {kept:,} are shown: of each stretch the smallest and the largest of every curve."

    @property
    def json(self) -> Markup:
        """The chart as JSON that is safe inside a script element."""
        panels = [_panel(panel, kept) for panel, kept in zip(self.panels, self._kept, strict=True)]
        group = self.group or self.x_label
        data = {"x": self.x_label, "logX": self.log_x, "group": group, "places": self.places, "panels": panels}
        return Markup(json_in_html(json.dumps(data, separators=(",", ":"), ensure_ascii=False, allow_nan=False)))


def kept_places(panel: Panel) -> np.ndarray:
    """The samples of a panel that are inlined, increasing: all where they are few, else of each stretch the smallest and the largest of
    every curve, the ends, and at each gap one sample that is none."""
    n, rows = len(panel.x), MOST_NUMBERS // (1 + len(panel.curves))
    if n <= rows:
        return np.arange(n)
    stretches = max(1, rows // (3 * max(1, len(panel.curves))))
    edges = np.linspace(0, n, stretches + 1).astype(int)
    kept = {0, n - 1}
    for curve in panel.curves:
        for first, end in pairwise(edges):
            part = curve.values[first:end]
            seen = np.flatnonzero(np.isfinite(part))
            if len(seen):
                kept |= {first + int(seen[np.argmin(part[seen])]), first + int(seen[np.argmax(part[seen])])}
            if len(seen) < len(part):
                kept.add(first + int(np.argmin(np.isfinite(part))))
    return np.array(sorted(kept))


def _panel(panel: Panel, kept: np.ndarray) -> dict[str, Any]:
    curves = [
        {
            "name": c.name,
            "colour": c.colour,
            "dash": DASHES[c.line % len(DASHES)],
            "mark": mark(c.line) if c.points else "",
            "width": c.width,
            "held": c.held,
            "y": _rounded(c.values[kept], DIGITS),
        }
        for c in panel.curves
    ]
    x = _rounded(np.asarray(panel.x, float)[kept], PLACE_DIGITS)
    return {
        "label": panel.label,
        "log": panel.log,
        "band": panel.band,
        "rules": [[float(v), what] for v, what in panel.rules],
        "height": panel.height,
        "x": x,
        "curves": curves,
    }


def _rounded(values: np.ndarray, digits: int) -> list[float | int | None]:
    """Numbers to so many digits, whole ones without a point; None for what is none."""
    told: list[float | int | None] = []
    for value in np.asarray(values, float).tolist():
        if not math.isfinite(value):
            told.append(None)
            continue
        short = float(f"{value:.{digits}g}")
        told.append(int(short) if short.is_integer() and abs(short) < 1e15 else short)
    return told
