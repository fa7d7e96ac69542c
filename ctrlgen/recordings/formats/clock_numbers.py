"""A time of day, or a date with one, written as one number: 115559 and, a second later, 115600; 20240305115559."""

from __future__ import annotations

import numpy as np

DAY = 86400.0
FEWEST = 4
"""Rows from which a column is known as one."""
SURE = 10000
"""115559 has hours: one passage to the next minute tells. Less may be seconds with a pause, and a second passage must agree."""
NEAR = 1.5
"""Usual steps within which the next minute begins, as rows of a clock do."""
MOST = 0.6
"""Of the passages to the next minute that are as near: rows may be lost at others."""
THOUSANDTHS = 240000.0
"""No time of day is as large unless its thousandths of seconds stand in it too: 115559250."""
DATED = (1.9e13, 2.1e13)
"""Numbers of fourteen digits, the first eight a date, of the years 1900 to 2099."""
AS_SECONDS = "is a clock written as a number, hours, minutes and seconds side by side (115559 is 11:55:59); read as seconds since the first"


def clock_of(values: np.ndarray) -> np.ndarray | None:
    """Numbers (n,) that are a time of day, HHMMSS with or without a fraction, as seconds since midnight of the first day; None for others.

    None of them has 60 seconds or minutes, and at most passages to the next minute the clock goes on as it does elsewhere, where the
    numbers jump by 40 and more. Midnight may pass. Of numbers with a date in front, YYYYMMDDHHMMSS, the date alone tells.
    """
    known = values[np.isfinite(values)]
    if len(known) < FEWEST or known.min() < 0:
        return None
    dated = DATED[0] <= known.min() and known.max() < DATED[1]
    days = _days(known) if dated else np.zeros(len(known))
    if days is None:
        return None
    time = known % 1000000 if dated else known / (1000 if known.max() >= THOUSANDTHS else 1)
    if time.max() >= THOUSANDTHS or np.any(time % 100 >= 60) or np.any(time // 100 % 100 >= 60):
        return None
    clock = 3600 * (time // 10000) + 60 * (time // 100 % 100) + time % 100 + DAY * days
    if not dated:
        clock = clock + DAY * np.cumsum(np.diff(clock, prepend=clock[:1]) < -DAY / 2)
        if not _goes_on(time, clock):
            return None
    found = np.full(len(values), np.nan)
    found[np.isfinite(values)] = clock
    return found


def _days(numbers: np.ndarray) -> np.ndarray | None:
    """Days since the first (n,) of numbers that begin with a date; None where they are no dates."""
    date = numbers // 1000000
    year, month, day = date // 10000, date // 100 % 100, date % 100
    if np.any((month < 1) | (month > 12) | (day < 1) | (day > 31)):
        return None
    months = ((year - 1970) * 12 + month - 1).astype(int).astype("datetime64[M]")
    days = months.astype("datetime64[D]") + (day - 1).astype(int)
    return (days - days[0]) / np.timedelta64(1, "D")


def _goes_on(numbers: np.ndarray, clock: np.ndarray) -> bool:
    """Whether the clock [s] goes on evenly where the numbers jump."""
    steps, beyond = np.diff(clock), np.round(np.diff(numbers) - np.diff(clock))
    if not np.any(steps > 0) or np.any(steps < 0):
        return False
    if _evenness(steps) <= _evenness(np.diff(numbers)):  # it explains nothing that the numbers leave open
        return False
    usual, passages = float(np.median(steps[steps > 0])), steps[beyond != 0]
    rounding = float(np.all(numbers == np.round(numbers)))
    on = passages <= max(NEAR * usual, usual + rounding)
    on &= passages >= min(usual / NEAR, usual - rounding)
    return bool(np.mean(on) >= MOST and on.sum() >= (1 if numbers.max() >= SURE else 2))


def _evenness(steps: np.ndarray) -> float:
    """The share of steps that are near the usual one."""
    usual = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 0.0
    return float(np.mean((steps <= NEAR * usual) & (steps >= usual / NEAR)))
