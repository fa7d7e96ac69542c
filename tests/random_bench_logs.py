"""Random logs of the bench: how time, names, units, numbers, marks, remarks and pages are written, in any combination, beside what
is true.

Put together letter by letter; nothing of the reader is used.
"""

from __future__ import annotations

import datetime
from dataclasses import dataclass

import numpy as np

BEGIN = datetime.datetime(2024, 3, 5, 23, 59, 50)
TIMES = (
    "s",
    "ms",
    "us",
    "iso",
    "iso zone",
    "epoch ms",
    "date and clock",
    "clock",
    "MJD",
    "day",
    "GPS",
    "32 bits",
    "unpadded",
    "rate",
)
UNITS = ("round", "square", "stroke", "underscore", "comma", "in", "in front", "row", "column", "list", "none")
LENGTHS = {
    "um": 1e-6,
    "\u00b5m": 1e-6,
    "\u03bcm": 1e-6,
    "micron": 1e-6,
    "\u00c2\u00b5m": 1e-6,
    "nm": 1e-9,
    "mm": 1e-3,
    "UM": 1e-6,
}
MARKS = ("", "", "NoValue", "+FFFFF", "1.#QNB", "9.9E37", "-32768", "2147483.647", "OL", "****")
CELLS = ("{}", "{}", "{}", "np.float64({})", '="{}"', "'{}", "{}f")
REMARKS = ("", "", "# ", "% ", "REM ", "* ", "// ")
OTHERS = {"set point": "um", "following error": "um", "temperature": "degC", "index": "", "x valid": "", "status": ""}


@dataclass(frozen=True)
class Drawn:
    """A log, and what is true of it: time [s], drive [V], reading [m], NaN where a mark stands; `told`: words that must stand in what is
    told; `described`: what was drawn."""

    text: str
    t: np.ndarray
    u: np.ndarray
    x: np.ndarray
    told: tuple[str, ...]
    described: str


def _time(kind: str, seconds: float) -> list[str]:
    """The cells of one row's time."""
    at = BEGIN + datetime.timedelta(seconds=seconds)
    fraction = f"{at.microsecond // 1000:03d}"
    ms = round(1000 * seconds)
    return {
        "s": [f"{seconds:.4f}"], "ms": [f"{ms}"], "us": [f"{1000 * ms}"],
        "iso": [f"{at:%Y-%m-%dT%H:%M:%S}.{fraction}"], "iso zone": [f"{at:%Y-%m-%dT%H:%M:%S}.{fraction}+01:00"],
        "epoch ms": [f"{1709683190000 + ms}"], "date and clock": [f"{at:%Y-%m-%d}", f"{at:%H:%M:%S}.{fraction}"],
        "clock": [f"{at:%H:%M:%S}.{fraction}"], "MJD": [f"{60374 + 86390 / 86400 + seconds / 86400:.12f}"],
        "day": [f"{0.25 + seconds / 86400:.12f}"], "GPS": [f"{(604799.9 + seconds) % 604800:.3f}"],
        "32 bits": [f"{(4294900000 + 1000 * ms) % 2**32}"], "unpadded": [f"{at:%H:%M:%S}.{at.microsecond // 1000}"], "rate": [],
    }[kind]  # fmt: skip


def _named(name: str, unit: str, style: str) -> str:
    """A name with its unit."""
    if not unit or style in ("row", "column", "none"):
        return name
    return {
        "round": f"{name} ({unit})", "square": f"{name} [{unit}]", "stroke": f"{name} / {unit}", "underscore": f"{name}_{unit}",
        "comma": f"{name}, {unit}", "in": f"{name} in {unit}", "in front": f"[{unit}] {name}", "list": f"{name} [{unit}]",
    }[style]  # fmt: skip


def drawn(seed: int) -> Drawn:
    """The log of a seed."""
    rng = np.random.default_rng(seed)

    def one(choices):
        return choices[int(rng.integers(len(choices)))]

    kind, style, length, mark, shape, remark = (one(c) for c in (TIMES, UNITS, tuple(LENGTHS), MARKS, CELLS, REMARKS))
    separator = one(";\t" if style == "comma" else ",;\t")
    decimal = one(".,") if separator != "," and shape == "{}" else "."
    n, step, page = int(rng.integers(60, 140)), one((1e-3, 2e-3, 0.01, 0.02)), one((0, 0, 0, 25))
    row = np.arange(n)
    pause = 3 * 86400.0 if kind == "date and clock" and one((True, False)) else 0.0
    t = np.round(step * row + np.where(row >= n // 2, pause, 0.0), 6)
    u = np.round(np.sin(2 * np.pi * row / 37 + rng.uniform(0, 6)) + 0.3 * np.sin(2 * np.pi * row / 11), 4)
    size = LENGTHS[length]
    digits = 1 if size == 1e-9 else 7 if size == 1e-3 else 4
    x = np.round(50e-6 * u / size + (2e-6 / size) * np.sin(row / 5), digits)
    x_true = size * x
    x_cells = [shape.format(f"{v:.{digits}f}").replace(".", decimal if shape == "{}" else ".") for v in x]
    mark = "9.9E37" if mark == "-32768" and size == 1e-9 else mark  # a reading as any other
    if mark:
        k = int(rng.integers(5, n - 5))
        x_cells[k], x_true = (
            mark.replace(".", decimal) if mark[:1].isdigit() and "#" not in mark else mark,
            np.where(row == k, np.nan, x_true),
        )
    others = [name for name in OTHERS if rng.random() < 0.25]
    flagged = int(rng.integers(5, n - 5))
    columns = {"drive": [f"{v:.4f}".replace(".", decimal) for v in u], "position": x_cells}
    beside = {
        "set point": np.round(1.01 * x, digits), "following error": np.round(0.01 * x, 4), "index": row,
        "x valid": (row != flagged).astype(int), "temperature": np.round(21 + 0.01 * np.sin(row / 20), 3),
    }  # fmt: skip
    for name in others:
        numbers = [f"{v:.9g}".replace(".", decimal) for v in beside.get(name, row)]
        columns[name] = ["OK" if k != flagged else "LOST" for k in row] if name == "status" else numbers
    units = {
        "drive": "V",
        "position": length,
        **{name: OTHERS[name] if OTHERS[name] != "um" else length for name in others},
    }
    order = list(rng.permutation(list(columns)).tolist())
    time_unit = kind if kind in ("s", "ms", "us") else {"GPS": "s", "32 bits": "us"}.get(kind, "")
    times = {"date and clock": ["Date", "Time"], "rate": []}.get(kind, ["Time"])
    names = [*times, *order]
    of = [*([time_unit] if len(times) == 1 else [""] * len(times)), *(units[name] for name in order)]
    shown = [_named(name, unit, style) for name, unit in zip(names, of, strict=True)]
    cells = [[*_time(kind, t[k]), *(columns[name][k] for name in order)] for k in range(n)]
    if kind in ("s", "GPS", "MJD", "day"):
        for line in cells:
            line[0] = line[0].replace(".", decimal)
    if style == "column":
        at = names.index("position") + 1
        shown.insert(at, one(("unit", "position unit")))
        for line in cells:
            line.insert(at, length)
    head = [separator.join(shown)] if style != "list" else [f"Column {k}: {name}" for k, name in enumerate(shown, 1)]
    above = [remark + line for line in ["stage log of the bench", *head]] if remark else head
    above += [separator.join(unit or "-" for unit in of)] if style == "row" else []
    rate = [f"Sample rate: {1 / step:g} Hz"] if kind == "rate" else []
    body = [separator.join(line) for line in cells]
    if page and style not in ("list", "row") and not remark:
        body = [
            line
            for k, text in enumerate(body)
            for line in ([f"Page {k // page + 1}", *head, text] if k and k % page == 0 else [text])
        ]
    told = ("x valid",) * ("x valid" in others) + ("status",) * ("status" in others)
    described = f"{seed}: {kind}, {style}, {length}, mark {mark!r}, {shape}, {remark!r}, {separator!r}, {decimal!r}, {page}, {others}"
    return Drawn("\n".join([*rate, *above, *body]) + "\n", t, u, x_true, told, described)
