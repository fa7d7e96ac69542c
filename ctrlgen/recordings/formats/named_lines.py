"""Lines that name each of their numbers, as programs log them: 10:00:00,123 INFO u=3.4 x=1.2. A column a name, a row a line."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.recordings.formats.checked_files import fault
from ctrlgen.recordings.formats.measurement_table import MeasurementTable
from ctrlgen.recordings.formats.number_cells import DATE, ZONES
from ctrlgen.recordings.formats.text_cells import is_comment
from ctrlgen.recordings.formats.unit_texts import unit_of
from ctrlgen.recordings.formats.written_layout import Layout

FEWEST = 3
"""Lines with the same names, from which they are rows and no entries of a header."""
SHOWN = 3  # kinds of lines that a refusal lists
LONGEST_SHOWN = 60  # characters of each
NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|[+-]?(?:nan|inf|null|None)"
STAMP = (
    rf"(?:(?:{DATE})[T ]\s*)?\d{{1,2}}:\d{{2}}:\d{{2}}(?:[.,]\d+)?(?:\s?(?:Z|{ZONES}|[+-]\d{{2}}:?\d{{2}}))?(?![\w:])"
)
NAMED = re.compile(
    rf"(?<![\w.\]/-])\"?(?P<name>[A-Za-z_][\w./-]*(?:\[\d+\])?)\"?\s*(?P<mark>=|:)\s*\"?"
    rf"(?:(?P<stamp>{STAMP})|(?P<number>{NUMBER})\s?(?P<unit>[^\W\d_]{{1,4}}(?:/s)?|%)?)\"?(?=[\s,;|}}\])>]|$)",
    re.ASCII | re.IGNORECASE,
)
"""One number, or time, and its name."""
BEFORE = re.compile(rf"^[\s(\[]*(?P<stamp>{STAMP}|\d{{9,19}}(?:\.\d+)?|\d+\.\d{{3,}})(?=[\s)\],;:|]|$)", re.ASCII)
SYSLOG = re.compile(
    r"^(?:<\d+>)?(?P<month>[A-Z][a-z]{2}) +(?P<day>\d{1,2}) (?P<clock>\d\d:\d\d:\d\d(?:\.\d+)?)(?=\s)", re.ASCII
)
"""A date without its year, as syslog writes it."""
LEAP = 2000  # the year of a date without one, which may be 29 February; a time before and after New Year's Eve falls
MONTHS = {
    "Jan": 1, "Feb": 2, "Mar": 3, "Apr": 4, "May": 5, "Jun": 6, "Jul": 7, "Aug": 8, "Sep": 9, "Oct": 10, "Nov": 11, "Dec": 12,
}  # fmt: skip
SINCE_BOOT = re.compile(r"^\s*[EWIDV] \((?P<stamp>\d+)\)(?=\s)")
"""Of the ESP32 and its kin: milliseconds since it was switched on."""
BEHIND = re.compile(r"\s(?P<stamp>\d{10,19})\s*$", re.ASCII)  # of the line protocol of InfluxDB
DIGITS = re.compile(r"\d+(?:\.\d+)?")


class _Line(NamedTuple):
    """One line: its number from 0, what it names with texts of numbers and units, its time, and what is left of it."""

    place: int
    cells: dict[str, tuple[str, str]]
    stamp: str
    rest: str
    twice: bool


def are_named(lines: Sequence[str]) -> bool:
    """Whether most lines of a text name their numbers, many of them the same ones."""
    filled = [line for line in lines if line.strip() and not is_comment(line)]
    if sum("=" in line or ":" in line for line in filled) <= len(filled) / 2:
        return False
    kinds = [frozenset(m["name"] for m in NAMED.finditer(line)) for line in filled]
    named = Counter(kind for kind in kinds if kind)
    if not named or named.most_common(1)[0][1] < FEWEST or sum(named.values()) <= len(filled) / 2:
        return False
    marked = any("=" in line for line in filled) or max(map(len, named)) > 1  # `key: 5` is an entry of YAML
    return marked and named.most_common(1)[0][1] * max(len(named), 2) >= sum(named.values())


def named_table(path: Path, lines: Sequence[str], notes: Sequence[str], layout: Layout) -> MeasurementTable | None:
    """The table of such lines; None for another text.

    Raises InputError where lines of several sources name the same numbers, or one names a number twice: rows would be mixed.
    """
    if not are_named(lines):
        return None
    parsed = [_parsed(k, line) for k, line in enumerate(lines) if line.strip() and not is_comment(line)]
    rows = [line for line in parsed if line.cells]
    if twice := next((line for line in rows if line.twice), None):
        raise fault(path, f"names a number twice in line {twice.place + 1}; give each its own name")
    _check_one_source(path, rows)
    names = list(dict.fromkeys(name for line in rows for name in line.cells))
    columns, units = dict[str, np.ndarray](), dict[str, str]()
    if timed := sum(bool(line.stamp) for line in rows) == len(rows):
        when = "time" if "time" not in names else "time of line"
        columns[when] = np.array([r.stamp for r in rows], dtype=object)
        units |= {when: "ms"} if all(SINCE_BOOT.match(lines[r.place]) for r in rows) else {}
    for name in names:
        columns[name] = np.array([line.cells[name][0] if name in line.cells else None for line in rows], dtype=object)
        stated = {line.cells[name][1] for line in rows if name in line.cells}
        if len(stated) > 1:
            raise fault(path, f"writes {name} in several units ({', '.join(sorted(map(repr, stated)))}); write one")
        if unit := stated.pop():
            units[name] = unit
    told = f"each line names its numbers ({', '.join(names)}): read as columns"
    told += ", the time before them as 'time'" if timed and "time" not in names else ""
    left = len(parsed) - len(rows)
    said = (
        [f"{number_of(left, 'line names', 'lines name')} no number and {'is' if left == 1 else 'are'} left out"]
        if left
        else []
    )
    places = [line.place + 1 for line in rows]
    return MeasurementTable(path, columns, units, places, (*notes, told, *said), missing=layout.missing)


def _parsed(place: int, line: str) -> _Line:
    cells, twice, kept, last = dict[str, tuple[str, str]](), False, list[str](), 0
    logged = SYSLOG.match(line)
    logged = logged if logged is not None and logged["month"] in MONTHS else None
    before = BEFORE.match(line) or SINCE_BOOT.match(line) or logged
    for m in NAMED.finditer(line):
        unit = m["unit"] or ""
        if unit and unit_of(unit) is None:
            continue
        twice |= m["name"] in cells
        cells[m["name"]] = (m["stamp"] or m["number"], unit)
        kept.append(line[last : m.start()])
        last = m.end()
    behind = BEHIND.search(line, last) if before is None and cells else None
    kept.append(line[last : behind.start() if behind else None])
    rest = "".join(kept)[before.end() if before else 0 :]
    stamp = (
        f"{LEAP}-{MONTHS[logged['month']]:02d}-{int(logged['day']):02d}T{logged['clock']}"
        if logged is not None
        else (before or behind or {"stamp": ""})["stamp"]
    )
    return _Line(place, cells, stamp, " ".join(rest.split()), twice)


def _check_one_source(path: Path, rows: Sequence[_Line]) -> None:
    """Raises InputError where what stands beside the names differs from line to line: other sources, other states."""
    for names in dict.fromkeys(frozenset(line.cells) for line in rows):
        rests = [line.rest for line in rows if frozenset(line.cells) == names]
        plain = Counter(DIGITS.sub("0", rest) for rest in rests)
        counted = len(set(rests)) == len(rests)  # a number of the line, or its time
        if len(plain) > 1 or (len(set(rests)) > 1 and not counted):
            shown = [repr(rest[:LONGEST_SHOWN]) for rest in list(dict.fromkeys(rests))[:SHOWN]]
            what = f"names {', '.join(sorted(names))} in lines of several kinds ({', '.join(shown)})"
            raise fault(path, f"{what}; keep those of one kind: grep it into a file of its own")
