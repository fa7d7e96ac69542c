"""Answers to what measurement files leave open: of the command line, one option for each question that look asks."""

from __future__ import annotations

import re
import shlex
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.files import validate
from ctrlgen.core.units import parse, to_si
from ctrlgen.recordings.formats.written_layout import Layout

NUMBER = r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
MULTIPLE = re.compile(rf"(?P<number>(?>{NUMBER}))\s*\*?\s*(?P<unit>(?:[^\W\d_]|[%\u00b0]).*)")
"""A unit of so many others: 0.6 nm a count, -1 um of an axis that counts the other way; 1/min is one alone."""


@dataclass(frozen=True)
class Answers:
    """`table` of files that hold several, from 1 or by name; `layout` as recording.toml writes it, and as it is read; `columns` by signal;
    `units` by signal or column, and `scales`: how much of it one is of their numbers, such as of counts; `time`: the column of it; `rate`,
    such as "1 kHz"; `poses`: the rows are settled poses."""

    table: int | str | None = None
    layout_text: str = ""
    layout: Layout | None = None
    columns: dict[str, str] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    scales: dict[str, float] = field(default_factory=dict)
    time: str | None = None
    rate: str | None = None
    poses: bool = False

    def unit(self, *names: str) -> str | None:
        """The unit that was stated for the first of the names that has one."""
        return next((self.units[name] for name in names if name in self.units), None)

    def scale(self, *names: str) -> float | None:
        """How much of its unit one is, as stated for the first of the names that has a unit; None where it has none."""
        return next((self.scales.get(name, 1.0) for name in names if name in self.units), None)


NOTHING = Answers()


def layout_option(key: str) -> str:
    """The option of look that says the same as a key of `layout` in recording.toml."""
    return f"--layout {shlex.quote(key)}"


def read_answers(
    table: str | None,
    layout: str | None,
    columns: Sequence[str],
    units: Sequence[str],
    time: str | None,
    rate: str | None,
    poses: bool,
) -> Answers:
    """The answers as options give them. Raises InputError for each that is none."""
    read = None
    if layout is not None:
        try:
            written = tomllib.loads(f"layout = {{ {layout} }}")["layout"]
        except tomllib.TOMLDecodeError as error:
            what = f"""is no list of keys: {error}; write --layout 'decimal = ","'"""
            raise InputError("--layout", [Fault(layout, what)]) from None
        read = validate(Layout, written, "--layout")
    stated, scales = _units(_pairs("--unit", units, "drive.axis=V"))
    if rate is not None:
        _known("--rate", rate, "Hz", rate)
    if sum((time is not None, rate is not None, poses)) > 1:
        raise InputError("--rate", [Fault("time", "give one of --time, --rate and --poses")])
    which = int(table) if table is not None and table.isdecimal() else table
    named = _pairs("--column", columns, "drive.axis=u")
    return Answers(which, layout or "", read, named, stated, scales, time, rate, poses)


def _units(texts: dict[str, str]) -> tuple[dict[str, str], dict[str, float]]:
    """Units by name and, of those with a number before them (0.6 nm a count), the number."""
    units, scales = dict[str, str](), dict[str, float]()
    for name, text in texts.items():
        match = MULTIPLE.fullmatch(text)
        units[name] = match["unit"] if match is not None else text
        _known("--unit", f"1 {units[name]}", units[name], text)
        if match is not None:
            scales[name] = float(match["number"])
            if not np.isfinite(scales[name]) or scales[name] == 0:
                raise InputError("--unit", [Fault(text, "must be a number other than zero and a unit, such as 0.6nm")])
    return units, scales


def _pairs(option: str, texts: Sequence[str], example: str) -> dict[str, str]:
    """NAME=VALUE by name; a name may hold an equals sign, a value not."""
    pairs = {}
    for text in texts:
        name, equals, value = text.rpartition("=")
        if not (name.strip() and equals and value.strip()):
            raise InputError(option, [Fault(text, f"must be NAME=VALUE, such as {example}")])
        pairs[name.strip()] = value.strip()
    return pairs


def _known(option: str, text: str, unit: str, typed: str) -> None:
    """Raises InputError, which shows what was `typed`, where `text` is no quantity above zero in a unit."""
    try:
        to_si(1.0, unit)
        if parse(text, unit) <= 0:
            raise ValueError("must be above zero")
    except ValueError as error:
        raise InputError(option, [Fault(typed, str(error))]) from None
