"""Clocks of twelve hours whose stamps do not say which half of the day it is: after 12:59:59 comes 1:00:00."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

HALF_DAY = 43200.0
HOUR = 3600.0
# Within which rows go on where one half of a day ends: a longer pause is told from a second run by nothing
SOON = 2 * HOUR


class WholeDays(NamedTuple):
    """Times (n,) [s] on a clock of a whole day, and the row before which each half of one begins."""

    values: np.ndarray
    begins: tuple[int, ...]


def of_whole_days(values: np.ndarray, hours: Sequence[int]) -> WholeDays | None:
    """Times (n,) [s] as they are written, with their `hours` as written, on a clock that goes on; None where it is none of twelve hours.

    It is one where every hour is from 1 to 12 and time falls by less than twelve hours from an hour 12 to the rows soon after, or
    leaps by a day and one usual step to an hour 12. Dates tell that a record began in the second half of a day: it ends on the next one.
    """
    known = np.flatnonzero(np.isfinite(values))
    hour, time = np.array(hours)[known], values[known].astype(float)
    steps = np.diff(time)
    falls = (hour[:-1] == 12) & (steps < 0) & (steps + HALF_DAY > 0) & (steps + HALF_DAY < SOON)
    usual = float(np.median(steps)) if len(steps) else 0.0
    # of rows that follow soon: those of one a day leap by a day everywhere
    nights = (hour[:-1] == 11) & (hour[1:] == 12) & (np.abs(steps - 2 * HALF_DAY - usual) <= usual) & (usual < SOON)
    if not len(hour) or hour.min() < 1 or hour.max() > 12 or not (falls | nights).any():
        return None
    time -= HALF_DAY * (hour == 12)
    begins, later = list[int](), 0.0
    for k in range(1, len(time)):
        step = time[k] + later - time[k - 1]
        if step < 0 and step + HALF_DAY < SOON:
            later += HALF_DAY
            begins.append(int(known[k]))
        elif HALF_DAY <= step < HALF_DAY + SOON:  # midnight: the date goes on by a day
            if later:
                later -= HALF_DAY
            else:
                time[:k] += HALF_DAY
            begins.append(int(known[k]))
        time[k] += later
    whole = np.full(len(values), np.nan)
    whole[known] = time
    return WholeDays(whole, tuple(begins))


def told(days: WholeDays) -> str:
    """The note of it."""
    passes = ", ".join(map(str, days.begins))
    after = f"noon or midnight passes before row {passes}" if passes else "1 o'clock is an hour after 12 o'clock"
    return f"hours are from 1 to 12 without AM or PM: {after}"
