"""Answers to what measurement files leave open: of the command line, one option for each question that look asks."""

from __future__ import annotations

import shlex
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.files import validate
from ctrlgen.core.units import parse, to_si
from ctrlgen.recordings.formats.written_layout import Layout


@dataclass(frozen=True)
class Answers:
    """`table` of files that hold several, from 1 or by name; `layout` as recording.toml writes it, and as it is read; `columns` by signal;
    `units` by signal or column; `time`: the column of it; `rate`, such as "1 kHz"; `poses`: the rows are settled poses."""

    table: int | str | None = None
    layout_text: str = ""
    layout: Layout | None = None
    columns: dict[str, str] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    time: str | None = None
    rate: str | None = None
    poses: bool = False

    def unit(self, *names: str) -> str | None:
        """The unit that was stated for the first of the names that has one."""
        return next((self.units[name] for name in names if name in self.units), None)


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
    stated = _pairs("--unit", units, "drive.axis=V")
    for option, text, unit in [("--unit", f"1 {unit}", unit) for unit in stated.values()]:
        _known(option, text, unit)
    if rate is not None:
        _known("--rate", rate, "Hz")
    if sum((time is not None, rate is not None, poses)) > 1:
        raise InputError("--rate", [Fault("time", "give one of --time, --rate and --poses")])
    which = int(table) if table is not None and table.isdecimal() else table
    named = _pairs("--column", columns, "drive.axis=u")
    return Answers(which, layout or "", read, named, stated, time, rate, poses)


def _pairs(option: str, texts: Sequence[str], example: str) -> dict[str, str]:
    """NAME=VALUE by name; a name may hold an equals sign, a value not."""
    pairs = {}
    for text in texts:
        name, equals, value = text.rpartition("=")
        if not (name.strip() and equals and value.strip()):
            raise InputError(option, [Fault(text, f"must be NAME=VALUE, such as {example}")])
        pairs[name.strip()] = value.strip()
    return pairs


def _known(option: str, text: str, unit: str) -> None:
    try:
        to_si(1.0, unit)
        if parse(text, unit) <= 0:
            raise ValueError("must be above zero")
    except ValueError as error:
        raise InputError(option, [Fault(text, str(error))]) from None
