"""The one extension point: a physical effect is one symbolic term at one place.

Adding an effect is adding one file to `ctrlgen/effects/`: a subclass of `Effect` with its
equation in the docstring, its parameters, and `term` (and `rates` if it remembers). Simulation,
inversion, solving and generated C all read it from there.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from enum import Enum
from types import SimpleNamespace
from typing import Any, ClassVar

import casadi as ca
import numpy as np
from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import PydanticCustomError, core_schema

from ctrlgen.core.units import Quantity, power_of, read_quantity, same_dimension, show, to_si, written_unit

MARKERS = {"channel": "candela", "travel": "mole", "partner": "ampere"}  # base units that no law is written in


class Place(Enum):
    """Where a term is added on the way from command to reading."""

    DRIVE = "drive"  # on what the amplifier delivers to an actuator
    HEAT = "heat"  # on what arrives in an actuator: the heater's power, whatever the drive is
    FORCE = "force"  # on the actuator bar, positive along the actuator's push
    DISPLACEMENT = "displacement"  # between the stage and the mechanism it carries
    POSE = "pose"  # between the mechanism and the platform
    SENSOR = "sensor"  # between the platform and the reported pose


@dataclass(frozen=True)
class Param:
    """One number of a law, with `bounds` in its `unit`; at `off` the whole effect vanishes.

    In `unit` the word `channel` stands for the unit of the signal the effect acts on, `travel` for that of the stage
    displacement and `partner` for that of the other channel of a pair; `bounds` and `grid` then count in typical
    sizes of those signals, so that one law serves micrometres and degrees. `grid` are the values tried when a shape
    is unknown and the effect is only suspected. A `level` is where a signal meets a limit: its grid counts in peaks of
    that signal, of the travel or of its rate in the records at hand, or, of a time, in twelfths of their length. What the
    records themselves suggest of the kind `seen` is tried too: "pitches" of the path, "moments" in time. An amplitude
    outside what is `usual` is something else; one with a `grid` acts in proportion nowhere near `off`, and is screened by
    what it does at those values.
    """

    name: str
    unit: str
    bounds: tuple[float, float]
    doc: str
    off: float | None = None
    grid: tuple[float, ...] = ()
    expected: tuple[float, float] | None = None
    level: bool = False
    seen: str = ""
    usual: tuple[float, float] | None = None

    @property
    def relative(self) -> bool:
        """Whether the unit depends on where the effect acts."""
        return any(word in self.unit for word in MARKERS)


@dataclass(frozen=True)
class State:
    """A memory of the effect, zero at rest; `scale` is a typical size in `unit`, counted as in `Param`.

    A `stepped` one changes once a sample, by `update`; a `clock` is the time since the record's common zero.
    """

    name: str
    unit: str
    scale: float
    stepped: bool = False
    clock: bool = False

    @property
    def relative(self) -> bool:
        """Whether the unit depends on where the effect acts."""
        return any(word in self.unit for word in MARKERS)


@dataclass(frozen=True)
class Where:
    """One channel an effect can act on: unit and typical size (SI) of its signal and of the stage displacement."""

    channel: str
    unit: str
    scale: float
    travel_unit: str
    travel_scale: float
    partner: str | None = None
    partner_unit: str = "1"
    partner_scale: float = 1.0

    def beside(self, other: Where) -> Where:
        """The same channel as one of a pair."""
        return replace(self, partner=other.channel, partner_unit=other.unit, partner_scale=other.scale)

    def unit_of(self, number: Param | State) -> str:
        """The unit here, such as 'N/um^3'."""
        unit = number.unit
        for word, here in (("channel", self.unit), ("travel", self.travel_unit), ("partner", self.partner_unit)):
            unit = unit.replace(word, here if here.isalnum() or number.unit == word else f"({here})")
        return unit

    def si(self, value: float, number: Param | State) -> float:
        """A bound, a grid value or a scale in SI, here."""
        if not number.relative:
            return to_si(value, number.unit)
        marked, size = number.unit, 1.0
        for word, marker in MARKERS.items():
            marked = marked.replace(word, marker)
        for marker, scale in zip(MARKERS.values(), (self.scale, self.travel_scale, self.partner_scale), strict=True):
            size *= scale ** power_of(marked, marker)
        return float(to_si(value, marked) * size)


class Effect:
    """Base of every effect: one subclass per file in `ctrlgen/effects/`.

    `term(s, p)` is the contribution, in the unit of the place. `s` gives `value` (the signal at this place and
    channel before any effect of this stage), its `rate` [1/s] and `second_rate` [1/s^2] (None where the motion does not
    give them; the second one for `update` alone), `all` (the same for every
    channel, a vector), `index` (of this channel), `scale` and `travel` (typical sizes of the signal and of the stage
    displacement), the effect's own states, `ambient` (rise of the surroundings [K]), `sample_time` [s] where it is
    needed and, for axis channels, `displacement` (and `displacements` of all axes), `velocity` (None for a device
    without inertia), `force` (that the stage takes at this displacement) and the actuator's `state`, such as its
    temperature, with its `rest`; where the device has them, `second_order_kinematics()` of the pose and
    `tangent_compliance()` of the stages, vectors, see `BalancedPhysics`. `p` gives the parameters in SI.

    An effect of `pairs` couples two channels: `partner` is the index of the other one; a `mutual` one acts on both.
    `channel_unit` and `partner_unit` restrict it to channels of that dimension (`channel`: that of its own).
    """

    library: ClassVar[dict[str, type[Effect]]] = {}
    kind: ClassVar[str]
    place: ClassVar[Place]
    source: ClassVar[str]
    params: ClassVar[tuple[Param, ...]]
    states: ClassVar[tuple[State, ...]] = ()
    # of actuator, ambient, bipolar, force, heat, sample_time, second_order_kinematics, spatial, state, tangent_compliance, unheated,
    # velocity
    needs: ClassVar[frozenset[str]] = frozenset()
    pairs: ClassVar[bool] = False
    whole: ClassVar[bool] = False  # one law of all channels: suspected at all of them at once
    mutual: ClassVar[bool] = False
    channel_unit: ClassVar[str | tuple[str, ...] | None] = None  # or of one of these dimensions
    partner_unit: ClassVar[str | None] = None
    stage: ClassVar[int] = (
        0  # among the effects of its place: later ones act on what earlier ones leave, alike ones side by side
    )
    several: ClassVar[bool] = False  # may act more than once at one place, as harmonics do
    active: ClassVar[bool] = False  # may put energy into the stage
    sticks: ClassVar[bool] = (
        False  # its force at standstill is what holds the stage there: steps must be implicit, also in its
    )
    # states, whose rates are linear in themselves
    rarity: ClassVar[float] = (
        0.0  # ln of how many times rarer it is than a wrong gain: decides among causes that explain alike
    )
    rough: ClassVar[float] = 0.0  # of itself: how far the form of the law, fitted, may be from nature
    family: ClassVar[str | None] = None  # forms of one physics, of which a place has one
    special: ClassVar[tuple[str, str, float] | None] = None  # the effect that it is where a parameter has a value
    domain: ClassVar[str | None] = None  # where a report says it is; the place says it by default

    def __init__(self, at: str, values: dict[str, Quantity], of: str | None = None) -> None:
        self.at = at
        self.values = values
        self.of = of

    def __init_subclass__(cls, listed: bool = True) -> None:
        if not any(p.off is not None for p in cls.params):
            raise TypeError(
                f"{cls.__name__}: give one parameter an `off` value, so that the model without this "
                f"effect is a special case of the model with it"
            )
        cls.kind = cls.__module__.rpartition(".")[2]
        if listed:
            Effect.library[cls.kind] = cls

    @classmethod
    def amplitude(cls) -> Param:
        """The parameter that switches the effect off."""
        return next(p for p in cls.params if p.off is not None)

    @classmethod
    def read_off(cls, readings: np.ndarray) -> tuple[dict[str, float], float] | None:
        """The parameters [SI] of a sensor's law that raw `readings` (n,) show without any model, and what it does to them,
        root mean square; None where they do not show it."""
        return None

    @classmethod
    def holds(cls, p: dict[str, float]) -> bool:
        """Whether the law means what it says with these parameters [SI]."""
        return True

    @classmethod
    def fits(cls, where: Where) -> bool:
        """Whether the law makes sense at this channel (for an effect of pairs: `beside` the other one)."""
        units = (cls.channel_unit,) if isinstance(cls.channel_unit, str) else cls.channel_unit
        if units is not None and not any(same_dimension(where.unit, unit) for unit in units):
            return False
        if not cls.pairs:
            return True
        wanted = where.unit if cls.partner_unit == "channel" else cls.partner_unit or where.partner_unit
        return where.partner not in (None, where.channel) and same_dimension(where.partner_unit, wanted)

    def term(self, s: SimpleNamespace, p: SimpleNamespace) -> ca.SX:
        """The contribution at this place and channel."""
        raise NotImplementedError

    def rates(self, s: SimpleNamespace, p: SimpleNamespace) -> dict[str, ca.SX]:
        """Time derivative of each state; clocks run by themselves."""
        return {}

    def update(self, s: SimpleNamespace, p: SimpleNamespace) -> dict[str, ca.SX]:
        """Each stepped state after the present sample, from its value before; `term` sees the new one."""
        return {}

    @classmethod
    def read(cls, given: Any) -> Effect:
        """One [[effect]] table of a device file. Raises ValueError naming what is wrong."""
        if isinstance(given, Effect):
            return given
        if not isinstance(given, dict):
            raise ValueError("an effect is a table: [[effect]] with kind, at and its parameters")
        kind = given.get("kind")
        if kind not in Effect.library:
            raise ValueError(f"kind = {kind!r} is not an effect I know: {', '.join(sorted(Effect.library))}")
        chosen = Effect.library[kind]
        names = [p.name for p in chosen.params]
        keys = ["kind", "at", *(["of"] if chosen.pairs else []), *names]
        faults = [f"unknown key {key!r} (has: {', '.join(keys[1:])})" for key in given if key not in keys]
        at, of = given.get("at"), given.get("of")
        if not isinstance(at, str):
            faults.append(f'at is missing: name the {chosen.place.value} channel, such as at = "1X", or "all"')
        if chosen.pairs and not isinstance(of, str):
            faults.append(f'of is missing: name the other {chosen.place.value} channel, such as of = "1Y"')
        values = {}
        for param in chosen.params:
            if param.name not in given:
                example = re.sub("channel|travel|partner", "um", param.unit)
                faults.append(
                    f'{param.name} is missing ({param.doc}); write for example {param.name} = "{param.bounds[1]:g} {example}"'
                )
                continue
            try:
                values[param.name] = read_quantity(None if param.relative else param.unit, given[param.name])
            except ValueError as error:
                faults.append(f"{param.name}: {error}")
                continue
            if not param.relative:
                faults += _outside(param, values[param.name], [to_si(b, param.unit) for b in param.bounds], param.unit)
        if faults:
            raise ValueError(f"{kind}: " + "; ".join(faults))
        return chosen(str(at), values, of)

    def faults_at(self, where: Where) -> list[tuple[str, str]]:
        """(parameter, what is wrong) where a relative unit or bound does not fit the channel."""
        found = []
        for param in self.params:
            if not param.relative:
                continue
            given, unit = self.values[param.name], where.unit_of(param)
            if not same_dimension(written_unit(given.text), unit):
                found.append((param.name, f"{given.text!r} has the wrong unit at {where.channel}: {unit} is needed"))
            else:
                found += [
                    (param.name, text)
                    for text in _outside(param, given, [where.si(b, param) for b in param.bounds], unit)
                ]
        return found

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        def validate(given: Any) -> Effect:
            try:
                return cls.read(given)
            except ValueError as error:
                raise PydanticCustomError("effect", "{message}", {"message": str(error)}) from error

        return core_schema.no_info_plain_validator_function(validate)

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """An [[effect]] table; the keys beside `kind`, `at` and `of` are the parameters of that kind of effect."""
        kinds = {"type": "string", "enum": sorted(Effect.library)}
        text = {"type": "string"}
        return {
            "type": "object",
            "title": "effect",
            "properties": {"kind": kinds, "at": text, "of": text},
            "required": ["kind", "at"],
        }


def _outside(param: Param, given: Quantity, bounds: list[float], unit: str) -> list[str]:
    low, high = bounds
    rounding = 1e-12 * max(abs(low), abs(high))  # of a change of units
    if low - rounding <= given.si <= high + rounding:
        return []
    return [f"{param.name} = {given.text} is outside {show(low, unit)} ... {show(high, unit)}"]
