"""Units as measurement files write them: behind a name, in a row of their own, in words."""

from __future__ import annotations

import re
from functools import cache

from ctrlgen.core.units import base_unit, to_si

BEHIND = re.compile(r"^(?P<name>.*?)[\s_,:;/-]*[\[({<]\s*(?P<unit>[^\[\](){}<>]*?)\s*[\])}>]\s*$")
RATE = re.compile(
    r"^(?P<name>.*[^\s/])\s*[\s/]\s*(?P<unit>(?:[mun\u00b5\u03bcck]?m|[mun\u00b5\u03bc]?rad|deg|in|rev|1|l|K|N|V|A)/(?:ms|s\^?2|s\u00b2|s|min|h))$"
)
"""A unit with a stroke of its own, after a blank or the stroke of DIN 1313: speed rad/s, v / mm/s. The second is no unit of its own."""
SLASH = re.compile(r"^(?P<name>.*?\S)\s*/\s*(?P<unit>[^\s/]{1,8})$")  # of DIN 1313: U / mV
SURE = r"[mun\u00b5\u03bc]s|[mun\u00b5\u03bcp]m|[mkun\u00b5\u03bc][VA]|[mun\u00b5\u03bc]rad|rad|deg[CF]?|[kM]?Hz"
PLAIN = re.compile(rf"^(?P<name>.*[^\W_])(?:[_\s]+|\s+in\s+)(?P<unit>{SURE})$")
"""A unit after a blank or an underscore, of those that are no usual end of a name: time_ms, but not x_m or phase A."""
AFTER_MARK = re.compile(r"^(?P<name>.*[^\W_][)\]]?)(?:\s*[,:|]\s*|\s+[-\u2013\u2014]\s+)(?P<unit>[^\W\d_]{1,4})$")
"""The same after a comma, as GOST 2.105 writes it, a colon, a bar, or a dash between blanks: `voltage, V`."""
BESIDE = re.compile(
    r"(?P<unit>[^\W\d]\w*)\s*[*x\u00d7]\s*(?=\d)[\d.eE^+-]+|[*x\u00d7]\s*(?=\d)[\d.eE^+-]+\s*(?P<behind>[^\W\d]\w*)"
)
BEFORE = re.compile(r"^[\[({]\s*(?P<unit>[^\[\](){}]+?)\s*[\])}]\s*(?P<name>[^\W\d][^\[\](){}]*)$")
"""A unit in brackets in front of its name: [ms] time."""
SAID = re.compile(r"^(?P<name>.*?)(?:^|\s+)in\s+(?P<unit>[^\s()\[\]]{1,12})$")
"""A unit after a word: C1 in V, Zeit in s, and the `in s` of a column of time."""
UNKNOWN = re.compile(r"[\[({]\s*([^\[\](){}]*[^\W\d_][^\[\](){}]*?)\s*[\])}]\s*$")
"""What stands in brackets behind a name and is no unit, nor a number of a list."""
WORDS = {
    "second": "s", "seconds": "s", "sec": "s", "secs": "s", "sekunde": "s", "sekunden": "s", "millisecond": "ms",
    "milliseconds": "ms", "msec": "ms", "microseconds": "us", "usec": "us", "volt": "V", "vdc": "V", "volts": "V", "millivolt": "mV",
    "amp": "A", "amps": "A", "ampere": "A", "amperes": "A", "metre": "m", "meter": "m", "metres": "m", "meters": "m",
    "micron": "um", "microns": "um", "micrometer": "um", "micrometers": "um", "micrometre": "um", "nanometer": "nm",
    "degrees": "deg", "degree": "deg", "°": "deg", "°c": "degC", "ºc": "degC", "celsius": "degC",
    "newton": "N", "newtons": "N", "hertz": "Hz", "watt": "W", "watts": "W", "kelvin": "K", "arcsec": "arcsecond",
    "rpm": "rpm", "r/min": "rpm", "rev/min": "rpm", "u/min": "rpm", "rev": "turn", "revs": "turn", "rev/s": "turn/s", "rps": "turn/s",
    "dps": "deg/s", "%fs": "percent", "% fs": "percent", "%f.s.": "percent", "pct": "percent", "\u00e5": "angstrom",
    "msek": "ms", "mikrosekunden": "us", "n.m": "N*m", "torr": "torr", "ohms": "ohm", "radian": "rad", "radians": "rad", "hz": "Hz",
    "khz": "kHz", "%": "percent",
    "millisekunden": "ms", "mikrometer": "um", "nanometre": "nm", "millivolts": "mV",
    "\u0441": "s", "\u043c\u0441": "ms", "\u043c\u043a\u0441": "us", "\u0432": "V", "\u043c\u0432": "mV", "\u043c\u043a\u043c": "um",
    "\u79d2": "s", "\u6beb\u79d2": "ms", "\u5fae\u79d2": "us", "\u7eb3\u7c73": "nm", "\u5fae\u7c73": "um", "\u6beb\u7c73": "mm",
    "\u4f0f": "V", "\u043d\u043c": "nm", "\u043c\u043c": "mm", "\u0433\u0446": "Hz",
}  # fmt: skip
LETTERS = {
    "C": "degC", "g": "g_0", "mil": "thou", "mils": "thou",  # of a log: neither coulombs nor grams nor a mil of angle
    "Gs": "gauss", "as": "arcsecond", "px": "pixel", "ue": "microstrain", "\u00b5": "um", "\u03bc": "um", "Ohm": "ohm",
    "S": "s", "MS": "ms", "US": "us", "MM": "mm", "Mm": "mm", "UM": "um", "MV": "mV", "MA": "mA", "mS": "ms", "uS": "us",
    "\u00b5S": "us", "\u03bcS": "us",  # no log is in siemens, MV or Mm
    "Nm": "N*m", "mNm": "mN*m", "Ncm": "N*cm", "Nmm": "N*mm", "kNm": "kN*m",
}  # fmt: skip
SCALED = re.compile(r"(?P<number>\d*\.?\d+(?:[eE][+-]?\d{1,2})?|10\^[+-]?\d{1,2})\s*[*\u00b7]?\s*(?P<unit>[^\W\d].*)")
"""A unit of so many others: numbers in 0.1 ms, in 1e-6 m."""
POWER = re.compile(r"(?<=[A-Za-z])[23]\b")  # of a unit: m/s2, mm2
SIGNS = {"µ": "u", "μ": "u", "²": "^2", "³": "^3", "·": "*", "°": "deg", "Ω": "ohm"}
STRANGE = re.compile(r"[^\w/*^%().\s+-]|\^.*\^|\*\*|\d{2}")  # no unit of a log; a tower of powers has no end
COUNTS = {
    "inc",
    "incs",
    "increments",
    "ct",
    "cts",
    "cnt",
    "cnts",
    "lsb",
    "digit",
    "digits",
    "step",
    "steps",
    "pulse",
    "pulses",
    "tick",
    "ticks",
    "sequence",
    "sample",
    "samples",
    "point",
    "points",
    "index",
    "count",
    "counts",
    "row",
    "nr",
    "no.",
}
NONE = {"", "-", "--", "1", "none", "n/a", "n.a.", "unitless", "a.u.", "arb", "arb.", "[]", "()", *COUNTS}
BASES = {"m", "rad", "K", "N", "W", "V", "A", "s", "Hz", "Pa", "kg", "ohm", "1"}
NAMES = {"t", "u", "x", "y", "z", "h", "a", "b", "d", "r", "c", "e", "f", "g", "i", "l", "p", "q", "v", "w"}
LETTERS_OF_NAMES = NAMES - {"h", "d", "g"}  # behind a name they are rather another name than tonnes or atomic masses
LONGEST = 40  # characters of a unit in a file: more is a remark


@cache
def unit_of(text: str) -> str | None:
    """The unit that a text of a file states, as ctrlgen writes it, '1' for a count; None for a text that is no unit."""
    bare = (
        text.replace("\u00c2", "").strip().strip("[](){}<>").strip()
    )  # of a text in UTF-8 that was written as Latin-1 once more
    if len(bare) > LONGEST:
        return None
    since = re.fullmatch(r"(\w+) since .*", bare)  # CF conventions: "seconds since 2024-01-01"
    if since:
        return unit_of(since[1])
    if bare.lower() in COUNTS:
        return "1"
    bare = LETTERS.get(bare) or WORDS.get(bare.lower(), bare)
    for sign, plain in SIGNS.items():
        bare = bare.replace(sign, plain)
    bare = POWER.sub(lambda power: f"^{power[0]}", bare)
    if not bare or not re.search(r"[A-Za-z%]", bare) or STRANGE.search(bare):
        return None
    try:
        to_si(1.0, bare)
    except (ValueError, OverflowError):
        return None
    return bare


def scaled_unit(text: str) -> tuple[float, str] | None:
    """A unit of so many others: `0.1 ms` is (0.1, "ms"); None for any other text.

    A plain number from 1 on is one of time alone: elsewhere it is rather a measuring range, `10 V` of an input, than a unit.
    """
    bare = text.strip().strip("[](){}<>").strip()
    match = SCALED.fullmatch(bare) if len(bare) <= LONGEST else None
    unit = None if match is None else unit_of(match["unit"])
    if match is None or unit is None or unit == "1":
        return None
    number = float(match["number"].replace("10^", "1e"))
    is_power = match["number"].startswith("10^") or "e" in match["number"].lower()
    return (number, unit) if 0 < number < 1 or is_power or (number > 0 and base_unit(unit) == "s") else None


def unclear_factor(text: str) -> bool:
    """Whether a unit stands beside a factor that may multiply or divide it: `nm x 10`."""
    match = BESIDE.fullmatch(text.strip().strip("[](){}<>").strip()) if len(text) <= LONGEST else None
    return match is not None and unit_of(match["unit"] or match["behind"]) is not None


def is_unit_cell(text: str) -> bool:
    """Whether a cell of a row of units may be one: a unit, a word for none, or anything in brackets."""
    bare = text.strip()
    if bare.lower() in NONE or re.fullmatch(r"\[[^\]]*\]|\([^)]*\)", bare):
        return True
    unit = unit_of(bare)
    return unit is not None and (unit == "1" or base_unit(unit) in BASES or "/" in unit)


def is_unit_row(cells: list[str]) -> bool:
    """Whether a row under the names states units: every cell may be one, and one is that is no usual name of a column."""
    stated = [c for c in cells if c.strip().lower() not in NONE]
    sure = [c for c in stated if c.strip().lower() not in NAMES or c.strip() in ("V", "A", "N", "W", "K", "C")]
    return bool(stated) and all(map(is_unit_cell, cells)) and bool(sure)


def split_name(name: str) -> tuple[str, str | None]:
    """A name and the unit behind it: 'Channel 1 (mV)' is 'Channel 1' in mV; the unit as it stands there, None where there is none."""
    if match := BEHIND.match(name):
        square, unit = name.rstrip().endswith("]"), match["unit"]
        stated = unit_of(unit) is not None or scaled_unit(unit) is not None
        if square or (unit not in LETTERS_OF_NAMES and stated and not _is_of_a_node(name, unit)):
            return match["name"].strip(), match["unit"] or None
    if (match := BEFORE.match(name)) and unit_of(match["unit"]) is not None:
        return match["name"], match["unit"]
    if (match := SAID.match(name)) and match["unit"] not in LETTERS_OF_NAMES and is_unit_cell(match["unit"]):
        return match["name"].strip() or name, match["unit"]
    if match := PLAIN.match(name):
        return match["name"].removesuffix(" in").strip(), match["unit"]
    if match := RATE.match(name):
        return match["name"].removesuffix(" in").strip(), match["unit"]
    if (match := AFTER_MARK.match(name)) and _is_sure(match["unit"]):
        return match["name"].strip(), match["unit"]
    if (match := SLASH.match(name)) and match["unit"] not in LETTERS_OF_NAMES and is_unit_cell(match["unit"]):
        return match["name"].strip(), match["unit"]
    return name, None


def _is_sure(unit: str) -> bool:
    """Whether letters behind a mark are a unit and no usual end of a name, such as the A of a phase."""
    return (
        bool(re.fullmatch(SURE, unit)) or unit in ("s", "V", "N") or (not unit.isascii() and unit_of(unit) is not None)
    )


def _is_of_a_node(name: str, unit: str) -> bool:
    """Whether a name is a voltage or a current of a circuit's node, as SPICE writes them: V(in) is no inch."""
    return name[:2] in ("V(", "I(") and base_unit(unit_of(unit) or "1") != name[0]


def bare_name(name: str) -> str:
    """A column's name without the unit behind it."""
    return split_name(name)[0]


def unit_lacks(name: str) -> str:
    """Why the name of a column without a unit states none."""
    behind = UNKNOWN.search(name)
    return "the file states no unit" if behind is None else f"its unit {behind[1]!r} is not known"
