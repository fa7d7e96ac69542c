"""Drawings of a solution as SVG text: lines and points over two axes with a legend above, and bars. In the look of `plots`, without
matplotlib, whose import and layout take a tenth of `ctrlgen run`.

Lengths are points. The width of a text is estimated: no font is read.
"""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ctrlgen.reporting.line_patterns import DASHES, LINE, mark

INCH = 72.0
SIZE, SMALL = 9.0, 8.0  # of letters: of axes, of legends and bars
WIDE = 0.62  # of its size, the width of a letter of DejaVu Sans: rather more than the mean
ROW, GAP = 13.0, 6.0  # height of a row of a legend; what is free between things
SAMPLE = 26.0  # length of a line in a legend
MARGIN = 0.05  # of the range of the values, free at each end of an axis
APART = {"x": 62.0, "y": 34.0}  # between ticks, at least
PLAIN = 1e-4, 1e5  # between these, numbers are written without a power of ten
MOST, STRETCHES = 2400, 500  # places of a line that are all drawn; stretches of a longer one
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
EDGE, GRID = "#666666", "#e6e6e6"
# What points look like, by the letters of `line_patterns`, in a square of -1 to 1
SHAPES = {
    "o": "M-1 0A1 1 0 1 1 1 0A1 1 0 1 1 -1 0Z",
    "s": "M-1 -1H1V1H-1Z",
    "^": "M0 -1L1 1H-1Z",
    "D": "M0 -1.3L1.3 0L0 1.3L-1.3 0Z",
    "v": "M0 1L1 -1H-1Z",
    "x": "M-1 -1L1 1M-1 1L1 -1",
    "+": "M-1.2 0H1.2M0 -1.2V1.2",
    "*": "M0 -1.4L.4 -.4L1.4 -.3L.6 .4L.9 1.4L0 .8L-.9 1.4L-.6 .4L-1.4 -.3L-.4 -.4Z",
    "<": "M-1 0L1 -1V1Z",
    ">": "M1 0L-1 -1V1Z",
    "p": "M0 -1.1L1.1 -.3L.7 1H-.7L-1.1 -.3Z",
    "h": "M0 -1.2L1 -.6V.6L0 1.2L-1 .6V-.6Z",
}


@dataclass(frozen=True)
class Series:
    """`y` over `x` (n,): a line with the dashes of place `line` in `line_patterns`, with `points` its marks too, or alone (`width` 0)."""

    name: str
    x: np.ndarray
    y: np.ndarray
    colour: str
    line: int = 0
    width: float = LINE
    points: float = 0.0  # size


@dataclass(frozen=True)
class Axes:
    """Series over two axes; `equal`: one scale for both; `band`: low, high and name of a grey stretch of the ordinate; `whole`: ticks of
    the abscissa at whole numbers alone; `y_range` where it is not that of the values; `columns` of the legend at most."""

    x_label: str
    y_label: str
    series: tuple[Series, ...]
    equal: bool = False
    band: tuple[float, float, str] | None = None
    whole: bool = False
    y_range: tuple[float, float] | None = None
    columns: int = 6


@dataclass(frozen=True)
class Bar:
    """A row: its `name`, its length [%], its colour, and what stands behind it."""

    name: str
    length: float
    colour: str
    text: str


def panels_svg(panels: Sequence[Axes], widths: Sequence[float], width: float, height: float) -> str:
    """The panels beside each other, so wide to each other as `widths`; `width` and `height` in inches."""
    shares, left, parts = np.array(widths) / np.sum(widths), 0.0, []
    for number, (panel, share) in enumerate(zip(panels, shares, strict=True)):
        parts.append(_panel(panel, left, INCH * width * float(share), INCH * height, number))
        left += INCH * width * float(share)
    return svg_text(parts, INCH * width, INCH * height)


def bars_svg(rows: Sequence[Bar], label: str, width: float, height: float) -> str:
    """Bars from zero, the first at the top; the axis goes to 100 % and leaves room for the texts."""
    w, h = INCH * width, INCH * height
    left, top, bottom = GAP + max((_long(r.name, SIZE) for r in rows), default=0.0) + GAP, GAP, h - 2.6 * SIZE - GAP
    scale, step = (w - left - GAP) / 150, (bottom - top) / max(len(rows), 1)
    parts = []
    for at in range(0, 101, 20):
        x = left + scale * at
        parts += [_line(x, top, x, bottom, GRID), _text(x, bottom + 1.2 * SIZE, str(at), SIZE, "middle")]
    for k, row in enumerate(rows):
        y = top + (k + 0.5) * step
        parts.append(
            f'<path d="M{left:.2f} {y - 0.3 * step:.2f}h{scale * row.length:.2f}v{0.6 * step:.2f}H{left:.2f}Z" style="fill: {row.colour}"/>'
        )
        parts.append(_text(left - GAP, y + 0.35 * SIZE, row.name, SIZE, "end"))
        parts.append(_text(left + scale * (row.length + 1), y + 0.35 * SMALL, row.text, SMALL, "start"))
    parts += [_line(left, top, left, bottom, EDGE), _line(left, bottom, w - GAP, bottom, EDGE)]
    parts.append(_text((left + w) / 2, bottom + 2.5 * SIZE, label, SIZE, "middle"))
    return svg_text(parts, w, h)


def _panel(panel: Axes, left: float, width: float, height: float, number: int) -> str:
    xs, ys = ([getattr(s, name) for s in panel.series] for name in ("x", "y"))
    (x_low, x_high), (y_low, y_high) = _range(xs), panel.y_range or _range(ys)
    legend, depth = _legend(panel, left, width, number)
    top, bottom = GAP + depth, height - 2.7 * SIZE - GAP
    inner = width - 2 * GAP
    y_ticks, y_power = ticks(y_low, y_high, (bottom - top) / APART["y"])
    y_names = numerals(y_ticks, y_power)
    start = left + GAP + 1.4 * SIZE + max((_long(n, SIZE) for n in y_names), default=0.0) + GAP
    end = left + GAP + inner
    if panel.equal:
        scale = max((x_high - x_low) / (end - start), (y_high - y_low) / (bottom - top))
        x_low, x_high = _about(x_low, x_high, scale * (end - start))
        y_low, y_high = _about(y_low, y_high, scale * (bottom - top))
        y_ticks, y_power = ticks(y_low, y_high, (bottom - top) / APART["y"])
        y_names = numerals(y_ticks, y_power)
    x_ticks, x_power = ticks(x_low, x_high, (end - start) / APART["x"], panel.whole)

    def across(x: np.ndarray) -> np.ndarray:
        return start + (np.asarray(x, float) - x_low) * ((end - start) / (x_high - x_low))

    def up(y: np.ndarray) -> np.ndarray:
        return bottom - (np.asarray(y, float) - y_low) * ((bottom - top) / (y_high - y_low))

    parts = [legend]
    if panel.band is not None:
        low, high = (float(np.clip(up(np.array(end_)), top, bottom)) for end_ in panel.band[:2])
        parts.append(f'<path d="M{start:.2f} {high:.2f}H{end:.2f}V{low:.2f}H{start:.2f}Z" style="fill: #f0f0f0"/>')
    for x, name in zip(across(x_ticks), numerals(x_ticks, x_power), strict=True):
        parts += [_line(x, top, x, bottom, GRID), _text(x, bottom + 1.3 * SIZE, name, SIZE, "middle")]
    for y, name in zip(up(y_ticks), y_names, strict=True):
        parts += [_line(start, y, end, y, GRID), _text(start - GAP, y + 0.35 * SIZE, name, SIZE, "end")]
    parts += [_line(start, top, start, bottom, EDGE), _line(start, bottom, end, bottom, EDGE)]
    parts += [_curve(s, across(s.x), up(s.y)) for s in panel.series]
    parts.append(_text((start + end) / 2, bottom + 2.6 * SIZE, panel.x_label + _power(x_power), SIZE, "middle"))
    x, y = left + GAP + 0.8 * SIZE, (top + bottom) / 2
    parts.append(
        _text(x, y, panel.y_label + _power(y_power), SIZE, "middle", f' transform="rotate(-90 {x:.2f} {y:.2f})"')
    )
    return "\n".join(parts)


def _legend(panel: Axes, left: float, width: float, number: int) -> tuple[str, float]:
    """The legend in rows that fit, and how deep it is."""
    entries: list[tuple[str, Series | None]] = [(s.name, s) for s in panel.series if s.name]
    entries += [] if panel.band is None else [(panel.band[2], None)]
    rows: list[list[tuple[str, Series | None]]] = [[]]
    for entry in entries:
        longer = [*rows[-1], entry]
        if len(longer) > panel.columns or (rows[-1] and _row(longer) > width - 2 * GAP):
            rows.append([entry])
        else:
            rows[-1] = longer
    parts = [f'<g id="legend_{number + 1}">']
    for k, row in enumerate(rows):
        x, y = left + (width - _row(row)) / 2, GAP + (k + 0.5) * ROW
        for name, series in row:
            if series is None:
                parts.append(f'<path d="M{x:.2f} {y - 4:.2f}h{SAMPLE}v8h-{SAMPLE}Z" style="fill: #f0f0f0"/>')
            else:
                places = (x, x + SAMPLE) if series.width else (x + SAMPLE / 2,)
                curve = _curve(series, np.array(places), np.full(len(places), y))
                parts.append(f'<g id="line2d_{number + 1}{len(parts)}">{curve}</g>')
            parts.append(_text(x + SAMPLE + 4, y + 0.35 * SMALL, name, SMALL, "start"))
            x += _entry(name)
    return "\n".join([*parts, "</g>"]), ROW * len(rows) if entries else 0.0


def _entry(name: str) -> float:
    return SAMPLE + 4 + _long(name, SMALL) + 2 * GAP


def _row(entries: Sequence[tuple[str, Series | None]]) -> float:
    return sum(_entry(name) for name, _ in entries)


def _curve(series: Series, x: np.ndarray, y: np.ndarray) -> str:
    """The line through places, interrupted where there is no number, and the points on them."""
    parts, seen = [], np.isfinite(x) & np.isfinite(y)
    if series.width:
        if len(x) > MOST and seen.all():
            kept = _peaks(x, y)
            x, y = x[kept], y[kept]
            seen = np.ones(len(x), bool)
        begins = seen & ~np.concatenate([[False], seen[:-1]])
        d = "".join(
            f"{'M' if first else 'L'}{a:.1f} {b:.1f}"
            for first, a, b in zip(begins[seen].tolist(), x[seen].tolist(), y[seen].tolist(), strict=True)
        )
        dash = DASHES[series.line % len(DASHES)]
        told = f"; stroke-dasharray: {','.join(f'{0.75 * n:g}' for n in dash)}" if dash else ""
        style = f"fill: none; stroke: {series.colour}; stroke-width: {series.width:g}; stroke-linejoin: round{told}"
        parts.append(f'<path d="{d}" style="{style}"/>')
    if series.points:
        letter, half = mark(series.line), series.points / 2
        kind = f"mark{ord(letter)}-{series.points:g}"
        parts.append(
            f'<defs><path id="{kind}" d="{SHAPES[letter]}" transform="scale({half:g})" style="stroke-width: .45"/></defs>'
        )
        style = f"fill: {series.colour}; stroke: {series.colour}"
        parts += [
            f'<use xlink:href="#{kind}" x="{a:.2f}" y="{b:.2f}" style="{style}"/>'
            for a, b in zip(x[seen].tolist(), y[seen].tolist(), strict=True)
        ]
    return "".join(parts)


def _peaks(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The places of a long curve that are drawn, in order: ends and extremes of stretches hardly wider than the line."""
    rows = np.minimum(np.arange(STRETCHES * -(-len(x) // STRETCHES)), len(x) - 1).reshape(STRETCHES, -1)
    extremes = [extreme(v[rows], axis=1) for v in (x, y) for extreme in (np.argmin, np.argmax)]
    return np.unique([rows[:, 0], rows[:, -1], *(rows[np.arange(STRETCHES), k] for k in extremes)])


def _range(values: Sequence[np.ndarray]) -> tuple[float, float]:
    """Low and high of an axis, with a margin; around what is one value."""
    every = np.concatenate([np.asarray(v, float).ravel() for v in values]) if values else np.zeros(1)
    every = every[np.isfinite(every)]
    low, high = (float(every.min()), float(every.max())) if every.size else (0.0, 1.0)
    if high - low <= 1e-12 * max(abs(low), abs(high)):
        room = 0.05 * max(abs(low), abs(high)) or 0.05
        return low - room, high + room
    return low - MARGIN * (high - low), high + MARGIN * (high - low)


def _about(low: float, high: float, span: float) -> tuple[float, float]:
    middle = (low + high) / 2
    return middle - span / 2, middle + span / 2


def ticks(low: float, high: float, most: float, whole: bool = False) -> tuple[np.ndarray, int]:
    """Places of about `most` ticks, at 1, 2, 2.5 or 5 times a power of ten, and the power of ten that is told beside the label."""
    rough = (high - low) / max(most, 2.0)
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(k for k in (1.0, 2.0, 2.5, 5.0, 10.0) if k * power >= rough * (1 - 1e-9)) * power
    step = max(1.0, float(round(step))) if whole else step
    places = step * np.arange(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)
    size = max(abs(low), abs(high))
    return places, 0 if PLAIN[0] <= step and size < PLAIN[1] else math.floor(math.log10(size))


def numerals(places: np.ndarray, power: int) -> list[str]:
    """The ticks as texts of as many digits as tell them apart."""
    values = places / 10.0**power
    step = float(np.diff(values[:2])[0]) if len(values) > 1 else 1.0
    digits = next((k for k in range(12) if abs(step * 10**k - round(step * 10**k)) < 1e-6 * step * 10**k), 12)
    return [f"{v + 0.0:.{digits}f}".replace("-", "\u2212") for v in np.round(values, digits)]


def _power(power: int) -> str:
    return f"  \u00d710{str(power).translate(RAISED)}" if power else ""


def _long(text: str, size: float) -> float:
    return WIDE * size * len(text)


def _line(x: float, y: float, to_x: float, to_y: float, colour: str) -> str:
    return f'<path d="M{x:.2f} {y:.2f}L{to_x:.2f} {to_y:.2f}" style="fill: none; stroke: {colour}; stroke-width: .8"/>'


def _text(x: float, y: float, text: str, size: float, anchor: str, more: str = "") -> str:
    style = f"font: {size:g}px 'DejaVu Sans', sans-serif; text-anchor: {anchor}"
    return f'<text x="{x:.2f}" y="{y:.2f}" style="{style}"{more}>{html.escape(text, quote=False)}</text>'


def svg_text(parts: Sequence[str], width: float, height: float) -> str:
    """The drawing that holds these parts, on white."""
    names = 'xmlns:xlink="http://www.w3.org/1999/xlink" xmlns="http://www.w3.org/2000/svg" version="1.1"'
    paper = f'<path d="M0 0H{width:.2f}V{height:.2f}H0Z" style="fill: #ffffff"/>'
    head = f'<svg {names} width="{width:.2f}pt" height="{height:.2f}pt" viewBox="0 0 {width:.2f} {height:.2f}">'
    return "\n".join([head, paper, *parts, "</svg>\n"])
