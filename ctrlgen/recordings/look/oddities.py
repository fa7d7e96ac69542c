"""What is odd about readings beside the device they are said to come from: range, unit, order of cause and effect."""

from __future__ import annotations

import shlex

import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import InputError
from ctrlgen.core.units import from_si, to_si
from ctrlgen.model.model import Model
from ctrlgen.recordings.alike_units import alike
from ctrlgen.recordings.formats.time_stamps import TIME_NAME, epoch_unit
from ctrlgen.recordings.look.column_facts import (
    SAME_RATE,
    ColumnFacts,
    TableFacts,
    assumed_step,
    is_a_count,
    rises_evenly,
)
from ctrlgen.recordings.look.signal_words import COMMAND_WORDS, words_of

WIDE = 5.0  # times the device's own size: no reading of it is as large
NARROW = 1e-4  # of it: nothing moved, or the unit is another
FEWEST_INSTANTS = 10
"""From which on the same number of rows of each is no accident. Judgement."""
MOST_CHANNELS = 4
FITTING = (0.02, 2.5)  # of the device's size: a reading of it usually spans so much


def table_oddities(facts: TableFacts) -> list[str]:
    """What is odd of a table by itself."""
    said = []
    if (time := facts.time) is not None:
        if time.backward:
            said.append(
                f"{time.column}: {number_of(time.backward, 'row is', 'rows are')} not later than the row before"
            )
        stated = facts.table.stated_rate
        if stated is not None and not assumed_step(facts) and abs(stated[1] * time.step - 1) > SAME_RATE:
            said.append(
                f"the file says {stated[0]!r}, and its time goes on by {time.step:.6g} s: the unit of one, or rows left out?"
            )
        if time.jitter > 0.01 * time.step:
            said.append(f"{time.column}: rows are uneven by {100 * time.jitter / time.step:.2g} % of their step")
    else:
        said += _perhaps_times(facts) + _lost_rows(facts)
    for column in facts.columns:
        if column.values is None:
            continue
        if words_of(column.bare) & COMMAND_WORDS:
            continue
        said += [f"{column.name}: stands at its end {end:g} again and again: clipped?" for end in column.clipped()]
    constant = [c.name for c in facts.columns if c.values is not None and not c.moves]
    said += [f"the same in every row: {', '.join(constant)}"] if constant else []
    said += [f"{b}: is the same as {a}" for a, b in _alike(facts)]
    return said


def _lost_rows(facts: TableFacts) -> list[str]:
    """Of a table without a time: columns that number its rows and leave numbers out, which a rate alone would close up."""
    said = []
    for column in (c for c in facts.columns if is_a_count(c) and epoch_unit(c.finite) is None):
        more = np.diff(column.finite) - 1
        if np.any(more > 0):
            k = int(np.flatnonzero(more > 0)[0])
            lost = number_of(int(more[more > 0].sum()), "number is", "numbers are")
            said.append(
                f"{column.name}: {lost} left out, the first after row {k}: rows that were lost there, and no rate alone tells their time; "
                f"take it as the time: {shlex.join(['--time', column.name, '--unit', f'{column.name}=1ms'])}, with the time of one row"
            )
    return said


def _perhaps_times(facts: TableFacts) -> list[str]:
    """Of a table without a time: columns that are named as one and stand still between rows, else those that rise evenly."""
    said = []
    for column in facts.columns:
        named = TIME_NAME.match(column.bare) is not None
        seconds = column.finite if column.values is not None else _dates(facts, column) if named else np.empty(0)
        steps = np.diff(seconds)
        if named and len(steps) and np.all(steps >= 0) and np.any(steps > 0) and np.any(steps == 0):
            each = _standing(seconds)
            several = f"; where the {each} rows of an instant are its smallest and largest reading, or channels in turn, keep one instead"
            unit = column.unit or ("of its unit" if column.values is not None else "s")
            said.append(
                f"{column.name}: stands still in {np.sum(steps == 0)} of {len(steps)} rows: rounded too coarsely to be a time; where rows "
                f"are even, leave it out and write their rate (1 row in {np.mean(steps):.6g} {unit}){several if each > 1 else ''}"
            )
    return said or [
        f"{c.name}: rises by {np.median(np.diff(c.finite)):.6g} from row to row: name it as the time if it is"
        for c in facts.columns
        if rises_evenly(c)
    ]


def _standing(seconds: np.ndarray) -> int:
    """In how many rows every instant of a time (n,) stands, from 2 to 4 as channels are; 1 where these differ, or it is rather rounded."""
    found = seconds[np.isfinite(seconds)]
    many = set(np.diff(np.flatnonzero(np.diff(found, prepend=np.nan, append=np.nan) != 0)).tolist())
    each = many.pop() if len(many) == 1 else 1
    return each if each <= MOST_CHANNELS and len(found) >= each * FEWEST_INSTANTS else 1


def _dates(facts: TableFacts, column: ColumnFacts) -> np.ndarray:
    """The seconds of a column of dates; empty where it holds none."""
    try:
        return facts.table.time(column.name, "s").values
    except InputError:
        return np.empty(0)


def _alike(facts: TableFacts) -> list[tuple[str, str]]:
    moving = [c for c in facts.columns if c.moves and c.name not in facts.table.time_parts]
    return [
        (a.name, b.name)
        for k, b in enumerate(moving)
        for a in moving[:k]
        if a.values is not None and b.values is not None and np.array_equal(a.values, b.values, equal_nan=True)
    ]


def implausible_range(name: str, values: np.ndarray, unit: str, model: Model) -> str | None:
    """A sentence where numbers in `unit` cannot be of the signal `name`, "role.channel": their range beside the device's own size, and
    the unit with which it would be plausible. None where it can be."""
    role, _, channel = name.partition(".")
    signal = model.signals[role]
    i = signal.channels.index(channel)
    own = signal.scale[i] if role != "drive" else _drive_size(model, i)
    seen = values[np.isfinite(values)]
    if not len(seen) or not np.isfinite(own) or own <= 0:
        return None
    span = float(np.ptp(seen)) * (to_si(1.0, unit) - to_si(0.0, unit))
    if NARROW * own <= span <= WIDE * own or span == 0:
        return None
    size = f"{from_si(own, signal.units[i]) - from_si(0.0, signal.units[i]):.3g} {signal.units[i]}"
    what = f"{name} spans {np.ptp(seen):.4g} {unit}, and the device's own size is {size}"
    fitting = fitting_units(name, values, unit, model)
    return (
        f'{what}; if the numbers are in {fitting[0]}, write unit = "{fitting[0]}"'
        if fitting
        else f"{what}; is the unit right?"
    )


def fitting_units(name: str, values: np.ndarray, unit: str, model: Model) -> list[str]:
    """Units of the dimension of `unit` with which the numbers of a signal are about as large as the device, where `unit` is not one."""
    role, _, channel = name.partition(".")
    signal = model.signals[role]
    i = signal.channels.index(channel)
    own = signal.scale[i] if role != "drive" else _drive_size(model, i)
    span = float(np.ptp(values[np.isfinite(values)]))

    def fits(other: str) -> bool:
        return bool(FITTING[0] * own <= span * (to_si(1.0, other) - to_si(0.0, other)) <= FITTING[1] * own)

    if fits(unit):
        return []
    return [other for other in alike(unit) if fits(other)]


def _drive_size(model: Model, i: int) -> float:
    low, high = model.u_bounds
    return float(high[i] - low[i]) if np.isfinite(high[i] - low[i]) else float(model.signals["drive"].scale[i])
