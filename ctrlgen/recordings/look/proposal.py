"""A recording.toml to begin with: which column is which signal of the device, by unit, name and range; what is certain and what is asked.

Signals and columns are matched by the assignment of the largest total likeness (H. W. Kuhn, Naval Research Logistics 2 (1955) 83).
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.units import parse, same_dimension, to_si
from ctrlgen.model.model import Model
from ctrlgen.recordings.alike_units import size_of
from ctrlgen.recordings.derived_drives import derived_drives
from ctrlgen.recordings.formats.unit_texts import unit_lacks
from ctrlgen.recordings.look.answers import NOTHING, Answers, layout_option
from ctrlgen.recordings.look.column_facts import (
    ColumnFacts,
    TableFacts,
    course_of,
    is_a_count,
    is_a_time,
    named,
)
from ctrlgen.recordings.look.file_questions import free_columns, perhaps_times, time_questions, with_own_rate
from ctrlgen.recordings.look.oddities import fitting_units, implausible_range
from ctrlgen.recordings.look.signal_words import DRIVE_WORDS, ERROR_WORDS, READING_WORDS, words_of
from ctrlgen.recordings.look.surroundings import temperature_of_surroundings
from ctrlgen.recordings.moved import Stretch, moved_of
from ctrlgen.recordings.plausibility import implausible
from ctrlgen.recordings.schema import signal_units

MEANINGS = {
    "V": frozenset(("volt", "voltage", "voltages", "spannung")),
    "A": frozenset(("current", "ampere", "amps", "strom")),
    "N*m": frozenset(("torque", "moment", "drehmoment")),
    "N": frozenset(("force", "kraft", "load")),
    "W": frozenset(("power", "leistung")),
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
    """`signal` is `column`, `scale` times its numbers in `unit`; `stated` whether the file says so. `why`: what is not certain, empty where
    all is."""

    signal: str
    column: str
    unit: str
    stated: bool
    why: tuple[str, ...] = ()
    scale: float = 1.0

    @property
    def option(self) -> str:
        """What says on the command line that it is so."""
        unit = (
            []
            if self.stated
            else ["--unit", f"{self.signal}={'' if self.scale == 1 else f'{self.scale:.12g} '}{self.unit}"]
        )
        return shlex.join(["--column", f"{self.signal}={self.column}", *unit])


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
    answers: Answers = NOTHING
    ambient: str | None = None
    """The column that is the temperature of the surroundings."""
    derived: Mapping[str, tuple[str, int]] = field(default_factory=dict)
    """Drives that no column is, each with the drive of which it is a derivative and the order."""

    @property
    def kind(self) -> str:
        """Few rows without a time are poses."""
        return kind_of(self.tables[0], self.answers)

    @property
    def timed(self) -> bool:
        """Whether it is known when the rows were taken, or that it does not matter."""
        return self.tables[0].time is not None or self.answers.rate is not None or self.answers.poses

    @property
    def asked(self) -> tuple[str, ...]:
        """Every question that the files leave open."""
        return (
            *(f"{m.signal} = column {m.column!r}: {'; '.join(m.why)} ({m.option})" for m in self.matches if m.why),
            *self.missing,
        )

    def drives_of(self, facts: TableFacts) -> list[np.ndarray]:
        """The columns of drives in one table."""
        return self._of("drive.", facts)

    def readings_of(self, facts: TableFacts) -> list[np.ndarray]:
        """The columns of readings in one table."""
        return self._of("reading.", facts)

    def _of(self, role: str, facts: TableFacts) -> list[np.ndarray]:
        names = {m.column for m in self.matches if m.signal.startswith(role)}
        return [c.values for c in facts.columns if c.name in names and c.values is not None]

    @property
    def between_samples(self) -> str:
        """What the drive does between samples, as TOML: of all files together, for they come from one bench. A drive that steps in one of
        them is held; others do not tell."""
        courses = {course_of(values) for facts in self.tables for values in self.drives_of(facts)}
        if "steps" in courses:
            return '"held"'
        what = "every drive is a smooth curve, which does not tell" if courses == {"curve"} else "no drive tells"
        return f'"unstated" # {what}: write "held" or "linear", if you know it'

    @property
    def certain(self) -> bool:
        """Whether it can be used as it stands."""
        return not self.asked


def kind_of(facts: TableFacts, answers: Answers = NOTHING) -> str:
    """The kind of a recording: few rows without a time or a rate are poses."""
    few = facts.time is None and not facts.falls and answers.rate is None and facts.rows <= MOST_POSES
    return "poses" if answers.poses or few else "series"


def propose(tables: Sequence[TableFacts], model: Model, answers: Answers = NOTHING) -> Proposal:
    """The recording that files with the same columns are of a device. Its first file decides which column is what, where `answers` do
    not; they name what `tables` were read with. Raises InputError for an answer that names no signal or column."""
    first = tables[0]
    answers = with_own_rate(first, answers)
    taken = {c.name for c in first.columns if first.time is not None and (c.name == first.time.column or is_a_time(c))}
    taken |= {first.falls} if first.falls else set()
    taken |= first.table.time_parts | {c.name for c in first.columns if is_a_count(c)}
    taken |= perhaps_times(model, first, taken) if first.time is None else set()
    columns = [c for c in first.columns if c.moves and c.name not in taken]
    signals = [name for name in signal_units(model) if name.partition(".")[0] in ("drive", "reading")]
    chosen = _chosen(model, first, signals, answers)
    free = [c for c in columns if c.name not in {m.column for m in chosen}]
    matches = chosen + _matched(model, [n for n in signals if n not in {m.signal for m in chosen}], free, answers)
    matches.sort(key=lambda match: signals.index(match.signal))
    found = {match.signal for match in matches}
    left = [c.name for c in columns if c.name not in {m.column for m in matches}]
    derived = derived_drives([name for name in signals if name not in found], found)
    asked = [
        f"{name}: which column? Free are {free_columns(first, left)} ({shlex.join(['--column', f'{name}=COLUMN'])})"
        for name in signals
        if name.startswith("drive.") and name not in found | set(derived)
    ]
    if not any(name.startswith("reading.") for name in found):
        known = next(name for name in signals if name.startswith("reading."))
        which = f"Free are {free_columns(first, left)} ({shlex.join(['--column', f'{known}=COLUMN'])})"
        asked.append(f"no column was recognised as a reading: which is it? {which}")
    asked += time_questions(first, answers)
    if any(name not in found for name in signals):  # which an unread column may be
        asked += [c.question.asked(layout_option) for c in first.columns if c.question is not None]
    _check_lengths(first, matches)
    remarks = _remarks(model, first, matches, answers)
    left = [c.name for c in first.columns if c.moves and c.name not in {*taken, *(m.column for m in matches)}]
    ambient = temperature_of_surroundings([first.column(name) for name in left])
    left = [name for name in left if name != ambient]
    return Proposal(
        model, tuple(tables), tuple(matches), tuple(left), tuple(asked), tuple(remarks), answers, ambient, derived
    )


def _check_lengths(facts: TableFacts, matches: Sequence[Match]) -> None:
    """Raises InputError where the columns of signals, or the time, have other numbers of rows than one another, or other times."""
    names = [m.column for m in matches] + ([facts.time.column] if facts.time is not None else [])
    if differing := facts.table.differing_times(names):
        raise facts.table.fault(differing)
    sizes = {name: len(facts.table.columns[name]) for name in names}
    if len(set(sizes.values())) > 1:
        listed = ", ".join(f"{name} {size}" for name, size in sizes.items())
        raise facts.table.fault(
            f"has columns of different numbers of rows ({listed}); export them together, at one rate"
        )


def _chosen(model: Model, facts: TableFacts, signals: Sequence[str], answers: Answers) -> list[Match]:
    """The matches that were answered."""
    matches, units = [], signal_units(model)
    for signal, name in answers.columns.items():
        if signal not in signals:
            raise InputError("--column", [Fault(signal, f"is no signal of {model.name}; its are {', '.join(signals)}")])
        column = facts.column(named(facts.table, name))
        if column.question is not None:
            raise InputError("--column", [Fault(name, column.question.asked(layout_option))])
        if not column.moves:
            raise InputError("--column", [Fault(name, _why_unmoved(column))])
        unit = answers.unit(signal) or column.unit
        if unit is not None and not same_dimension(unit, units[signal]):
            what = f"{name} is in {unit}, and {signal} in {units[signal]} or a multiple of it"
            if answers.unit(signal) is None:
                what += f"; where one {unit} is so much of it, say how much: {shlex.join(['--unit', f'{signal}=10{units[signal]}'])}"
            raise InputError("--column", [Fault(signal, what)])
        matches.append(_match(model, signal, column, unit, [], answers))
    return matches


def _why_unmoved(column: ColumnFacts) -> str:
    """Why a column can be no signal: its cells are no numbers, or the same in every row."""
    if column.values is None:
        return column.unread
    if not len(column.finite):
        return "holds no number in any row"
    return f"holds no numbers that differ: {column.finite[0]:g} in every row"


def _match(model: Model, signal: str, column: ColumnFacts, unit: str | None, why: list[str], answers: Answers) -> Match:
    """One match; a `unit` that nobody states is assumed, and asked, and so is a factor that stands beside counts: a unit that is stated
    for them is that of one count."""
    stated = answers.scale(signal) if column.counted else answers.scales.get(signal)
    scale = column.scale if stated is None else stated
    assumed = [column.factor] if column.counted and stated is None else []
    if unit is None:
        unit = _plausible(model, signal, column, signal_units(model)[signal])
        assumed = [f"{unit_lacks(column.name)}, {unit} is assumed", *assumed]
    elif column.factor_said and answers.unit(signal, column.name, column.bare) is None:
        assumed = [f"{column.factor_said}: write what one of them is", *assumed]
    why = [*why, f"{'; '.join(assumed)}: {_range(column)} {unit}"] if assumed else why
    return Match(signal, column.name, unit, not assumed, tuple(why), scale)


def _remarks(model: Model, facts: TableFacts, matches: Sequence[Match], answers: Answers) -> list[str]:
    """What is not plausible: beside what the model makes of the drives, or where not every drive is known beside the device's size."""
    of = {role: [m for m in matches if m.signal.startswith(role)] for role in ("drive.", "reading.")}
    drives, readings = (tuple((m.signal, m.unit) for m in found) for found in of.values())
    u, y = (np.reshape([_si(facts, m) for m in found], (len(found), facts.rows)).T for found in of.values())
    step = facts.time.step if facts.time is not None else np.inf
    step = 1 / parse(answers.rate, "Hz") if answers.rate is not None else step
    known = np.isfinite(step) or kind_of(facts, answers) == "poses"
    linear = {course_of(column) for column in u.T} == {"curve"}
    seen = moved_of(model, drives, readings, [Stretch(u, y, step, linear)]) if known and readings else None
    if seen is not None:
        return implausible(seen)
    columns = ((m, facts.column(m.column)) for m in matches)
    values = ((m, c.values * (m.scale / c.scale)) for m, c in columns if c.values is not None)
    return [odd for m, v in values if (odd := implausible_range(m.signal, v, m.unit, model))]


def _si(facts: TableFacts, match: Match) -> np.ndarray:
    column = facts.column(match.column)
    assert column.values is not None  # only columns of numbers are matched
    return column.values * (match.scale / column.scale) * size_of(match.unit) + to_si(0.0, match.unit)


def _matched(model: Model, signals: Sequence[str], columns: Sequence[ColumnFacts], answers: Answers) -> list[Match]:
    """The best assignment of columns to signals; a column that is like none stays free."""
    from scipy.optimize import linear_sum_assignment  # a quarter of a second to import

    if not columns or not signals:
        return []
    likeness = np.array([[_likeness(model, name, column) for column in columns] for name in signals])
    likeness += PLACE * _in_order(signals, len(columns)) * (likeness > 0)
    rows, chosen = linear_sum_assignment(likeness, maximize=True)
    matches = []
    for i, k in zip(rows, chosen, strict=True):
        if likeness[i, k] < POSSIBLE:
            continue
        column = columns[k]
        rivals = [
            columns[j].name for j in range(len(columns)) if j not in chosen and likeness[i, j] > likeness[i, k] - CLEAR
        ]
        why = [f"could be column {' or '.join(map(repr, rivals))} as well"] if rivals else []
        if likeness[i, k] < NAMED:
            why.append("nothing but its place speaks for it")
        unit = answers.unit(signals[i]) or column.unit
        matches.append(_match(model, signals[i], column, unit, why, answers))
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
    words = words_of(column.bare)
    if any(words & meaning and not _may_be(of, unit) for of, meaning in MEANINGS.items()):
        return 0.0
    score = UNIT if column.unit is not None else POSSIBLE
    score += CHANNEL if _names(channel, column.bare, model, role) else 0.0
    own, other = (DRIVE_WORDS, READING_WORDS) if role == "drive" else (READING_WORDS, DRIVE_WORDS)
    score += OTHER_ROLE * bool(words & ERROR_WORDS)
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
