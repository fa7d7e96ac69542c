"""A recording.toml to begin with: which column is which signal of the device, by unit, name and range; what is certain and what is asked.

Signals and columns are matched by the assignment of the largest total likeness (H. W. Kuhn, Naval Research Logistics 2 (1955) 83).
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ctrlgen.core.escaping import toml
from ctrlgen.core.units import same_dimension, to_si
from ctrlgen.model.model import Model
from ctrlgen.recordings.alike_units import size_of
from ctrlgen.recordings.look.column_facts import ColumnFacts, TableFacts, between_samples, rests
from ctrlgen.recordings.look.oddities import fitting_units, implausible_range
from ctrlgen.recordings.moved import Stretch, moved_of
from ctrlgen.recordings.plausibility import implausible
from ctrlgen.recordings.schema import signal_units

# words of columns' names, in the languages of loggers; letters are whole words
DRIVE_WORDS = frozenset((
    "drive", "command", "commanded", "cmd", "com", "ref", "reference", "set", "setpoint", "sp", "target", "demand", "desired",
    "soll", "stell", "input", "in", "u", "v", "volt", "voltage", "voltages", "current", "i", "ampere", "power", "out", "output",
    "dac", "ao", "da", "ctrl", "control", "heater", "coil", "spannung", "strom", "force", "torque",
))  # fmt: skip
READING_WORDS = frozenset((
    "reading", "read", "position", "pos", "actual", "act", "ist", "fb", "feedback", "sensor", "measured", "meas", "mess",
    "measurement", "enc", "encoder", "cap", "capacitive", "adc", "ai", "ad", "displacement", "disp", "distance", "dist", "weg",
    "y", "response", "interferometer", "lvdt", "laser", "probe", "gauge",
))  # fmt: skip
MEANINGS = {
    "V": frozenset(("volt", "voltage", "voltages", "spannung")),
    "A": frozenset(("current", "ampere", "amps", "strom")),
    "N*m": frozenset(("torque", "moment", "drehmoment")),
    "N": frozenset(("force", "kraft", "load")),
    "W": frozenset(("power", "leistung", "heater")),
    "K": frozenset(("temperature", "temp", "temperatur")),
    "1/s": frozenset(("speed", "velocity", "vel", "rpm", "geschwindigkeit")),
    "1/s^2": frozenset(("acceleration", "accel", "acc")),
}
"""What words of a name say of the dimension; of a motion per second whatever moves."""
ALIKE = {
    "velocity": ("speed", "vel"),
    "acceleration": ("accel", "acc"),
    "position": ("pos", "angle"),
    "force": ("torque",),
}
"""Other words for channels."""
UNIT, CHANNEL, ROLE, OTHER_ROLE, PLACE, POSSIBLE = 3.0, 4.0, 2.0, -2.0, 0.1, 0.5
"""Likeness of a unit of the right dimension, the channel's name, a word of the role, one of the other role, the place in the file, and of
a column of which nothing speaks against it."""
NAMED = 1.0
"""Likeness from which more than the want of another column speaks for one."""
CLEAR = 1.0
"""How much more alike the chosen column must be than the next best that is free, to be certain."""
MOST_POSES = 500
"""Rows without a time that are taken for poses."""


@dataclass(frozen=True)
class Match:
    """`signal` is `column`, in `unit`; `stated` whether the file says the unit. `why`: what is not certain, empty where all is."""

    signal: str
    column: str
    unit: str
    stated: bool
    why: tuple[str, ...] = ()


@dataclass(frozen=True)
class Proposal:
    """A recording.toml for the files of `tables`: `matches` of all of them, `left` columns that no signal is, `missing`: what the files do
    not say and must be answered, `remarks`: what is odd."""

    model: Model
    tables: tuple[TableFacts, ...]
    matches: tuple[Match, ...]
    left: tuple[str, ...]
    missing: tuple[str, ...]
    remarks: tuple[str, ...]

    @property
    def kind(self) -> str:
        """Few rows without a time are poses."""
        return kind_of(self.tables[0])

    @property
    def asked(self) -> tuple[str, ...]:
        """Every question that the files leave open."""
        return (
            *(f"{m.signal} = column {m.column!r}: {'; '.join(m.why)}" for m in self.matches if m.why),
            *self.missing,
        )

    def drives_of(self, facts: TableFacts) -> list[np.ndarray]:
        """The columns of drives in one table."""
        names = {m.column for m in self.matches if m.signal.startswith("drive.")}
        return [c.values for c in facts.columns if c.name in names and c.values is not None]

    @property
    def between_samples(self) -> str:
        """What the drive does between samples, as TOML: of all files together, for they come from one bench. A drive that steps in one of
        them is held; curves do not tell."""
        ways = {between_samples(values) for facts in self.tables for values in self.drives_of(facts)}
        return '"linear" # assumed: every drive is a smooth curve' if ways == {"linear"} else '"held"'

    @property
    def certain(self) -> bool:
        """Whether it can be used as it stands."""
        return not self.asked


def kind_of(facts: TableFacts) -> str:
    """ "poses" or "series": few rows without a time are poses."""
    return "poses" if facts.time is None and facts.rows <= MOST_POSES else "series"


def propose(tables: Sequence[TableFacts], model: Model) -> Proposal:
    """The recording that files with the same columns are of a device. Its first file decides which column is what."""
    first = tables[0]
    taken = {first.time.column} if first.time is not None else set()
    columns = [c for c in first.columns if c.moves and c.name not in taken]
    signals = [name for name in signal_units(model) if name.partition(".")[0] in ("drive", "reading")]
    matches = _matched(model, signals, columns)
    found = {match.signal for match in matches}
    asked = [
        f"{name}: which column? Free are {', '.join(c.name for c in columns if c.name not in {m.column for m in matches}) or 'none'}"
        for name in signals
        if name.startswith("drive.") and name not in found
    ]
    if not any(name.startswith("reading.") for name in found):
        asked.append("no column was recognised as a reading")
    if first.time is None:
        asked.append('no column is a time: state sample_rate, or kind = "poses"')
    remarks = _remarks(model, first, matches, kind_of(first))
    left = tuple(c.name for c in columns if c.name not in {m.column for m in matches})
    return Proposal(model, tuple(tables), tuple(matches), left, tuple(asked), tuple(remarks))


def _remarks(model: Model, facts: TableFacts, matches: Sequence[Match], kind: str) -> list[str]:
    """What is not plausible: beside what the model makes of the drives, or where not every drive is known beside the device's size."""
    of = {role: [m for m in matches if m.signal.startswith(role)] for role in ("drive.", "reading.")}
    drives, readings = (tuple((m.signal, m.unit) for m in found) for found in of.values())
    u, y = (np.reshape([_si(facts, m) for m in found], (len(found), facts.rows)).T for found in of.values())
    step = facts.time.step if facts.time is not None else np.inf
    known = facts.time is not None or kind == "poses"
    linear = {between_samples(column) for column in u.T} == {"linear"}
    seen = moved_of(model, drives, readings, [Stretch(u, y, step, linear)]) if known and readings else None
    if seen is not None:
        return implausible(seen)
    values = ((m, facts.column(m.column).values) for m in matches)
    return [odd for m, v in values if v is not None and (odd := implausible_range(m.signal, v, m.unit, model))]


def _si(facts: TableFacts, match: Match) -> np.ndarray:
    values = facts.column(match.column).values
    assert values is not None  # only columns of numbers are matched
    return values * size_of(match.unit) + to_si(0.0, match.unit)


def _matched(model: Model, signals: Sequence[str], columns: Sequence[ColumnFacts]) -> list[Match]:
    """The best assignment of columns to signals; a column that is like none stays free."""
    from scipy.optimize import linear_sum_assignment  # a quarter of a second to import

    if not columns:
        return []
    likeness = np.array([[_likeness(model, name, column) for column in columns] for name in signals])
    likeness += PLACE * _in_order(signals, len(columns)) * (likeness > 0)
    rows, chosen = linear_sum_assignment(likeness, maximize=True)
    matches = []
    for i, k in zip(rows, chosen, strict=True):
        if likeness[i, k] < POSSIBLE:
            continue
        column, unit = columns[k], columns[k].unit or signal_units(model)[signals[i]]
        rivals = [
            columns[j].name for j in range(len(columns)) if j not in chosen and likeness[i, j] > likeness[i, k] - CLEAR
        ]
        why = [f"could be column {' or '.join(map(repr, rivals))} as well"] if rivals else []
        if likeness[i, k] < NAMED:
            why.append("nothing but its place speaks for it")
        if column.unit is None:
            unit = _plausible(model, signals[i], column, unit)
            why.append(f"the file states no unit, {unit} is assumed: {_range(column)}")
        matches.append(Match(signals[i], column.name, unit, column.unit is not None, tuple(why)))
    return matches


def _plausible(model: Model, signal: str, column: ColumnFacts, unit: str) -> str:
    """The unit of the signal, or the multiple of it with which the numbers are as large as the device."""
    assert column.values is not None  # it moves
    return next(iter(fitting_units(signal, column.values, unit, model)), unit)


def _range(column: ColumnFacts) -> str:
    return f"{column.finite.min():.4g} to {column.finite.max():.4g}"


def _in_order(signals: Sequence[str], columns: int) -> np.ndarray:
    """Drives usually stand before readings, both in the order of the device: 1 on that diagonal, less beside it."""
    i, k = np.arange(len(signals))[:, None], np.arange(columns)[None]
    return 1.0 / (1.0 + np.abs(i - k))


def _likeness(model: Model, signal: str, column: ColumnFacts) -> float:
    """How much a column speaks for being a signal; 0 for one of another dimension."""
    role, _, channel = signal.partition(".")
    unit = signal_units(model)[signal]
    if column.unit is not None and not same_dimension(column.unit, unit):
        return 0.0
    words = set(re.findall(r"[a-z]+|\d+[a-z]*", column.bare.lower()))
    if any(words & meaning and not _may_be(of, unit) for of, meaning in MEANINGS.items()):
        return 0.0
    score = UNIT if column.unit is not None else POSSIBLE
    score += CHANNEL if _names(channel, column.bare, model, role) else 0.0
    own, other = (DRIVE_WORDS, READING_WORDS) if role == "drive" else (READING_WORDS, DRIVE_WORDS)
    score += ROLE * bool(words & own) + OTHER_ROLE * bool(words & other)
    if role == "drive" and column.unit is not None and not _within(model, channel, column):
        score += OTHER_ROLE
    return max(score, 0.0)


def _names(channel: str, name: str, model: Model, role: str) -> bool:
    """Whether a column's name holds the channel's: whole, or its last part where no other channel ends so."""
    plain = name.lower()
    wanted = (channel.lower(), *ALIKE.get(channel, ()))
    if any(re.search(rf"(?<![a-z0-9]){re.escape(word)}(?![a-z0-9])", plain) for word in wanted):
        return True
    last = channel.lower().rpartition("_")[2]
    alike = [c for c in model.signals[role].channels if c.lower().rpartition("_")[2] == last]
    return (
        len(alike) == 1
        and last != channel.lower()
        and bool(re.search(rf"(?<![a-z0-9]){re.escape(last)}(?![a-z0-9])", plain))
    )


def _may_be(meaning: str, unit: str) -> bool:
    """Whether a signal in `unit` can be what a word means."""
    if meaning.startswith("1/s"):
        return any(same_dimension(unit, meaning.replace("1", base, 1)) for base in ("m", "rad"))
    return same_dimension(unit, meaning)


def _within(model: Model, channel: str, column: ColumnFacts) -> bool:
    """Whether the numbers can be drives: within the bounds, and their rounding."""
    i = model.signals["drive"].channels.index(channel)
    low, high = model.u_bounds[0][i], model.u_bounds[1][i]
    scale, offset = to_si(1.0, column.unit or "1") - to_si(0.0, column.unit or "1"), to_si(0.0, column.unit or "1")
    values, room = column.finite * scale + offset, 1e-3 * (high - low)
    return not np.isfinite(room) or bool(values.min() >= low - room and values.max() <= high + room)


def recording_toml(proposal: Proposal, folder: Path, title: str) -> str:
    """The text of a recording.toml in `folder`, with comments where something is assumed."""
    lines = [
        "# Begun by ctrlgen look. Lines that end in a comment hold what the files do not say: correct what is wrong.",
        f"title  = {toml(title)}",
        f"device = {toml(proposal.model.device.name)}",
        f'kind   = "{proposal.kind}"' + ("" if proposal.tables[0].time else " # assumed: no column is a time"),
        "",
    ]
    several = len(proposal.tables) > 1
    for k, facts in enumerate(proposal.tables):
        last = several and k == len(proposal.tables) - 1
        lines += _record(proposal, facts, folder, "hold_out" if last else "fit")
    lines.append("[columns]")
    for match in proposal.matches:
        why = f" # {'; '.join(match.why)}" if match.why else ""
        lines.append(f'"{match.signal}" = {{ column = {toml(match.column)}, unit = "{match.unit}" }}{why}')
    lines += [f"# not used: {', '.join(proposal.left)}"] if proposal.left else []
    lines += [f"# to be answered: {question}" for question in proposal.missing]
    lines += [f"# odd: {remark}" for remark in proposal.remarks]
    # names of columns stand in comments, too, where nothing escapes what is not shown
    return "\n".join("".join(c if c.isprintable() else " " for c in line) for line in lines) + "\n"


def _record(proposal: Proposal, facts: TableFacts, folder: Path, role: str) -> list[str]:
    """The [[record]] tables of one file: what moves, and the rests before or after, which give the noise."""
    path = Path(os.path.relpath(facts.table.path.resolve(), folder.resolve())).as_posix()
    head = [f"file = {toml(path)}"]
    if proposal.kind == "poses":
        return ["[[record]]", *head, f'role = "{role}"', ""]
    if facts.time is None:
        head.append('sample_rate = "1 kHz" # assumed: no column is a time')
    else:
        head.append(f'time = {{ column = {toml(facts.time.column)}, unit = "{facts.time.unit}" }}')
    known = proposal.drives_of(facts)
    if not known:
        return ["[[record]]", *head, f'role = "{role}"', ""]
    head.append(f"between_samples = {proposal.between_samples}")
    n = len(known[0])
    ends = [(a, b) for a, b in rests(np.column_stack(known)) if (a == 0) != (b == n)]
    begin, end = max((b for a, b in ends if a == 0), default=0), min((a for a, b in ends if b == n), default=n)
    lines = [
        "[[record]]",
        *head,
        f'role = "{role}"',
        *([f"rows = [{begin}, {end}]"] if (begin, end) != (0, n) else []),
        "",
    ]
    for a, b in ((0, begin), (end, n)):
        if b > a:
            lines += [
                "[[record]] # nothing moves: it gives the noise",
                *head,
                'role = "rest"',
                f"rows = [{a}, {b}]",
                "",
            ]
    return lines
