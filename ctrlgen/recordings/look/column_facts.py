"""What the columns of one measurement table hold: range, step, rests, gaps, repeated extremes; and which of them is the time."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.units import same_dimension, to_si
from ctrlgen.recordings.formats.clock_numbers import clock_of
from ctrlgen.recordings.formats.formula_names import formula_of
from ctrlgen.recordings.formats.layout_question import Ambiguous, AmbiguousFile
from ctrlgen.recordings.formats.measurement_table import MeasurementTable
from ctrlgen.recordings.formats.time_stamps import EPOCHS, TIME_NAME, epoch_unit
from ctrlgen.recordings.formats.unit_texts import BASES, NAMES, bare_name, scaled_unit, unit_of
from ctrlgen.recordings.look.answers import NOTHING, Answers
from ctrlgen.recordings.usual_step import usual_step

SUFFIX = re.compile(r"^(?P<name>.*[A-Za-z0-9)])[_.](?P<unit>[A-Za-z%]{1,4})$")  # of a name: drive_V, time.ms
CLOCKS = {
    "millis": "ms", "micros": "us", "ms": "ms", "us": "us", "msec": "ms", "usec": "us", "milliseconds": "ms", "microseconds": "us",
    "s": "s", "sec": "s", "secs": "s", "second": "s", "seconds": "s", "sekunden": "s", "x_value": "s",
}  # fmt: skip
"""Names of columns that are units of time, of microcontrollers and LabVIEW among others, or their last words; those of two letters as they
stand: Us is a voltage."""
RATE_SUFFIX = re.compile(
    r"^.*[A-Za-z0-9)][_.](?P<of>[mun]?m|[mu]?rad|deg)_(?:per_)?s(?P<square>2?)$"
)  # of a name: v_mm_s, qdd_rad_s2
GAP = 1.5  # steps between two rows from which rows are missing
END = 1e-9  # of the range: rounding of a file
CLIPPED = 20  # rows at an end, in runs of three and more, from which it is told
RUN = 3
REST = 100  # rows: a shorter rest says nothing of the noise
STILL = 1e-6  # of the range of a drive: held still
COUNT_NAME = re.compile(
    r"^(#|n|no\.?|nr\.?|row|idx|seq|record|rn|scan|index|number|counter|count|sample|point|reading ?#|messung)s?\W*$",
    re.IGNORECASE,
)
"""Names of columns that number the rows."""
COUNTED = 0.8  # of the steps of a column that numbers the rows: at others rows were lost, or it begins again
JUMP = 0.25  # of its range: a reading does not go so far to its end in one row, a command does
NOISE_REST = 200  # rows: the shortest record at rest from which a diagnosis takes the noise
NEWEST_FIRST = (
    "falls from row to row, newest row first: reverse the rows below the header, so that the oldest is the first"
)
SLOW_CLOCK = 0.6  # share of rows in which a drive stands still from which it steps by a slower clock
LONG_STEP = 0.05  # s: a time without a unit that goes on by more is rather one in ms, of a rate below 20 kHz. Judgement
SHORTEST_UNSTATED = 2e-5  # s: rows a second apart in days, or 70 ms in hours
ROUND = np.array((1, 1.25, 2, 2.5, 3, 4, 5, 6, 7.5, 8, 10))
SAME_STEP = 2e-4  # of a step: half of the last of four digits
EVEN = 0.01  # of a step: rounding of a time that rises evenly
SAME_RATE = 0.01  # of a rate: a time and a header that differ by less say the same
SMOOTH = 0.1  # median of second differences over that of first ones, of a drive that is a curve and no steps


@dataclass(frozen=True)
class ColumnFacts:
    """One column: `unit` as the file states it or its name ends, None where neither does; `values` (n,) in it, NaN where there is no
    number, None where the column is text or cannot be read before its `question` is answered; `notes`: what was interpreted; `scale`: of
    the file's numbers to `unit`, where it states a multiple of a unit, or `counted`: a factor beside whole numbers, which lack it;
    `unread`: why the cells of a column of text are no numbers; `factor_said`: what the
    file says of it by a factor that is not applied, or its name by a calculation."""

    name: str
    unit: str | None
    values: np.ndarray | None
    notes: tuple[str, ...] = ()
    question: Ambiguous | None = None
    scale: float = 1.0
    unread: str = ""
    counted: bool = False
    factor_said: str = ""

    @property
    def bare(self) -> str:
        """The name without its unit."""
        return bare_name(self.name)

    @property
    def factor(self) -> str:
        """What is assumed of the numbers of a column that is `counted`."""
        return f"its whole numbers lack {self.scale:.12g}, which stands beside them and is assumed"

    @property
    def last(self) -> str:
        """The name without its unit and without the groups that it is in."""
        return re.split(r"[./]", self.bare)[-1]

    @property
    def finite(self) -> np.ndarray:
        """The numbers that are there."""
        return np.empty(0) if self.values is None else self.values[np.isfinite(self.values)]

    @property
    def missing(self) -> int:
        """Rows without a number."""
        return 0 if self.values is None else int(np.sum(~np.isfinite(self.values)))

    @property
    def moves(self) -> bool:
        """Whether the numbers differ."""
        return len(self.finite) > 1 and bool(np.ptp(self.finite) > 0)

    def clipped(self) -> list[float]:
        """Ends of the range at which the numbers stand in runs, though they move elsewhere: a converter that was at its end."""
        y, ends = self.finite, []
        if not self.moves or len(np.unique(y)) < CLIPPED:
            return []
        for end in (y.min(), y.max()):
            at = np.abs(y - end) <= END * np.ptp(y)
            edges = np.flatnonzero(np.diff(np.concatenate([[0], at.astype(int), [0]])))
            begins = edges.reshape(-1, 2)[:, 0]
            jumps = np.abs(y[begins] - y[begins - 1]) > JUMP * np.ptp(y)
            runs = np.diff(edges.reshape(-1, 2), axis=1)[~(jumps & (begins > 0))]  # a square wave is commanded so
            runs = runs[(runs >= RUN) & (runs < REST)]  # what stands longer rests
            if len(runs) > 1 and runs.sum() >= CLIPPED:
                ends.append(float(end))
        return ends


@dataclass(frozen=True)
class TimeFacts:
    """The time of a table's rows: `column`, its `unit`, `stamps` whether they are dates, usual `step` [s], rms `jitter` [s], `gaps`: (row
    before, missing rows), `backward`: rows that are earlier than the one before, `notes`: what was interpreted to read it."""

    column: str
    unit: str
    stamps: bool
    step: float
    jitter: float
    gaps: tuple[tuple[int, int], ...]
    backward: int
    notes: tuple[str, ...] = field(default=(), compare=False)


@dataclass(frozen=True)
class TableFacts:
    """The columns of one table, and its time where it has one; without one, `falls`: the column of a time whose newest row stands first."""

    table: MeasurementTable
    columns: tuple[ColumnFacts, ...]
    time: TimeFacts | None
    falls: str = ""

    @property
    def rows(self) -> int:
        """Its length."""
        return max((len(c.values) for c in self.columns if c.values is not None), default=0)

    @property
    def clock_step(self) -> float:
        """The step [s] of the one clock that the format states of all channels, as waveforms of LabVIEW do; 0 without one."""
        clocks = self.table.clocks
        steps = {clock.step for clock in clocks.values()}
        return steps.pop() if len(steps) == 1 and clocks.keys() >= {c.name for c in self.columns if c.moves} else 0.0

    def column(self, name: str) -> ColumnFacts:
        """The column of a name."""
        return next(c for c in self.columns if c.name == name)


def table_facts(table: MeasurementTable, answers: Answers = NOTHING) -> TableFacts:
    """What a table holds, with the units and the time of `answers`. Raises InputError for a time that is none."""
    columns = tuple(_facts(table, name) for name in table.columns)
    columns = tuple(_answered(c, answers) for c in columns)
    if answers.time is None:
        time = None if answers.rate or answers.poses else _time(table, columns)
        known = time is not None or answers.poses
        # of a stated rate only what is surely a time speaks against the order of the rows
        falls = "" if known else falling_time(table, columns, by_name_too=answers.rate is None)
        return TableFacts(table, columns, time, falls)
    name = named(table, answers.time)
    time = _time(table, tuple(c for c in columns if c.name == name), name)
    if time is None and falling_time(table, tuple(c for c in columns if c.name == name), name):
        raise InputError("--time", [Fault(name, f"does not rise: it {NEWEST_FIRST}")])
    if time is None:
        raise InputError("--time", [Fault(name, "does not rise, or its unit is none of a time")])
    return TableFacts(table, columns, time)


def _answered(column: ColumnFacts, answers: Answers) -> ColumnFacts:
    """The column in the unit, or the multiple of one, that was stated for it."""
    unit, scale = answers.unit(column.name, column.bare), answers.scale(column.name, column.bare)
    if unit is None or scale is None:
        return column
    scale = scale if column.name in answers.scales or column.bare in answers.scales or column.counted else column.scale
    values = None if column.values is None else column.values * (scale / column.scale)
    return replace(column, unit=unit, values=values, scale=scale, counted=False)


def falling_time(
    table: MeasurementTable, columns: tuple[ColumnFacts, ...], chosen: str = "", by_name_too: bool = True
) -> str:
    """The column that is `chosen`, has the unit of a time, holds dates or, `by_name_too`, is named as a time, and falls from row to row;
    empty where none does."""
    for column in columns:
        timed = column.values is None or (column.unit is not None and same_dimension(column.unit, "s"))
        by_name = by_name_too and (TIME_NAME.match(column.bare) or TIME_NAME.match(column.last))
        if not (chosen or timed or by_name):
            continue
        unit = column.unit or epoch_unit(column.finite) or "s"
        if column.question is not None or not same_dimension(unit, "s"):
            continue
        try:
            values = table.time(column.name, "s" if column.values is None else unit, column.scale).values
        except InputError:  # text that is no time
            continue
        steps = np.diff(values[np.isfinite(values)])
        if len(steps) > 1 and np.all(steps <= 0) and np.median(steps) < 0:
            return column.name
    return ""


def named(table: MeasurementTable, column: str) -> str:
    """The column of a name or, where none has that name, of a number from 0. Raises InputError where there is none."""
    return table.find(int(column) if column.isdecimal() and column not in table.columns else column)


def _facts(table: MeasurementTable, name: str) -> ColumnFacts:
    stated = table.unit(name)
    several = scaled_unit(stated or "")
    scale, unit = several or (1.0, _suffix(name) if stated is None else unit_of(stated))
    counted = several is None and name in table.scales
    scale = table.scales[name] if counted else scale
    try:
        read = table.reading(name)
    except AmbiguousFile as error:
        return ColumnFacts(name, unit, None, question=error.question, scale=scale)
    except InputError as error:  # it holds text
        return ColumnFacts(name, unit, None, scale=scale, unread="; ".join(fault.what for fault in error.faults))
    values = read.values if scale == 1 else scale * read.values
    factor = f"{table.factors[name]}, which is not applied" if name in table.factors else ""
    said = "; ".join(filter(None, (formula_of(name, grouped=not len(table.lines)), factor)))
    return ColumnFacts(name, unit, values, read.notes, scale=scale, counted=counted, factor_said=said)


def _suffix(name: str) -> str | None:
    """The unit that a name ends in, such as `V` of drive_V, or is itself, such as `micros`; of the letters that are also indices or axes
    none is taken."""
    if (clock := CLOCKS.get(name if len(name) == len("ms") else name.lower())) is not None:
        return clock
    tail = re.split(r"[_.]|(?<=[a-z])(?=[A-Z])", name)[-1].lower()
    if tail != name.lower() and len(tail) > 1 and tail in CLOCKS:  # t_millis, timeMs
        return CLOCKS[tail]
    if rate := RATE_SUFFIX.match(name):
        return f"{rate['of']}/s" + ("^2" if rate["square"] else "")
    match = SUFFIX.match(name)
    if match is None or (match["unit"].lower() in NAMES - {"s"} and match["unit"] not in ("V", "A", "N", "W", "s")):
        return None
    unit = unit_of(match["unit"])
    return unit if unit is not None and any(same_dimension(unit, base) for base in BASES) else None


def _time(table: MeasurementTable, columns: tuple[ColumnFacts, ...], chosen: str = "") -> TimeFacts | None:
    """The column that is `chosen`, named as the time, or else holds dates, or else has the unit of a time and rises.

    Raises `AmbiguousFile` for dates that can be read two ways.
    """
    columns = tuple(c for c in columns if chosen or c.name not in table.time_parts)
    named = [c for c in columns if TIME_NAME.match(c.bare)] or [c for c in columns if TIME_NAME.match(c.last)]
    dated = [c for c in columns if c.values is None]
    of_unit = [c for c in columns if c.unit is not None and same_dimension(c.unit, "s")]
    found = []
    for column in dict.fromkeys(chosen or c.name for c in (*named, *dated, *of_unit, *columns[: bool(chosen)])):
        time = _time_in(table, next(c for c in columns if c.name == column), bool(chosen))
        if time is not None and not time.backward:
            return time
        found += [] if time is None else [time]
    return found[0] if found else None


def _time_in(table: MeasurementTable, facts: ColumnFacts, chosen: bool) -> TimeFacts | None:
    """The time in one column; None where it holds none. Raises `AmbiguousFile`."""
    unit = facts.unit or epoch_unit(facts.finite) or _unit_by_rate(table, facts) or rounder_unit(facts.finite)
    stamps = facts.values is None
    if not same_dimension(unit, "s") or (facts.question is not None and not chosen):
        return None
    try:
        size = 1.0 if stamps else to_si(1.0, unit) * facts.scale
        read = table.time(facts.name, "s" if stamps else unit, facts.scale)
    except AmbiguousFile:
        raise
    except InputError:
        return None
    seconds = read.values * size
    steps = np.diff(seconds[np.isfinite(seconds)])
    if len(steps) < 2 or not np.median(steps) > 0:
        return None
    step = usual_step(seconds[np.isfinite(seconds)])
    even = steps[np.abs(steps / np.median(steps) - 1) < GAP - 1]
    gaps = tuple((int(k), round(float(steps[k] / step)) - 1) for k in np.flatnonzero(steps > GAP * step))
    jitter = float(np.sqrt(np.mean((even - step) ** 2))) if len(even) else 0.0
    backward = int(np.sum(steps <= 0))
    return TimeFacts(facts.name, "s" if stamps else unit, stamps, step, jitter, gaps, backward, read.notes)


def is_a_time(column: ColumnFacts) -> bool:
    """Whether a column is named as a time, in no other unit (T of a temperature), and rises from row to row."""
    named = TIME_NAME.match(column.bare) or TIME_NAME.match(column.last)
    timed = column.unit is None or same_dimension(column.unit, "s")
    return bool(named) and timed and column.moves and bool(np.all(np.diff(column.finite) > 0))


def rises_evenly(column: ColumnFacts) -> bool:
    """Whether numbers rise by one and the same step from row to row, as a time or a number of the row does."""
    steps = np.diff(column.finite)
    return column.moves and bool(np.all(steps >= 0) and np.ptp(steps) <= EVEN * np.median(steps))


def assumed_step(facts: TableFacts) -> float:
    """The step [s] of a time without a stated unit that counts whole numbers or goes on in long steps: it may be in ms, ticks, or rows. 0
    for any other, and for one in seconds that goes on as often as the file states."""
    if facts.time is None or facts.time.stamps:
        return 0.0
    column = facts.column(facts.time.column)
    known = column.unit is not None or epoch_unit(column.finite) is not None or clock_of(column.finite) is not None
    if known or _unit_by_rate(facts.table, column) == "s":
        return 0.0
    counts = bool(np.all(column.finite == np.round(column.finite)))
    return facts.time.step if counts or facts.time.unit != "s" or facts.time.step >= LONG_STEP else 0.0


def _unit_by_rate(table: MeasurementTable, column: ColumnFacts) -> str | None:
    """The unit with which a time goes on from row to row as often as the file states beside it; None where none does."""
    steps = np.diff(column.finite)
    if table.stated_rate is None or len(steps) < 2:
        return None
    rows = usual_step(column.finite) * table.stated_rate[1]
    return next((unit for unit, many in EPOCHS.items() if abs(rows / many - 1) < SAME_RATE), None)


def rounder_unit(values: np.ndarray) -> str:
    """The unit of a time (n,) that states none: "day" or "h" where its steps are far too short for seconds and a round number of them in
    that unit alone, as 1 ms is 1.1574e-8 of a day; else "s"."""
    step = usual_step(values) if len(values) > 2 else 0.0
    if not 0 < step < SHORTEST_UNSTATED or _is_round(step):
        return "s"
    return next((unit for unit in ("day", "h") if _is_round(step * to_si(1.0, unit))), "s")


def _is_round(step: float) -> bool:
    """Whether it is, but for the rounding of a file, one digit and zeros, or an eighth of such."""
    digit = step / 10.0 ** np.floor(np.log10(step))
    return bool(np.min(np.abs(digit / ROUND - 1)) < SAME_STEP)


def is_a_count(column: ColumnFacts) -> bool:
    """Whether a column numbers the rows, or is a time since 1970 beside the one that is used: no signal of a device."""
    steps = np.diff(column.finite)
    if len(steps) < 2 or column.unit not in (None, "1"):
        return False
    numbered = COUNT_NAME.search(column.last) is not None and bool(np.mean(steps == 1) >= COUNTED)
    return numbered or (bool(np.all(steps >= 0)) and epoch_unit(column.finite) not in (None, "day"))


def rests(drives: np.ndarray) -> list[tuple[int, int]]:
    """Stretches [first, one past the last] of at least `REST` rows in which no drive (n, drives) moves."""
    spans = np.maximum(np.nanmax(drives, axis=0) - np.nanmin(drives, axis=0), 1e-300)
    still = (np.abs(np.diff(drives, axis=0)) <= STILL * spans).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(int), [0]])))
    return [(int(a), int(b) + 1) for a, b in edges.reshape(-1, 2) if b + 1 - a >= REST]


def slow_clock(drives: np.ndarray) -> int:
    """The number of rows of which one states every drive (n, drives), as it is where some are logged at a lower rate; 1 where rows that do
    so are no even part of all, or no row does: drives that are written in turn."""
    apart = {int(k) for k in np.diff(np.flatnonzero(np.isfinite(drives).all(axis=1)))}
    return apart.pop() if len(apart) == 1 else 1


def course_of(drive: np.ndarray) -> Literal["steps", "curve", "rough"]:
    """How a drive goes from row to row: it stands still in most rows; it is a curve as sampled, its second differences far below the first
    ones; or neither, as a random one or one that was measured with noise."""
    u = drive[np.isfinite(drive)]
    first = np.diff(u)
    moving = first[:-1] != 0
    if moving.sum() < REST or np.mean(first == 0) > SLOW_CLOCK:
        return "steps"
    bend, slope = (
        np.median(np.abs(np.diff(first)[moving])),
        np.median(np.abs(first[:-1][moving])),
    )  # a few corners do not count
    return "curve" if bend < SMOOTH * slope else "rough"
