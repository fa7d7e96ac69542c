"""What is asked of measurement files beside a device: which free column a signal is, and when the rows were taken."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import InputError
from ctrlgen.core.units import same_dimension
from ctrlgen.model.model import Model
from ctrlgen.recordings.formats.number_cells import TIME
from ctrlgen.recordings.formats.unit_texts import unit_lacks
from ctrlgen.recordings.look.answers import Answers, layout_option
from ctrlgen.recordings.look.column_facts import (
    NEWEST_FIRST,
    SAME_RATE,
    ColumnFacts,
    TableFacts,
    assumed_step,
    rises_evenly,
)
from ctrlgen.recordings.look.signal_words import DRIVE_WORDS, READING_WORDS, words_of

PERHAPS_TIME = re.compile(r"(?i)time|zeit|stamp|elapsed|clock|since|date|datum|uhr|^t\b|^[mj]d\b")
"""Words of names of columns that may be a time which is not read."""
MOST_LISTED, MOST_UNREAD = 12, 3
"""Columns that a question lists: of numbers, and of text."""


def with_own_rate(facts: TableFacts, answers: Answers) -> Answers:
    """The answers with the rate of a table without a time whose channels have one clock."""
    known = facts.time is not None or facts.falls or answers.rate is not None or answers.poses
    return replace(answers, rate=f"{1 / facts.clock_step:.9g} Hz") if facts.clock_step and not known else answers


def perhaps_times(model: Model, facts: TableFacts, taken: set[str]) -> set[str]:
    """The first column that rises evenly without a unit or a word of a signal, where enough others are left: the time or a number of the
    row of a table that names none, and rather no drive."""
    moving = [c for c in facts.columns if c.moves and c.name not in taken]
    words = DRIVE_WORDS | READING_WORDS
    rising = [c.name for c in moving if c.unit is None and not words_of(c.bare) & words and rises_evenly(c)]
    return set(rising[:1]) if len(moving) > 1 + len(model.signals["drive"].channels) else set()


def free_columns(facts: TableFacts, left: Sequence[str]) -> str:
    """The columns of numbers that no signal is, with their units, and what keeps those of text from being read."""
    columns = [facts.column(name) for name in left[:MOST_LISTED]]
    free = [f"{c.name} [{c.unit}]" if c.unit and c.bare == c.name else c.name for c in columns]
    free += [f"{len(left) - MOST_LISTED} more"] if len(left) > MOST_LISTED else []
    time = "" if facts.time is None else facts.time.column
    unread = [c for c in facts.columns if c.unread and c.name != time and _of_digits(facts, c)]
    return "; ".join([", ".join(free) or "none", *(c.unread for c in unread[:MOST_UNREAD])])


def _of_digits(facts: TableFacts, column: ColumnFacts) -> bool:
    """Whether most cells of a column of text hold digits and none is a date: numbers written otherwise, and no remarks."""
    cells = [str(cell) for cell in facts.table.columns[column.name]]
    digits = [any(map(str.isdigit, cell)) for cell in cells]
    return sum(digits) > len(cells) / 2 and not any(map(TIME.fullmatch, cells))


def _unread_time(facts: TableFacts) -> str:
    """Why the first column that is named as a time, and holds text or a unit that is not known, is none; empty where there is none."""
    for column in facts.columns:
        words = PERHAPS_TIME.search(column.name)
        if words is None or column.name in facts.table.time_parts:
            continue
        if column.question is not None:
            return f" ({column.question.asked(layout_option)})"
        if column.values is None:
            try:
                facts.table.time(column.name, "s")
            except InputError as error:
                first = next((str(cell) for cell in facts.table.columns[column.name] if cell), "")
                if not column.unread or TIME.match(first):
                    return f" ({'; '.join(fault.what for fault in error.faults)})"
                none = f"column {column.name!r} holds {first!r}, which is no time that is read"
                return f" ({none}; write seconds, or ISO 8601 (2024-03-31T01:59:58.000))"
        elif column.unit is not None and not same_dimension(column.unit, "s"):
            return f" (column {column.name!r} is in {column.unit})"
        elif column.moves and np.any(np.diff(column.finite) < 0):
            falls = np.flatnonzero(np.diff(column.finite) < 0)
            return f" (column {column.name!r} falls in {number_of(len(falls), 'row')}, first after row {falls[0]})"
    return ""


def time_questions(facts: TableFacts, answers: Answers) -> list[str]:
    """What is asked of when the rows were taken."""
    stated, known = facts.table.stated_rate, answers.rate is not None or answers.poses
    says = "" if stated is None else f"the file says {stated[0]!r} (--rate {stated[1]:.9g}Hz"
    if facts.falls:
        return [f"time is column {facts.falls!r}, which {NEWEST_FIRST}"]
    if facts.time is None and not known:
        unread = _unread_time(facts)
        rising = next((c for c in facts.columns if c.unit is None and rises_evenly(c)), None)
        perhaps = shlex.join(["--time", "COLUMN" if rising is None else rising.name])
        otherwise = f'state sample_rate, or kind = "poses" ({perhaps}, --rate 1kHz or --poses)'
        return [f"no column is a time{unread}: {f'{says}, else {perhaps} or --poses)' if says else otherwise}"]
    if facts.time is not None and not known and (step := assumed_step(facts)):
        name, unit = facts.time.column, facts.time.unit
        fits = stated is not None and abs(step * stated[1] - 1) < SAME_RATE
        why = f", as {stated[0]!r} says" if stated is not None and fits else ""
        answer = shlex.join(["--unit", f"{name}={unit}"])
        assumed = f"{unit_lacks(name)}, {unit} is assumed{why}, {step:g} s from row to row ({answer})"
        return [f"time is column {name!r}: {assumed}" + (f"; but {says})" if says and not fits else "")]
    if facts.time is not None and not known and not facts.time.stamps:
        name, unit = facts.time.column, facts.time.unit
        column = facts.column(name)
        if answers.unit(name, column.bare) is None and (formula := column.factor_said):
            answer = shlex.join(["--unit", f"{name}={unit}"])
            return [
                f"time is column {name!r}: {formula}: write what one of them is, {facts.time.step:g} s from row to row ({answer})"
            ]
    return []
