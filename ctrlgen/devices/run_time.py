"""The numbers of a device file that the generated controller is given when it starts: they differ from specimen to specimen, or drift."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, ValidationError

from ctrlgen.core.c_names import c_name
from ctrlgen.core.units import Quantity, base_unit, parse, show, to_si, written_unit
from ctrlgen.devices.quantities import member_at
from ctrlgen.devices.section import Section
from ctrlgen.effects import Effect

SHARE = 0.2  # of a number, by which it may differ from the file's where the file states no bounds
KELVINS = 20.0  # the same for a temperature, whose zero says nothing


class RunTimeNumber(Section):
    """A number that the generated controller is given when it starts, and the range in which it accepts it."""

    number: str
    """Its path in this file, such as "actuator.thermal_resistance" or "effect[0].gain"."""
    low: str | None = None
    """The smallest value that is accepted, with its unit; left out: 20 % below the file's, of a temperature 20 K."""
    high: str | None = None
    """The largest."""


class RunTime(Section):
    """`[run_time]`: the constants of the generated controller that are not compiled in, but given when it starts."""

    constants: tuple[
        Annotated[RunTimeNumber, BeforeValidator(lambda given: {"number": given} if isinstance(given, str) else given)],
        ...,
    ] = Field(min_length=1)
    """Paths of numbers of this file, or tables { number, low, high }; the file's own value is the default."""
    input: str | None = None
    """One of them that may change while the controller runs, such as a measured ambient temperature: the C then has a function for it."""


@dataclass(frozen=True)
class RunTimeConstant:
    """A constant that is given at the start: `path` in the file, `name` in C, default, `low` and `high` in SI, `unit` of the file."""

    path: str
    name: str
    default: float
    low: float
    high: float
    unit: str

    @property
    def base_unit(self) -> str:
        """Its unit in SI, as the C has it: the file's own where that is one."""
        is_si = to_si(0.0, self.unit) == 0.0 and to_si(1.0, self.unit) == 1.0
        return self.unit if is_si else base_unit(self.unit)

    @property
    def range_text(self) -> str:
        """The range as text, such as '450 ... 650 K/W'."""
        ends = [show(v, self.unit).removesuffix(f" {self.unit}") for v in (self.low, self.high)]
        return f"{ends[0]} ... {ends[1]} {'' if self.unit == '1' else self.unit}".strip()

    def shown(self, si: float, digits: int = 6) -> str:
        """The value `si` [SI] as text, in the unit of the device file."""
        return show(si, self.unit, digits)


def run_time_constants(device: Any) -> tuple[RunTimeConstant, ...]:
    """The run-time constants of a device. Raises ValueError naming everything that is wrong with its [run_time]."""
    stated: RunTime | None = device.run_time
    if stated is None:
        return ()
    numbers, constants, faults = dict(device.quantities()), list[RunTimeConstant](), list[str]()
    for entry in stated.constants:
        try:
            if entry.number in {constant.path for constant in constants}:
                raise ValueError("is named twice; name it once")
            name = _name_of(device, entry.number)
            while name in {constant.name for constant in constants}:
                name += "_2"
            constants.append(_constant(device, numbers, entry, name))
        except ValueError as error:
            faults.append(f"{entry.number}: {error}")
    if stated.input is not None and not faults and stated.input not in {constant.path for constant in constants}:
        faults.append(f"input: {stated.input!r} is not among the constants; add it to them, or leave input out")
    if faults:
        raise ValueError("run_time: " + "; ".join(faults))
    return tuple(constants)


def _constant(device: Any, numbers: dict[str, Quantity], entry: RunTimeNumber, name: str) -> RunTimeConstant:
    quantity = numbers.get(entry.number)
    if quantity is None:
        near = difflib.get_close_matches(entry.number, numbers, 1, 0.4)
        raise ValueError("is not a number of this file" + (f"; did you mean {near[0]}?" if near else ""))
    if quantity.whole:
        raise ValueError("is a count: it shapes the C and cannot change when it runs")
    unit = written_unit(quantity.text)
    absolute = base_unit(unit) == "K" and parse(f"0 {unit}", unit) != 0
    reach = KELVINS if absolute else SHARE * abs(quantity.si)
    if reach == 0 and (entry.low is None or entry.high is None):
        raise ValueError(f'is zero in the file; say how far it may be off: low = "-1 {unit}", high = "1 {unit}"')
    low, high = (
        quantity.si + side * reach if text is None else _parsed(key, text, unit)
        for key, text, side in (("low", entry.low, -1), ("high", entry.high, 1))
    )
    constant = RunTimeConstant(entry.number, name, quantity.si, low, high, unit)
    if not low < high:
        raise ValueError(f"low {constant.shown(low)} is not below high {constant.shown(high)}")
    if not low <= quantity.si <= high:
        raise ValueError(f"the file's {quantity.text} is not within {constant.range_text}; it is the default")
    for side, value in (("low", low), ("high", high)):
        if fault := _refused(device, entry.number, constant.shown(value, 9)):
            raise ValueError(f"{side}: {fault}")
    return constant


def _parsed(key: str, text: str, unit: str) -> float:
    try:
        return parse(text, unit)
    except ValueError as error:
        raise ValueError(f"{key}: {error}") from error


def _refused(device: Any, path: str, text: str) -> str:
    """What the section of a number says against another value; empty where it says nothing."""
    match = re.fullmatch(r"(.*)\.(\w+)", path)
    node = member_at(device, match[1]) if match else None
    if not match or not isinstance(node, Section):
        return ""
    try:
        type(node).model_validate(dict(node) | {match[2]: text})
    except ValueError as error:
        stated = error.errors() if isinstance(error, ValidationError) else [{"msg": str(error)}]
        return "; ".join(str(e["msg"]).removeprefix("Value error, ") for e in stated)
    return ""


def _name_of(device: Any, path: str) -> str:
    """A C identifier: the last word of the path, of an effect with its kind and where it acts."""
    match = re.fullmatch(r"effect\[(\d+)\]\.(\w+)", path)
    if match and int(match[1]) < len(device.effect):
        effect: Effect = device.effect[int(match[1])]
        words = (effect.kind, effect.at) if match[2] in effect.kind else (effect.kind, match[2], effect.at)
        return c_name("_".join(words))
    last = path.rpartition(".")[2]
    same = [p for p in paths_of(device) if p.rpartition(".")[2] == last]
    return c_name(last if len(same) == 1 else path)


def paths_of(device: Any) -> Iterator[str]:
    """The paths of the constants that a device names."""
    return (entry.number for entry in device.run_time.constants)
