"""An [[effect]] table of a device file: its keys, units and bounds."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import PydanticCustomError, core_schema

from ctrlgen.core.names import meant
from ctrlgen.core.units import Quantity, read_quantity, same_dimension, show, to_si, written_unit
from ctrlgen.effects._effect import Effect, Place
from ctrlgen.effects._installed import installed, law_of
from ctrlgen.effects._parameter import PLACEHOLDERS, Channel, Param

USUAL = {
    Place.DRIVE: "V",
    Place.HEAT: "W",
    Place.FORCE: "N",
}  # units of an example, where no device tells them; of others, um


def read_effect(given: Any) -> Effect:
    """The effect that a table describes. Raises ValueError naming everything that is wrong with the table.

    Units that depend on the channel are checked by `faults_at`, once the device is known.
    """
    if isinstance(given, Effect):
        return given
    if not isinstance(given, dict):
        raise ValueError("an effect is a table: [[effect]] with kind, at and its parameters")
    law = _law(given)
    keys = ["kind", "package", "at", *(["of"] if law.pairs else []), *(p.name for p in law.params)]
    faults = [f"unknown key {key!r} (has: {', '.join(keys[2:])})" for key in given if key not in keys]
    at, of = given.get("at"), given.get("of")
    if not isinstance(at, str):
        faults.append(
            f'at is missing: name the {law.place.value} channel, such as at = "1X", or "all", or such as "all in rad"'
        )
    if law.pairs and not isinstance(of, str):
        faults.append(f'of is missing: name the other {law.place.value} channel, such as of = "1Y"')
    values = {}
    for param in law.params:
        try:
            values[param.name] = _read_parameter(law, param, given)
        except ValueError as error:
            faults.append(str(error))
    if faults:
        raise ValueError(f"{law.kind}: " + "; ".join(faults))
    return law(str(at), values, of)


def _law(given: dict[str, Any]) -> type[Effect]:
    """The law of a table, of the package that it names. Raises ValueError that says what to install where there is none."""
    kind, package = given.get("kind"), given.get("package")
    law = law_of(kind) if isinstance(kind, str) else None
    if law is not None and package in (None, law.package):
        return law
    if law is not None:
        whose = f"the package {law.package}" if law.package else "ctrlgen itself"
        raise ValueError(f"package = {package!r}: {kind} is here a law of {whose}; name that one, or leave it out")
    if unusable := [each for each in installed().left_out if each.kind == kind]:
        raise ValueError("; ".join(map(str, unusable)))
    if isinstance(package, str):
        raise ValueError(
            f"{kind} is a law of the package {package}, which is not installed here or does not bring it; pip install {package}"
        )
    others = f"known are: {', '.join(sorted(Effect.library))}. A law of another package is known once that package is installed"
    raise ValueError(f"kind = {kind!r} is not a known effect; {meant(str(kind), Effect.library, others)}")


def _usual_units(law: type[Effect]) -> tuple[str, str, str, str]:
    """What stands for `PLACEHOLDERS` in an example, where no device tells it."""
    own = law.channel_unit if isinstance(law.channel_unit, str) else (law.channel_unit or ("",))[0]
    channel = {"m": "um", "rad": "urad"}.get(own, own) or USUAL.get(law.place, "um")
    partner = law.partner_unit if law.partner_unit not in (None, "channel") else channel
    return channel, "um", partner, "N"


def _read_parameter(law: type[Effect], param: Param, given: dict[str, Any]) -> Quantity:
    if param.name not in given:
        unit = param.unit
        for word, usual in zip(PLACEHOLDERS, _usual_units(law), strict=True):
            unit = unit.replace(word, usual)
        example = f"{param.example:.2g} {unit}".removesuffix(" 1")
        raise ValueError(f'{param.name} is missing ({param.doc}); write for example {param.name} = "{example}"')
    try:
        number = read_quantity(None if param.relative else param.unit, given[param.name])
    except ValueError as error:
        raise ValueError(f"{param.name}: {error}") from error
    if not param.relative:
        low, high = (to_si(bound, param.unit) for bound in param.bounds)
        if param.paced:
            low, high = param.at_any_pace(low, high)
        if not _is_between(number.si, low, high):
            raise ValueError(_outside(param, number, low, high, param.unit))
    return number


def faults_at(effect: Effect, channel: Channel) -> list[tuple[str, str]]:
    """(parameter, what is wrong with it) for units and bounds that depend on the channel."""
    faults = []
    for param in effect.params:
        if not param.relative:
            continue
        number, unit = effect.values[param.name], channel.unit_of(param)
        low, high = channel.allowed(param)
        if not same_dimension(written_unit(number.text), unit):
            faults.append((param.name, f"{number.text!r} has the wrong unit at {channel.name}: {unit} is needed"))
        elif not _is_between(number.si, low, high):
            faults.append((param.name, _outside(param, number, low, high, unit)))
    return faults


def _is_between(si: float, low: float, high: float) -> bool:
    rounding = 0.0 if math.inf in (-low, high) else 1e-12 * max(abs(low), abs(high))  # conversion between units rounds
    return low - rounding <= si <= high + rounding


def _outside(param: Param, number: Quantity, low: float, high: float, unit: str) -> str:
    if high == math.inf:
        return f"{param.name} = {number.text} must be {'positive' if low > 0 else 'zero or positive'}"
    return f"{param.name} = {number.text} is outside {show(low, unit)} ... {show(high, unit)}"


def effect_schema(title: str, before: tuple[str, ...]) -> dict[str, Any]:
    """JSON Schema of a table that states an effect, with the keys `before` of text, all of them required."""
    kinds = {"type": "string", "enum": sorted(Effect.library)}
    text = {"type": "string"}
    return {
        "type": "object",
        "title": title,
        "properties": {**dict.fromkeys(before, text), "kind": kinds, "package": text, "at": text, "of": text},
        "required": [*before, "kind", "at"],
    }


@dataclass(frozen=True)
class TableReader:
    """Tells pydantic how a table becomes what `read` makes of it, which raises ValueError; its JSON Schema is `effect_schema` of `title`
    and the keys `before`."""

    read: Callable[[Any], Any]
    title: str
    before: tuple[str, ...] = ()

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        def validate(given: Any) -> Any:
            try:
                return self.read(given)
            except ValueError as error:
                raise PydanticCustomError("effect", "{message}", {"message": str(error)}) from error

        return core_schema.no_info_plain_validator_function(validate)

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """The keys beside `kind`, `at` and `of` are the parameters of that kind of effect."""
        return effect_schema(self.title, self.before)


EffectTable = Annotated[Effect, TableReader(read_effect, "effect")]
