"""Two result files side by side: the same rows in both, and the numbers that differ before those that do not."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

ROUNDING = 1e-9  # relative: two runs of the same inputs on other processors differ by less
LONG = 8  # numbers in a list that are rows of their own; of longer lists how many, their rms and the largest
DEEPEST = 16  # tables in tables: those of our files are six deep
MOST_ROWS = 4000  # of a page: a diagnosis has some 600
UNMATCHED = {"schema_version", "program", "inputs", "sentence"}  # told beside the table, not in it
# Keys of our files by what a reader asks first; others follow in the order of the file, folded
FIRST = (
    "verdict",
    "passed",
    "findings",
    "attribution",
    "held_out",
    "empirical_terms",
    "spikes",
    "tracking_error",
    "error_between_samples",
    "margins",
    "expected",
    "groups",
    "contributors",
    "limits",
    "times",
    "bindings",
    "runs",
    "constants",
    "channels",
    "actuators",
    "budget",
    "anywhere",
    "largest_ball",
    "done",
    "failed",
    "verdicts",
    "c",
)
CHANNEL = re.compile(r"^(?P<name>.*) \[(?P<unit>[^\]]+)\]$")


class _Nothing:
    """What a result does not have."""


NOTHING = _Nothing()


@dataclass(frozen=True)
class ComparedRow:
    """One row: `path` names it, with the unit of each table that states one; `a` and `b` are what the two results hold (None: nothing).

    `difference` is |b - a| as a share of the larger of both: 0 where they agree to rounding, infinite where they are texts that
    differ, have other units, or one of them is missing.
    """

    path: tuple[str, ...]
    a: str | float | None
    b: str | float | None
    same_unit: bool
    difference: float

    @property
    def is_number(self) -> bool:
        """Whether both are numbers of the same unit."""
        return isinstance(self.a, float) and isinstance(self.b, float) and self.same_unit


@dataclass(frozen=True)
class ComparedPart:
    """The rows of one key of the files: those that differ by the most first, then those that `agree`; `main`: it is asked for first."""

    name: str
    main: bool
    differ: tuple[ComparedRow, ...]
    agree: tuple[ComparedRow, ...]


def compared(a: dict[str, Any], b: dict[str, Any]) -> tuple[tuple[ComparedPart, ...], int]:
    """The parts of two results, what matters first, and those with a difference before others; how many rows were left out."""
    parts: dict[str, list[ComparedRow]] = {}
    count = 0
    for row in _rows(a, b, ()):
        if row.path and row.path[0] not in UNMATCHED:
            count += 1
            if count <= MOST_ROWS:
                parts.setdefault(row.path[0], []).append(row)
    made = [
        ComparedPart(
            name,
            name in FIRST,
            tuple(sorted((r for r in rows if r.difference), key=_first)),
            tuple(r for r in rows if not r.difference),
        )
        for name, rows in parts.items()
    ]
    place = {name: k for k, name in enumerate(FIRST)}
    return tuple(sorted(made, key=lambda part: (not part.differ, place.get(part.name, len(FIRST))))), max(
        0, count - MOST_ROWS
    )


def _first(row: ComparedRow) -> tuple[bool, float]:
    """Numbers first, by their difference; then texts and what is missing in one of both, as they stand in the file."""
    return not row.is_number, -row.difference if row.is_number else 0.0


def _rows(a: Any, b: Any, path: tuple[str, ...], same_unit: bool = True) -> Iterator[ComparedRow]:
    """The rows of what stands at `path` in both."""
    if len(path) < DEEPEST and _are(dict, a, b):
        units = [_unit(table, "unit") for table in (a, b)]
        if path and any(units):
            path, same_unit = (*path[:-1], path[-1] + _bracket(*units)), same_unit and _alike(*units)
        left, right = _by_channel(a), _by_channel(b)
        for key in dict.fromkeys([*left, *right]):
            if key != "unit" and not key.endswith("_unit"):
                (value_a, unit_a), (value_b, unit_b) = (side.get(key, (NOTHING, "")) for side in (left, right))
                same = same_unit and _alike(unit_a, unit_b)
                yield from _rows(value_a, value_b, (*path, key + _bracket(unit_a, unit_b)), same)
    elif len(path) < DEEPEST and _are(list, a, b):
        if isinstance(a, list) and isinstance(b, list) and max(len(a), len(b)) > LONG and all(map(_is_number, a + b)):
            yield from _rows(_summary(a), _summary(b), path, same_unit)
            return
        left, right = _by_name(a, b, path)
        for key in dict.fromkeys([*left, *right]):
            yield from _rows(left.get(key, NOTHING), right.get(key, NOTHING), (*path, key), same_unit)
    else:
        yield _row(path, _leaf(a), _leaf(b), same_unit)


def _bracket(a: str, b: str) -> str:
    """The unit behind a name, both where they differ; nothing without one."""
    units = [unit for unit in dict.fromkeys((a, b)) if unit]
    return f" [{' | '.join(units)}]" if units else ""


def _alike(a: str, b: str) -> bool:
    """Whether numbers of these units can be compared: an entry that only one result has states no unit in the other."""
    return a == b or not a or not b


def _are(kind: type, a: Any, b: Any) -> bool:
    """Whether both are of a kind, or one is and the other is not there."""
    there = [value for value in (a, b) if not isinstance(value, _Nothing)]
    return bool(there) and all(isinstance(value, kind) for value in there)


def _unit(table: Any, key: str) -> str:
    """The unit that a table states of its numbers; '' without one."""
    unit = table.get(key) if isinstance(table, dict) else None
    return unit if isinstance(unit, str) and unit != "1" else ""


def _by_channel(table: Any) -> dict[str, tuple[Any, str]]:
    """The entries of a table and their units: 'delta_z [um]' is delta_z, in um; margin is in what margin_unit says."""
    found: dict[str, tuple[Any, str]] = {}
    for key, value in table.items() if isinstance(table, dict) else ():
        match = CHANNEL.match(key)
        found[match["name"] if match else key] = (value, match["unit"] if match else _unit(table, f"{key}_unit"))
    return found


def _by_name(a: Any, b: Any, path: tuple[str, ...]) -> tuple[dict[str, Any], dict[str, Any]]:
    """The entries of two lists by what tells them apart: their texts, as few as are needed, else their number in the list."""
    lists = [value if isinstance(value, list) else [] for value in (a, b)]
    entries = lists[0] + lists[1]
    if entries and all(isinstance(entry, dict) for entry in entries):
        texts = [
            key
            for key in entries[0]
            if all(isinstance(e.get(key), str | None) for e in entries) and isinstance(entries[0][key], str)
        ]
        for n in range(1, len(texts) + 1):
            named = [[" · ".join(str(e[k]) for k in texts[:n] if e.get(k)) for e in entries] for entries in lists]
            if all(len(set(names)) == len(names) for names in named):
                return tuple(
                    dict(zip(names, entries, strict=True)) for names, entries in zip(named, lists, strict=True)
                )  # type: ignore[return-value]
    numbered = (
        ("low", "high") if path[-1].startswith("ci") else tuple(str(k) for k in range(1, 1 + max(map(len, lists))))
    )
    return tuple(dict(zip(numbered, entries, strict=False)) for entries in lists)  # type: ignore[return-value]


def _is_number(value: Any) -> bool:
    return value is None or (isinstance(value, int | float) and not isinstance(value, bool))


def _summary(values: list[Any]) -> dict[str, Any]:
    known = [float(v) for v in values if v is not None and math.isfinite(v)]
    rms = math.hypot(*known) / math.sqrt(len(known)) if known else None
    return {
        "numbers": len(values),
        "rms": rms,
        "smallest": min(known, default=None),
        "largest": max(known, default=None),
    }


def _leaf(value: Any) -> str | float | None:
    """What a row shows of a value."""
    if isinstance(value, _Nothing):
        return None
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int | float):
        try:
            return float(value)
        except OverflowError:
            return str(value)[:40]
    if value is None:
        return "none"
    return ("none" if not value else "…") if isinstance(value, dict | list) else str(value)


def _row(path: tuple[str, ...], a: str | float | None, b: str | float | None, same_unit: bool) -> ComparedRow:
    if isinstance(a, float) and isinstance(b, float) and same_unit and math.isfinite(a) and math.isfinite(b):
        size = max(abs(a), abs(b))
        difference = abs(b - a) / size if size else 0.0
        difference = difference if difference > ROUNDING else 0.0
    else:
        difference = 0.0 if a == b and (same_unit or isinstance(a, str)) else math.inf
    return ComparedRow(path, a, b, same_unit, difference)
