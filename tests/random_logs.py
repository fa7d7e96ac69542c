"""Random logs as loggers write them: encoding, separator, decimal mark, header, units, time and marks for none in any combination.

What stands in a file is put together here letter by letter; nothing of the reader is used. The truth is the decimal text that was
written, as Python reads it.
"""

from __future__ import annotations

import datetime
from dataclasses import dataclass, field

import numpy as np

ENCODINGS = ("utf-8", "utf-8", "utf-8-sig", "utf-16", "latin-1", "cp1252")
ENDS = ("\n", "\n", "\r\n", "\r")
SEPARATORS = (",", ";", "\t", " ", "|")
UNIT_PLACES = ("none", "row", "bracket row", "parentheses", "brackets", "slash")
TIMES = ("s", "ms", "iso", "iso blank", "iso zone", "iso comma", "epoch ms", "epoch s", "date", "day")
SENTINELS = ("none", "none", "empty", "9.9E37", "1e30", "OVERLOAD", "---", "-9999", "3.4028235e38", "FAULT7")
HEADERS = ("none", "none", "lines", "pairs", "hash", "words")
BEGIN = datetime.datetime(2024, 3, 12, 23, 59, 59)


@dataclass(frozen=True)
class Log:
    """A written log: its bytes; names and true numbers of its columns; the unit that time is given in; the answers to what may be asked."""

    content: bytes
    columns: dict[str | int, np.ndarray]
    time: str | int
    time_unit: str
    described: str
    may_ask: bool
    answers: dict[str, object] = field(default_factory=dict)


def number(value: float, digits: int, decimal: str, thousands: str) -> str:
    """A number as text."""
    whole, _, fraction = f"{abs(value):.{digits}f}".partition(".")
    if thousands and len(whole) > 3:
        first = len(whole) % 3 or 3
        whole = thousands.join([whole[:first], *(whole[k : k + 3] for k in range(first, len(whole), 3))])
    sign = "-" if value < 0 and float(f"{value:.{digits}f}") != 0 else ""
    return sign + whole + (decimal + fraction if digits else "")


def time_cell(kind: str, k: int, decimal: str, step_ms: int) -> tuple[str, float]:
    """The text of row `k`'s time, and the true seconds since the first."""
    ms = k * step_ms
    at = BEGIN + datetime.timedelta(milliseconds=ms)
    since = int((at - datetime.datetime(1970, 1, 1)).total_seconds()) * 1000 + at.microsecond // 1000
    fraction = f"{at.microsecond // 1000:03d}"
    texts = {
        "s": number(ms / 1000, 4, decimal, ""),
        "ms": str(ms),
        "iso": f"{at:%Y-%m-%dT%H:%M:%S}.{fraction}",
        "iso blank": f"{at:%Y-%m-%d %H:%M:%S}.{fraction}",
        "iso zone": f"{at:%Y-%m-%dT%H:%M:%S}.{fraction}+02:00",
        "iso comma": f"{at:%Y-%m-%d %H:%M:%S},{fraction}",
        "epoch ms": str(since),
        "epoch s": number(since / 1000, 3, decimal, ""),
        "date": f"{at:%d.%m.%Y %H:%M:%S}.{fraction}",
        "day": f"{at:%H:%M:%S}.{fraction}",
    }
    return texts[kind], ms / 1000


def random_log(seed: int) -> Log:
    """The log of a seed."""
    rng = np.random.default_rng(seed)

    def one(choices):
        return choices[int(rng.integers(len(choices)))]

    encoding, end, separator, decimal = one(ENCODINGS), one(ENDS), one(SEPARATORS), one(".,")
    kind, place, sentinel, header = one(TIMES), one(UNIT_PLACES), one(SENTINELS), one(HEADERS)
    thousands = one(("", "", "", {".": ",", ",": "."}[decimal], "'"))
    if thousands == separator or (separator == " " and kind == "date"):
        thousands, kind = "", "iso"
    if separator == "," and kind == "iso comma":
        kind = "iso blank"
    named, text_column = header == "hash" or bool(rng.integers(4)), bool(rng.integers(4) == 0) and separator != " "
    step, n, digits, size = (
        one((1, 2, 10, 250)),
        int(rng.integers(20, 60)),
        int(rng.integers(2, 6)),
        one((1.0, 30.0, 5000.0)),
    )
    time_unit = {"ms": "ms", "epoch ms": "ms"}.get(kind, "s")
    rows, truth = [], {"t": [], "u": [], "x": []}
    marks = set() if sentinel == "none" else set(rng.choice(np.arange(2, n - 2), 3, replace=False).tolist())
    for k in range(n):
        t, seconds = time_cell(kind, k, decimal, step)
        u, x = float(np.sin(0.4 * k)), float(size * np.cos(0.3 * k + 0.1) + 0.01 * rng.standard_normal())
        u_text, x_text = number(u, 4, decimal, thousands), number(x, digits, decimal, thousands)
        truth["t"].append(seconds)
        truth["u"].append(float(number(u, 4, ".", "")))
        truth["x"].append(np.nan if k in marks else float(number(x, digits, ".", "")))
        if k in marks:
            x_text = {"empty": '""' if separator == " " else ""}.get(sentinel, sentinel.replace(".", decimal))
        rows.append([t, u_text, x_text, *(["run"] if text_column else [])])
    quoted = decimal == separator or (separator == "," and thousands == ",")
    lines = [*_head(header, place, named, separator, text_column, time_unit, kind)]
    for row in rows:
        cells = [f'"{c}"' if separator in c or (quoted and separator == ",") else c for c in row]
        lines.append(separator.join(cells))
    text = end.join(lines) + end * int(rng.integers(0, 3))
    names = {"t": "time", "u": "drive", "x": "Weg µ"}
    columns = {names[key] if named else k: np.array(values) for k, (key, values) in enumerate(truth.items())}
    if separator == " ":
        columns = {str(key).replace("Weg µ", "Weg_µ") if named else key: value for key, value in columns.items()}
    described = f"{seed}: {encoding} {end!r} {separator!r} decimal {decimal!r} thousands {thousands!r} {kind} {place} {sentinel} {header}"
    word = {"tab": "\t", "blank": " "}
    answers = {
        "separator": next((w for w, s in word.items() if s == separator), separator),
        "decimal": decimal,
        "thousands": thousands,
    }
    answers |= {"missing": (sentinel,)} if sentinel in ("FAULT7", "-9999") else {}
    may_ask = (
        sentinel == "FAULT7"
        or (sentinel == "-9999" and size == 5000.0)
        or bool(thousands)
        or digits == 3
        or separator == decimal
    )
    return Log(text.encode(encoding), columns, "time" if named else 0, time_unit, described, may_ask, answers)


def _head(
    header: str, place: str, named: bool, separator: str, text_column: bool, time_unit: str, kind: str
) -> list[str]:
    """The lines above the rows."""
    above = {
        "none": [],
        "hash": [],
        "words": ["Interferometer run of a stage", ""],
        "lines": ["Instrument: interferometer", "Operator: A. B.", "Temperature: 21.5 degC", ""],
        "pairs": [f"Model{separator}X7", f"Record Length{separator}2000", f"Sample Interval{separator}0.001", ""],
    }[header]
    names, units = ["time", "drive", "Weg µ" if separator != " " else "Weg_µ"], [time_unit, "V", "µm"]
    if kind not in ("s", "ms", "epoch ms", "epoch s"):
        units[0] = ""
    behind = {"parentheses": " ({})", "brackets": " [{}]", "slash": " / {}"}.get(place)
    if separator == " ":
        behind = {"parentheses": "({})", "brackets": "[{}]"}.get(place)
    if behind:
        names = [name + behind.format(unit) if unit else name for name, unit in zip(names, units, strict=True)]
    extra = ["state"] if text_column else []
    lines = [("# " if header == "hash" else "") + separator.join([*names, *extra])] if named else []
    if named and place in ("row", "bracket row") and header != "hash":
        shown = [f"[{u}]" if place == "bracket row" else u or "-" for u in units]
        lines.append(separator.join([*shown, *("-" for _ in extra)]))
    return [*above, *lines]


DAMAGES = ("no cell", "junk line", "header again", "no end", "quote", "blank lines", "odd cell", "two cells", "remark")
ODD = ("12:30", "0x1F", "1_000", "1,2,3", "#REF!", "1.2.3.4", "--5", "1e", "5V", "=A1", "1.000.00")


def damaged(log: Log, seed: int) -> tuple[Log, str]:
    """The log with one row or line spoilt, and how; its truth is that of the whole one, with NaN where a number was spoilt."""
    rng = np.random.default_rng(1000 + seed)
    encoding = log.described.split(" ")[1]
    text = log.content.decode(encoding)
    end = next(e for e in ("\r\n", "\n", "\r") if e in text)
    lines = text.rstrip(end).split(end)
    n = len(next(iter(log.columns.values())))
    k = int(rng.integers(n // 2, n - 2))  # a row in the second half
    at = len(lines) - n + k
    separator = {"tab": "\t", "blank": " "}.get(str(log.answers["separator"]), str(log.answers["separator"]))
    cells, how = lines[at].split(separator), DAMAGES[int(rng.integers(len(DAMAGES)))]
    columns = {name: values.copy() for name, values in log.columns.items()}
    last = list(columns)[-1]
    if how == "no cell":
        lines[at] = separator.join(cells[:1] + cells[2:])
    elif how == "two cells":
        lines[at] = separator.join([*cells[:2], "7", *cells[2:]])
    elif how == "odd cell":
        place = 2 if len(cells) in (3, 4) and '"' not in lines[at] else len(cells)
        if place < len(cells):
            cells[place] = ODD[int(rng.integers(len(ODD)))]
            columns[last][k] = np.nan
        lines[at] = separator.join(cells)
    elif how == "quote":
        lines[at] = '"' + lines[at]
    elif how in ("junk line", "header again", "blank lines", "remark"):
        junk = {
            "junk line": "*** trigger ***",
            "header again": lines[0] if isinstance(last, str) else "*",
            "blank lines": "",
            "remark": "# paused",
        }[how]
        lines.insert(at, junk)
    elif how == "no end":
        lines[-1] = separator.join(lines[-1].split(separator)[:2])
        columns = {name: values[:-1] for name, values in columns.items()}
    spoilt = end.join(lines)
    return Log(
        spoilt.encode(encoding),
        columns,
        log.time,
        log.time_unit,
        f"{log.described}, {how} in row {k}",
        True,
        log.answers,
    ), how
