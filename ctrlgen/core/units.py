"""Numbers with units in files and reports, SI numbers in the program; pint converts.

A `Quantity` keeps the text of the file, so that a file can be written back and a report shows the unit its author used.
"""

from __future__ import annotations

import math
import re
import reprlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

from annotated_types import GroupedMetadata
from pydantic import BeforeValidator, PlainSerializer, WithJsonSchema

from ctrlgen.core.errors import ExampleGiven, WrongUnit
from ctrlgen.core.known_units import KNOWN, UNCLEAR, UNKNOWN
from ctrlgen.core.to_digits import to_digits

if TYPE_CHECKING:
    import pint

_NUMBER = re.compile(r"^\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|nan|[+-]?inf)\s*(.*?)\s*$", re.IGNORECASE)


@cache
def _registry() -> pint.UnitRegistry[Any]:
    import pint  # takes a fifth of a second to import, its definitions as long to read

    registry: pint.UnitRegistry[Any] = pint.UnitRegistry(
        autoconvert_offset_to_baseunit=True, cache_folder=None, on_redefinition="ignore"
    )
    # a dimension of its own: rpm is not Hz, and a plain number is not an angle
    registry.define("radian = [angle] = rad")
    registry._build_cache()  # degrees and milliradians still refer to the radian that was replaced
    return registry


LONGEST_UNIT = 200
"""Letters of a unit, products that are made of units of a file included."""
MOST_FACTORS = 20
"""Names and numbers in a unit."""
LARGEST_POWER = 12.0
"""Of a unit in a unit; second moments of area have 4."""
LARGEST = {
    "m": 1e4,
    "s": 1e9,
    "kg": 1e6,
    "K": 1e5,
    "rad": 1e4,
    "Hz": 1e12,
    "V": 1e7,
    "A": 1e6,
    "W": 1e9,
    "N": 1e9,
    "Pa": 1e15,
}
"""The largest magnitudes [SI] that a machine of the size of a nanopositioner can have, far above what any has: a stage of 10 km."""
LARGEST_OTHER = 1e30
"""Of other dimensions: its products stay finite, also in single precision."""
NAMED = ("m", "rad", "K", "N", "W", "V", "A", "s", "Hz", "Pa", "kg", "ohm", "1")
"""Units of SI with a name; of two that measure the same the first is meant."""
SMALLEST = 1e-60
"""Below it [SI], a number that is not zero: its inverse squared stays finite."""
_WORD = r"[^\W\d]\w*|[%°]|\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+"
_UNIT = re.compile(rf"(?:\s|{_WORD}|\*\*|[*/^()+-])*")
_POWER = re.compile(r"(?:\^|\*\*)\s*[+-]?\s*(?:\(\s*[+-]?\d\s*/\s*\d\s*\)|(\d+\.?\d*))(?!\s*(?:\^|\*\*))")


def _check_unit(text: str) -> None:
    """Raises ValueError for a text that is no product of powers, and for one that would take long to reckon with, such as um^9^9^9."""
    if len(text) > LONGEST_UNIT:
        raise ValueError(f"a unit of {len(text)} letters is not one I know; write one such as um or N/um")
    if not _UNIT.fullmatch(text):
        raise ValueError(f"{reprlib.repr(text)} is not a unit I know")
    if word := next((word for word in re.findall(_WORD, text) if word in UNCLEAR), None):
        raise ValueError(f"{word!r} in a unit can mean several things; write {UNCLEAR[word]}")
    if word := next((word for word in re.findall(_WORD, text) if word in UNKNOWN), None):
        raise ValueError(f"{word!r} is not a unit I know; write {UNKNOWN[word]}")
    powers = _POWER.findall(text)
    if len(powers) < len(re.findall(r"\^|\*\*", text)) or any(float(power or 0) > LARGEST_POWER for power in powers):
        raise ValueError(
            f"{text!r} is not a unit I know: a power in it is one number up to {LARGEST_POWER:g}, as in um^2"
        )
    if len(re.findall(_WORD, text)) > MOST_FACTORS:
        raise ValueError(f"{text!r} has more than {MOST_FACTORS} factors; write a simpler unit")


@cache
def _unit(text: str) -> pint.Unit:
    """The pint unit of `text`; '1' and '' are dimensionless. Raises ValueError if unknown."""
    _check_unit(text.strip())
    try:
        return _registry().Unit("" if text == "1" else f"1{text}" if text.startswith("/") else text)
    except Exception as error:  # pint raises a dozen different types for bad unit text
        raise ValueError(f"'{text}' is not a unit I know") from error


@cache
def _affine(unit: str) -> tuple[float, float]:
    """(scale, offset) with SI = scale * value + offset, from pint's conversion of 0 and 1."""
    if (known := KNOWN.get(unit or "1")) is not None:
        return known[:2]
    base = _unit(unit)
    try:
        zero, one, two = (
            float(_registry().Quantity(value, base).to_base_units().magnitude) for value in (0.0, 1.0, 2.0)
        )
    except (OverflowError, ZeroDivisionError):
        zero = one = two = math.nan
    if abs(two - 2 * one + zero) > 1e-9 * (abs(one) + abs(zero)):  # decibels
        raise ValueError(f"{unit!r} is a logarithm; write the ratio that it stands for")
    if not math.isfinite(one) or not SMALLEST < abs(one - zero) < 1 / SMALLEST:
        raise ValueError(f"{unit!r} is too large or too small a unit to reckon with")
    return one - zero, zero


def to_si(value: float, unit: str) -> float:
    """`value` in `unit` as an SI number; temperatures in degC become kelvin."""
    scale, offset = _affine(unit)
    return value * scale + offset


def from_si(value: Any, unit: str) -> Any:
    """An SI number or array expressed in `unit`."""
    scale, offset = _affine(unit)
    return (value - offset) / scale


def difference(value: Any, unit: str) -> Any:
    """An SI difference expressed in `unit`; the offset of a temperature scale does not count."""
    return value / _affine(unit)[0]


def difference_unit(unit: str) -> str:
    """The unit of differences of quantities in `unit`, as files state it: 'degC' -> 'delta_degC', 'um' -> 'um'."""
    return f"delta_{unit}" if _affine(unit)[1] else unit


def shown_difference_unit(unit: str) -> str:
    """The unit of differences of quantities in `unit`, as reports show it: 'degC' -> 'K', 'degF' -> 'delta_degF', 'um' -> 'um'."""
    scale, offset = _affine(unit)
    return "K" if offset and scale == 1 else difference_unit(unit)


def base_unit(unit: str) -> str:
    """The SI unit of a quantity given in `unit`: 'um' -> 'm', 'degC' -> 'K', 'W' -> 'W'."""
    if (known := KNOWN.get(unit or "1")) is not None:
        return known[2]
    for name in NAMED:
        if same_dimension(unit, name):
            return name
    return f"{_registry().Quantity(1.0, _unit(unit)).to_base_units().units:~}"


def common_base_unit(units: Sequence[str]) -> str:
    """The SI unit of a vector given in `units`, such as "m"; "SI" where its components differ."""
    found = set(map(base_unit, units))
    return found.pop() if len(found) == 1 else "SI"


def exponents(unit: str) -> dict[str, int] | None:
    """Powers of kg, m, s, A, K, mol, cd, rad in an SI unit, {"kg": 1, "m": 1, "s": -2} for 'N'; None where it is not a product of these."""
    named = dict(kilogram="kg", meter="m", second="s", ampere="A", kelvin="K", mole="mol", candela="cd", radian="rad")
    powers: Any = (
        _registry().Quantity(1.0, _unit(unit)).to_base_units()._units.items()
    )  # typed as any number, complex too
    if any(name not in named or power != int(power) for name, power in powers):
        return None
    return {named[name]: int(power) for name, power in powers}


def same_dimension(unit: str, other: str) -> bool:
    """Whether two unit texts measure the same kind of quantity."""
    known, also = KNOWN.get(unit or "1"), KNOWN.get(other or "1")
    if known is not None and also is not None:
        return known[2] == also[2]
    return bool(_unit(unit).dimensionality == _unit(other).dimensionality)


@dataclass(frozen=True)
class Quantity:
    """A number with its unit: `si` in SI, `text` as written, `source` where it comes from.

    `sd` is the standard deviation in SI, None where the file states none. `whole` marks a count.
    """

    si: float
    text: str
    source: str | None = None
    sd: float | None = None
    whole: bool = False


def parse(text: object, unit: str) -> float:
    """The SI number of a text: '130 GPa' for the unit 'Pa' gives 1.3e11. Raises ValueError that says what to write instead.

    Angles are a dimension of their own: a plain number is not an angle, and rpm is not Hz.
    """
    if isinstance(text, bool) or not isinstance(text, (str, int, float)):
        raise ValueError(f'write a number with its unit, such as "1 {unit}", not {reprlib.repr(text)}')
    if isinstance(text, str):
        match = _NUMBER.match(text)
        if not match:
            raise ExampleGiven(f'{reprlib.repr(text)} does not start with a number; write for example "1 {unit}"')
        value, written = float(match[1]), match[2]
    else:
        value, written = (float(text) if abs(text) < LARGEST_OTHER else math.inf), ""
    if not math.isfinite(value):
        raise ValueError(f"{reprlib.repr(text)} is not a finite number")
    absolute = unit in ("degC", "degF", "K")
    _check_written(str(text), f"{value:g} {unit}", written)
    if (written == "" and unit != "1") or (absolute and "delta" in written) or not same_dimension(written, unit):
        if written == "":
            raise WrongUnit(f"{text!r} has no unit", f'write for example "{value:g} {unit}"', ";")
        needed, behind = ("a plain number", "") if unit == "1" else (unit, f" {unit}")
        raise WrongUnit(f"{text!r} has the wrong unit", f'{needed} is needed, for example "{value:g}{behind}"', ":")
    si = to_si(value, written)
    if not abs(si) <= largest(unit):
        raise ValueError(f"{text!r} is far too large; {show(largest(unit), unit)} is the most that is read")
    if 0 < abs(si) < SMALLEST:
        raise ValueError(f"{text!r} is too small to reckon with; write 0 where nothing is meant")
    return si


def _check_written(text: str, example: str, written: str) -> None:
    """Raises ValueError, with an `example` of what to write, where what is `written` behind the number of a text is no unit."""
    try:
        _affine(written)
    except ValueError as error:
        why = f"{text!r} has a decimal comma; write a point" if written[0] == "," else str(error)
        raise ValueError(why) if "write" in why else WrongUnit(why, f'write for example "{example}"', ";") from None


@cache
def largest(unit: str) -> float:
    """The largest magnitude [SI] that is read of a quantity in `unit`."""
    return LARGEST.get(base_unit(unit), LARGEST_OTHER)


def parse_difference(text: str, unit: str) -> float:
    """The SI number of a difference of quantities in `unit`: of temperatures '1 K', '1 degC' and '1 delta_degC' are the same.

    Raises ValueError as `parse`.
    """
    written = written_unit(text)
    if _affine(written)[1]:
        text = text.replace(written, difference_unit(written))
    return parse(text, "delta_degC" if same_dimension(unit, "K") else unit)


def _bounds_text(unit: str, low: float | None, high: float | None, low_open: bool) -> str:
    """The bounds as text, such as '> 0 um and <= 100 um'; empty where nothing is bounded."""
    side = ">" if low_open else ">="
    parts = [] if low is None else [f"{side} {show(low, unit)}"]
    return " and ".join(parts + ([] if high is None else [f"<= {show(high, unit)}"]))


def _own_unit(text: object) -> str:
    """The unit that a number is written in, one that begins at zero. Raises ValueError."""
    unit = written_unit(str(text))
    if to_si(0.0, unit):
        raise ValueError(f"{text!r} does not count from zero; write it in a unit that does, such as K")
    return unit


def is_share(sd: object, value: str) -> bool:
    """Whether a standard deviation is a share of the `value`, such as '5 %'; of a value that is itself in per cent it is a difference."""
    return isinstance(sd, str) and written_unit(sd) == "%" and written_unit(value) != "%"


def share_of(sd: str, si: float, value: str) -> float:
    """The standard deviation [SI] of the `value`, `si` in SI, of which `sd` is a share. Raises ValueError."""
    unit = written_unit(value)
    if si == 0 or to_si(0.0, unit):
        what = f'sd = "{sd}" is a share of {value}, which does not count from a zero of its own'
        raise ValueError(f'{what}; write a difference, such as "1 {shown_difference_unit(unit)}"')
    return parse(sd.removesuffix("%").strip(), "1") / 100 * abs(si)


def _deviation(sd: object, si: float, value: str, unit: str) -> float:
    """A standard deviation [SI] as the file states it, a difference in `unit` or a share of the value. Raises ValueError."""
    deviation = share_of(str(sd).strip(), si, value) if is_share(sd, value) else parse_difference(str(sd), unit)
    if deviation < 0:
        raise ValueError(f"sd = {sd!r} is negative")
    return deviation


def _reader(
    wanted: str | None, low: float | None, high: float | None, low_open: bool, whole: bool = False
) -> Callable[[Any], Quantity]:
    def read(given: Any) -> Quantity:
        if isinstance(given, Quantity):
            return given
        table = given if isinstance(given, dict) else {"value": given}
        unknown = sorted(set(table) - {"value", "source", "sd"})
        if unknown:
            raise ValueError(f"unknown key {unknown[0]!r}; a quantity has value, source and sd")
        if "value" not in table:
            raise ValueError(f'no value; write {{ value = "1 {wanted or "um"}", source = "..." }}')
        unit = wanted or _own_unit(table["value"])
        si = parse(table["value"], unit)
        if (low is not None and (si < low or (low_open and si == low))) or (high is not None and si > high):
            raise ValueError(
                f"{table['value']!r} is out of bounds; it must be {_bounds_text(unit, low, high, low_open)}"
            )
        if whole and si != round(si):
            raise ValueError(f"{table['value']!r} is not a whole number, and this is a count")
        sd = None
        if "sd" in table:
            sd = _deviation(table["sd"], si, str(table["value"]), unit)
        source = table.get("source")
        if source is not None and not isinstance(source, str):
            raise ValueError(f"source = {source!r} must be text")
        return Quantity(si, " ".join(str(table["value"]).split()), source, sd, whole)

    return read


def written_unit(text: str) -> str:
    """The unit in the text of a quantity: 'um' of '3 um', '1' of '0.5'."""
    match = _NUMBER.match(text)
    return (match[2] if match else "") or "1"


@cache
def split_unit(unit: str, words: tuple[str, ...]) -> tuple[dict[str, float], str]:
    """Powers of the placeholder `words` in `unit`, and the unit that is left without them.

    ({"channel": 1.0, "travel": -2.0}, "s ** 2") for 'channel*s^2/travel^2'.
    """
    from pint.util import UnitsContainer, to_units_container

    powers: Any = UnitsContainer(to_units_container(unit))  # its powers are typed as any number, complex too
    placed = {word: float(power) for word, power in powers.items() if word in words}
    return placed, str(powers.remove(placed))


def read_quantity(unit: str | None, given: Any) -> Quantity:
    """A quantity of a file, in `unit`, or in the unit it is written in where `unit` is None. Raises ValueError."""
    if unit is None:
        value = given.get("value") if isinstance(given, dict) else given
        unit = written_unit(str(value))
    return _reader(unit, None, None, False)(given)


ANY_UNIT = "any"  # of a number without a unit of its own, in the JSON schema


@dataclass(frozen=True)
class In(GroupedMetadata):
    """What a number of a file must be: `Annotated[Quantity, In("um", positive=True)]`, with bounds given in SI.

    `positive` means strictly above zero, `whole` a count. Without a `unit` any is accepted that begins at zero; what reads the
    number then says which dimension it must have.
    """

    unit: str | None
    low: float | None = None
    high: float | None = None
    positive: bool = False
    whole: bool = False

    def __iter__(self) -> Iterator[object]:
        """Pydantic's annotations: how it is read, written and described in the JSON schema."""
        lowest = 0.0 if self.positive else self.low
        schema: dict[str, Any] = {
            "type": ["string", "number", "object"],
            "title": "quantity",
            "x-unit": self.unit or ANY_UNIT,
        }
        bounds = _bounds_text(self.unit or "1", lowest, self.high, self.positive)
        schema |= {"x-bounds": bounds} if bounds else {}
        schema |= {"x-whole": True} if self.whole else {}
        yield BeforeValidator(_reader(self.unit, lowest, self.high, self.positive, self.whole))
        yield PlainSerializer(lambda q: q.text)
        yield WithJsonSchema(schema)


def read_probability(text: str) -> float:
    """0.999 for '99.9 %' and for '0.999'. Raises ValueError that says what to write instead."""
    body = text.strip()
    try:
        return float(body.removesuffix("%")) / (100 if body.endswith("%") else 1)
    except ValueError:
        raise ValueError(f'{text!r} is not a probability; write "99.9 %" or 0.999') from None


def show(si: float, unit: str, digits: int = 4) -> str:
    """The text of an SI number in `unit`, such as '31.53 um'; without a power of ten below a million: '15000 um'."""
    return f"{to_digits(from_si(si, unit), digits)} {unit if unit != '1' else ''}".strip()


def show_difference(si: float, unit: str, digits: int = 4) -> str:
    """The text of an SI difference of quantities in `unit`, such as '3 K' where the unit is degC."""
    return show(si, shown_difference_unit(unit), digits)
