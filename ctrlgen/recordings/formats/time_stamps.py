"""Time as files write it: instants, ISO 8601 and other dates, seconds since an epoch. Read as seconds since the first."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.recordings.formats import half_day_clock
from ctrlgen.recordings.formats.layout_question import Ambiguous
from ctrlgen.recordings.formats.number_cells import CLOCK, DATE, MISSING, ZONES

DAY = 86400.0
HOUR = 3600.0
EVEN = 0.25  # of a step: how exactly an hour's jump must be an hour and one step to be summer time
SINCE_1970 = (9.46e8, 2.5e9)  # seconds: the years 2000 to 2049; those since 1904, of LabVIEW, are more
CENTURY = 4.1e9  # seconds: more is no time since a start, nor since 1904
EPOCHS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
SHORTEST_STEP = 1e-6  # seconds: no recorder that has run for some hours goes on in shorter steps
SHORT_STEP = 1e-3  # seconds: nor one that has run for a week
DAYS = {  # the years 2000 to 2049 in days, and the shortest step of a row that they would be in seconds
    "since 1970, as Matplotlib counts them": (10957.0, 29220.0, SHORTEST_STEP),
    "since 1900, as spreadsheets write dates": (36526.0, 54789.0, SHORTEST_STEP),
    "since the year 0, as MATLAB's datenum counts them": (730486.0, 748749.0, SHORT_STEP),
    "since 4713 BC, as Julian dates are": (2451544.0, 2469808.0, SHORT_STEP),
    "since 17 November 1858, as modified Julian dates are": (51544.0, 69808.0, SHORTEST_STEP),
}
HUNDREDS = {
    "1601": (1.2e17, 1.7e17),
    "the year 1": (6.1e17, 6.7e17),
}  # of nanoseconds: of Windows and of .NET, 1934 and later
HOURS = re.compile(r"(?<=[T ,;])(\d{1,2}):\d", re.ASCII)
STAMP = re.compile(rf"({DATE})?[T ,;]*({CLOCK})?\s*(Z|{ZONES}|[+-]\d{{2}}:?\d{{2}})?", re.ASCII)
BASIC = re.compile(r"^(\d{4})(\d\d)(\d\d)T(\d\d)(\d\d)(\d\d)", re.ASCII)  # ISO 8601 without marks
THOUSANDTHS = re.compile(r"(\d[T ]\d{1,2}:\d{2}:\d{2})[:;](\d{3})(?!\d)", re.ASCII)  # behind a date; of instruments
SHORT_YEAR = re.compile(r"^(\d{1,2}-[A-Za-z]{3})-(\d{2})(?!\d)", re.ASCII)  # 28-Feb-25, of Oracle and historians
ZONE = re.compile(rf"\s+({ZONES})$", re.ASCII)
EAST = {
    "UTC": 0, "GMT": 0, "WET": 0, "WEST": 1, "BST": 1, "CET": 1, "MEZ": 1, "CEST": 2, "MESZ": 2, "EET": 2, "EEST": 3, "EST": -5, "EDT": -4,
    "CST": -6, "CDT": -5, "MST": -7, "MDT": -6, "PST": -8, "PDT": -7, "JST": 9, "KST": 9,
}  # fmt: skip
"""Hours east of Greenwich of zones by their letters. Of those that two countries use only the difference to summer time matters here."""
# of a column; _time as InfluxDB writes it
TIME_NAME = re.compile(
    r"^_*(t|ts|x_value|millis|micros|time|zeit|tijd|temps|tempo|tiempo|\u0432\u0440\u0435\u043c\u044f|\u65f6\u95f4|\u6642\u9593|timestamp|time.?stamp|clock|datetime|date|elapsed.*|sekunden|seconds?|secs?)(?![a-z])",
    re.IGNORECASE,
)
PARTS = re.compile(r"(\d{1,4})[-./](\d{1,2})[-./](\d{1,4})", re.ASCII)


class Stamps(NamedTuple):
    """Seconds since the first time stamp (n,), how they were read, and when the first was: seconds since 1970, or since midnight."""

    values: np.ndarray
    notes: tuple[str, ...]
    begin: float


def seconds(column: np.ndarray, dates: str | None) -> Stamps | None:
    """A column of instants or of time stamps as seconds since the first; None for numbers.

    Raises ValueError, whose message goes on from the column's name, where a stamp is none or a date can be read two ways.
    """
    if column.dtype.kind == "M":
        return _instants(column, "time is instants", ())
    if column.dtype.kind != "O":
        return None
    cells = [re.sub(BASIC, r"\1-\2-\3T\4:\5:\6", c.strip()) if isinstance(c, str) else "" for c in column]
    cells = [re.sub(THOUSANDTHS, r"\1.\2", c) for c in cells]
    first = next((c for c in cells if c.lower() not in MISSING), "")
    if not (re.match(DATE, first, re.ASCII) or re.match(CLOCK, first, re.ASCII)):
        return None
    if not re.match(DATE, first, re.ASCII):
        return _times_of_day(cells)
    return _dates(cells, first, dates)


def _dates(cells: list[str], first: str, dates: str | None) -> Stamps:
    """Dates with a time of day. A zone is subtracted; without one, summer time shows as a jump of an hour."""
    iso = re.match(r"\d{4}[-/.]?\d{2}[-/.]?\d{2}", first)
    said, zoned = (
        ("time is ISO 8601" if iso else "time is dates"),
        bool(re.search(rf"(Z|{ZONES}|[+-]\d{{2}}:?\d{{2}})$", first)),
    )
    texts = [re.sub(r"(\d),(\d+)", r"\1.\2", re.sub(r"\s+(?=[+-]\d\d)", "", ZONE.sub(_offset, c))) for c in cells]
    notes: tuple[str, ...] = ()
    texts = [SHORT_YEAR.sub(r"\1-20\2", c) for c in texts]
    if iso:
        texts = [re.sub(r"^(\d{4})[/.](\d{2})[/.](\d{2})[ T]?", r"\1-\2-\3T", c) for c in texts]
        instants = _parsed(texts, "ISO8601")
    elif match := PARTS.match(first):
        style, notes = _order(texts, first, match, dates)
        instants = _parsed([re.sub(r"[-./]", "-", c, count=2) for c in texts], style)
    else:
        instants = _parsed(texts, "mixed")
    stamps = _instants(instants, said, notes)
    found = [HOURS.search(c) for c in texts]
    if not any(re.search(r"[AaPp]\.?[Mm]", c) for c in texts) and all(
        found[k] for k in np.flatnonzero(~np.isnat(instants))
    ):
        hours = [0 if match is None else int(match[1]) for match in found]
        if (days := half_day_clock.of_whole_days(stamps.values, hours)) is not None:
            first_of = float(days.values[np.isfinite(days.values)][0])
            later = np.timedelta64(round(first_of), "s")
            begun = _instants(instants + later, said, notes)
            told = (*begun.notes, half_day_clock.told(days))
            return Stamps(np.round(days.values - first_of, 12), told, begun.begin)
    return stamps if zoned else _without_summer_time(stamps)


def _offset(zone: re.Match[str]) -> str:
    return f"{EAST[zone[1]]:+03d}:00"


def _order(texts: list[str], first: str, match: re.Match[str], dates: str | None) -> tuple[str, tuple[str, ...]]:
    """The format of dates that do not begin with the year. Raises `Ambiguous` where day and month cannot be told and it matters."""
    found = [m for c in dict.fromkeys(c.split(" ")[0].split("T")[0] for c in texts) if (m := PARTS.match(c))]
    if dates is None and "." in match[0]:
        dates = "day first"
    if dates is None and any(int(m[1]) > 12 for m in found):
        dates = "day first"
    if dates is None and any(int(m[2]) > 12 for m in found):
        dates = "month first"
    if dates is None and len(found) > 1:  # one day is the same whichever way round
        what = f"writes dates such as {first!r}, and none tells the day from the month"
        raise Ambiguous(what, {'dates = "day first"': "", 'dates = "month first"': ""})
    day = "%m-%d" if dates == "month first" else "%d-%m"
    year = "%Y" if len(match[3]) == 4 else "%y"
    rest = first[match.end() :]
    hour = "%I" if re.search(r"[AaPp]\.?[Mm]", rest) else "%H"
    clock = f"{rest[0]}{hour}:%M" if rest.strip() else ""
    clock += ":%S" if rest.count(":") > 1 else ""
    clock += ".%f" if any(re.search(r":\d+\.\d", c) for c in texts) else ""
    clock += " %p" if hour == "%I" else ""
    clock += "%z" if re.search(r"[+-]\d{2}:?\d{2}$", texts[0]) else ""
    return f"{day}-{year}{clock}", ((f"dates have the {dates.replace(' first', '')} first",) if dates else ())


def _parsed(texts: list[str], style: str) -> np.ndarray:
    """Instants (n,) of stamps of one style, in UTC where they state a zone, not a time where a cell is empty. Raises ValueError."""
    import pandas  # takes half a second to import

    blank = [None if c.lower() in MISSING else c for c in texts]
    try:
        if style.endswith("%f") or ".%f" in style:  # whole seconds lose their fraction in some programs
            blank = [c if c is None or re.search(r":\d+\.\d", c) else re.sub(r"(:\d+:\d+)", r"\1.0", c) for c in blank]
        parsed = pandas.to_datetime(pandas.Series(blank, dtype=object), format=style, utc=True, errors="coerce")
    except (ValueError, OverflowError) as error:
        raise ValueError(f"holds time stamps that cannot be read: {error}") from None
    lost = (
        [k for k, cell in enumerate(blank) if cell is not None and parsed.isna().iloc[k]] if parsed.isna().any() else []
    )
    if lost:
        none = f"{len(lost)} of {number_of(len(texts), 'time stamp')} that {'is' if len(lost) == 1 else 'are'} none"
        what = f"holds {none}, such as {texts[lost[0]]!r} in row {lost[0]}"
        raise ValueError(f"{what}; write them as ISO 8601 (2024-03-31T01:59:58.000)")
    return parsed.dt.tz_localize(None).to_numpy()


def _instants(instants: np.ndarray, said: str, notes: tuple[str, ...]) -> Stamps:
    known = instants[~np.isnat(instants)]
    if not len(known):
        raise ValueError("holds no time at all")
    since = instants - known[0]
    values = np.where(np.isnat(instants), np.nan, _seconds_of(since))
    whole, _, fraction = str(known[0]).partition(".")
    begin = f"{whole}.{fraction.rstrip('0')}".rstrip(".")
    since_1970 = float(_seconds_of(known[:1] - np.datetime64(0, "s"))[0])
    return Stamps(values, (f"{said}; seconds since {begin}", *notes), since_1970)


def _seconds_of(spans: np.ndarray) -> np.ndarray:
    """Spans of time (n,) in seconds: three seconds are three, and the nanoseconds since 1970, which no float holds, are rounded once."""
    whole, rest = np.divmod(spans.astype("timedelta64[ns]").astype(np.int64), 10**9)
    return np.asarray(whole + rest / 1e9)


def _without_summer_time(stamps: Stamps) -> Stamps:
    """Stamps of a local clock that was put an hour forward or back: time goes on as evenly as before."""
    step = np.diff(stamps.values)
    short = step[np.abs(step) < HOUR / 2]
    usual = float(np.median(short)) if len(short) else 0.0
    if not 0 < usual < HOUR / 4:
        return stamps
    values, notes = stamps.values.copy(), list(stamps.notes)
    for way, said in ((1, "forward"), (-1, "back")):
        for k in np.flatnonzero(np.abs(step - way * HOUR - usual) < EVEN * usual).tolist():
            values[k + 1 :] -= way * HOUR
            notes.append(
                f"the clock is put {said} by an hour before row {k + 1}, as summer time does: time goes on evenly"
            )
    return Stamps(values, tuple(notes), stamps.begin)


def _times_of_day(cells: list[str]) -> Stamps:
    """Hours, minutes and seconds; midnight may pass. Raises ValueError for what is none, or two numbers that may be hours or minutes."""
    values, carried, last, notes = np.full(len(cells), np.nan), 0.0, -np.inf, list[str]()
    hours, hourless = [0] * len(cells), False
    for k, cell in enumerate(cells):
        if cell.lower() in MISSING:
            continue
        match = re.fullmatch(
            r"(?:(\d+) days? )?(\d{1,3}):(\d{2})(?::(\d{2}))?(?:[.,:;](\d+))?\s*([AaPp])?\.?[Mm]?\.?\s*Z?",
            cell,
            re.ASCII,
        )
        if match is None:
            raise ValueError(f"holds {cell!r} in row {k}, which is no time of day; write hours:minutes:seconds")
        if re.search(r":\d+:\d+:(?!\d{3}\b)", cell):
            raise ValueError(
                f"holds {cell!r}, whose last part is no thousandths of a second; write hours:minutes:seconds.fraction"
            )
        days, first, second, third, fraction, half = match.groups()
        hourless |= third is None
        if third is None and fraction is None:
            raise ValueError(
                f"holds {cell!r}, which may be hours and minutes or minutes and seconds; write hours:minutes:seconds"
            )
        high, low = int(first), int(second)
        if half and third is not None:
            high = high % 12 + (12 if half in "Pp" else 0)
        whole = 3600 * high + 60 * low + int(third) if third is not None else 60 * high + low
        time = DAY * int(days or 0) + whole + float(f"0.{fraction or 0}")
        if time + carried < last - DAY / 2:
            carried += DAY
            notes.append(f"midnight passes before row {k}")
        values[k] = last = time + carried
        hours[k] = high if third is not None and half is None and days is None else 0
    if not notes and (half_days := half_day_clock.of_whole_days(values, hours)) is not None:
        values, notes = half_days.values, [half_day_clock.told(half_days)]
    if hourless and np.isfinite(values).all() and np.any(falls := np.diff(values) < 0):
        usual = float(np.median(np.diff(values)))
        if np.all(np.abs(np.diff(values)[falls] + HOUR - usual) < EVEN * usual):  # else another run may begin
            values[1:] += HOUR * np.cumsum(falls)
            notes.append(f"an hour passes before row {int(np.flatnonzero(falls)[0]) + 1}")
    known = values[np.isfinite(values)]
    begin = float(known[0]) if len(known) else 0.0
    return Stamps(np.round(values - begin, 12), ("time is a time of day; seconds since the first", *notes), begin)


def from_first(column: np.ndarray, unit: str, scale: float) -> tuple[np.ndarray, tuple[str, ...]]:
    """Numbers (n,) as time since the first, without the rounding of a long epoch, and how they were read.

    Raises ValueError where they cannot be times in `scale` times `unit`: more than a century, but an epoch in another unit.
    """
    finite = column[np.isfinite(column.astype(float))]
    if not len(finite):
        return column.astype(float), ()
    values, size = (column - finite[0]).astype(float), float(finite[0])
    if unit not in EPOCHS:
        return values, ()
    if unit == "s" and scale == 1 and (since := days_since(column.astype(float))):
        what = f"begins at {size:.10g} and goes on in steps far too short for seconds: days {since}"
        raise ValueError(f'{what}: write unit = "day"')
    since = next((year for year, (low, high) in HUNDREDS.items() if low < size < high), "")
    if since and scale / EPOCHS[unit] > 2e-7:
        raise ValueError(f'holds hundreds of nanoseconds since {since}: write scale = 100, unit = "ns"')
    fitting = [name for name in EPOCHS if _in_epoch(size, name)]
    if not fitting or scale != 1:
        return values, ()
    instant = np.datetime64(int(size / EPOCHS[fitting[0]]), "s")
    if size / EPOCHS[unit] > CENTURY:
        what = f"begins at {size:.10g}, which in {unit} is more than a century, and in {fitting[0]} since 1970 is {instant}"
        raise ValueError(f'{what}: write unit = "{fitting[0]}"')
    return values, (f"time is {unit} since 1970; from {instant}",) if unit in fitting else ()


def days_since(values: np.ndarray) -> str:
    """Since when numbers count days, as programs write dates, where they are too close for seconds; empty where they do not."""
    known = values[np.isfinite(values)]
    steps = np.diff(known[:1000])
    step = float(np.median(steps)) if len(steps) > 1 else 0.0
    return next((since for since, (low, high, short) in DAYS.items() if 0 < step < short and low < known[0] < high), "")


def epoch_unit(values: np.ndarray) -> str | None:
    """The unit in which numbers are times since 1970, of the years 2000 to 2049, or days of a spreadsheet; None where they are not."""
    if len(values) and days_since(values):
        return "day"
    return next((unit for unit in EPOCHS if len(values) and _in_epoch(float(values[0]), unit)), None)


def _in_epoch(size: float, unit: str) -> bool:
    low, high = SINCE_1970
    return low <= size / EPOCHS[unit] <= high
