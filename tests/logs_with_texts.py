"""Random logs with what looks like numbers and is none: ranges in cells, names and remarks, drives that rows state in turn, marks of an
instrument; and fixed columns in which numbers do run into one another.

Put together letter by letter; nothing of the reader is used. The truth is what was written, as Python reads it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SEPARATORS = (",", ";", "\t", "|", " ", "fixed")
RANGES = ("0.5-1.5", "10-20", "1.5+0.1", "-0.5-1.5", "0.5-1.5-2.5", "12.03-2024.5", "2-1", "1e-3-2e-3")
REMARKS = ("# Butterworth {} Hz", "% band {}", "// {} {}", "# {}", "! -1.0-2.0 {}")
UNITS = {"t": "s", "a": "V", "b": "V", "x": "um"}
PATTERNS = ("all", "all", "in turn", "slow", "apart", "one slow", "nested", "some")
MARKS = ("OL", "lost", "---", "9.9E37", "OVERLOAD")
STEP = 1e-3


@dataclass(frozen=True)
class Written:
    """A written log: its text; the names of its columns as they stand; true numbers (n,) by name, NaN where none was written or a mark
    stands; `merged`: whether a mark may run into a number in columns of fixed width, where nothing parts them."""

    text: str
    names: tuple[str, ...]
    columns: dict[str, np.ndarray]
    merged: bool
    described: str


def log_with_texts(seed: int) -> Written:
    """The log of a seed."""
    rng = np.random.default_rng(seed)

    def one(choices):
        return choices[int(rng.integers(len(choices)))]

    separator, pattern, n = one(SEPARATORS), one(PATTERNS), int(rng.integers(60, 160))
    comma = separator != "," and one((True, False))
    blanks = separator in (" ", "fixed")
    row = np.arange(n)
    filled = _filled(pattern, row, rng) if not blanks else {"a": row >= 0, "b": row >= 0}
    turn = rng.uniform(0, 6)
    truth = {
        "t": STEP * row,
        "a": np.where(filled["a"], 75 + 50 * np.sin(row / 9 + turn), np.nan),
        "b": np.where(filled["b"], 75 + 50 * np.cos(row / 7), np.nan),
        "x": 40 * np.sin(row / 9 - 0.4) + rng.normal(0, 0.01, n),
    }
    digits = {"t": 3, "a": int(rng.integers(2, 5)), "b": 3, "x": int(rng.integers(2, 5))}
    texts = {name: [_number(v, digits[name]) for v in values] for name, values in truth.items()}
    columns = {name: np.array([float(c) if c else np.nan for c in cells]) for name, cells in texts.items()}
    mark = one(MARKS) if one((True, False)) else ""
    for name in ("a", "b", "x") if mark else ():
        k = int(one(np.flatnonzero(np.isfinite(columns[name])).tolist()[2:-2]))
        texts[name][k], columns[name][k] = mark, np.nan
    band = one(RANGES) if separator != "fixed" and one((True, False)) else ""
    ranged = one((True, False))
    if band:
        changes = one((True, False))
        texts["band"] = [one(RANGES) if changes and k > 1 else band for k in range(n)]
    order = ["t", *rng.permutation([name for name in texts if name != "t"]).tolist()]
    names = {name: f"{name}_{one(RANGES)}kHz" if ranged and name == "x" else name for name in order}
    named = {names[name]: columns[name] for name in columns}
    rows = _rows([texts[name] for name in order], separator, comma, one((0, 0, 1)))
    shown = [f"{names[name]}({UNITS[name]})" if name in UNITS else name for name in order]
    head = (" " if blanks else separator).join(shown)
    remarks = [one(REMARKS).format(one(RANGES), one(RANGES)) for _ in range(int(rng.integers(0, 3)))]
    content = "\n".join([*remarks, head, *rows]) + "\n"
    described = f"{seed}: {separator!r} {pattern} comma {comma} mark {mark!r} band {band!r} names {head!r} {remarks}"
    return Written(content, tuple(shown), named, separator == "fixed" and bool(mark), described)


def _filled(pattern: str, row: np.ndarray, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """The rows in which each drive is written."""
    every = int(rng.integers(2, 5))
    a, b = {
        "all": (row >= 0, row >= 0),
        "in turn": (row % 2 == 0, row % 2 == 1),
        "slow": (row % every == 0, row % every == 0),
        "apart": (row % every == 0, row % every == 1),
        "one slow": (row >= 0, row % every == 0),
        "nested": (row % 2 == 0, row % 4 == 0),
        "some": (rng.random(len(row)) > 0.1, rng.random(len(row)) > 0.1),
    }[pattern]
    return {"a": a, "b": b}


def _number(value: float, digits: int) -> str:
    text = "" if np.isnan(value) else f"{value:.{digits}f}"
    return text.removeprefix("-") if text and float(text) == 0 else text


def _rows(columns: list[list[str]], separator: str, comma: bool, padded: int) -> list[str]:
    """Rows of cells; in fixed columns as wide as the widest cell of each, so that nothing but a sign parts some of them."""
    if comma:
        columns = [[c.replace(".", ",") if _is_plain(c) else c for c in cells] for cells in columns]
    if separator == "fixed":
        widths = [max(map(len, cells)) for cells in columns]
        widths[1:] = [
            w + (not any(cell.startswith("-") and len(cell) == w for cell in cells) or padded)
            for w, cells in zip(widths[1:], columns[1:], strict=True)
        ]
        narrow = zip(*columns, strict=True)
        return ["".join(cell.rjust(w) for cell, w in zip(row, widths, strict=True)) for row in narrow]
    between = f" {separator} " if padded and separator != " " else separator
    return [between.join(row) for row in zip(*columns, strict=True)]


def _is_plain(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
