"""The one extension point: a physical effect is one symbolic term at one place.

Adding an effect is adding one file to `ctrlgen/effects/`: a subclass of `Effect` with its
equation in the docstring, its parameters, and `term` (and `rates` if it remembers). Simulation,
inversion, solving and generated C all read it from there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from types import SimpleNamespace
from typing import Any, ClassVar

import casadi as ca
from pydantic import GetCoreSchemaHandler
from pydantic_core import PydanticCustomError, core_schema

from ctrlgen.units import Quantity, parse, quantity, show


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
    """One number of a law, with bounds in its `unit`; at `off` the whole effect vanishes."""

    name: str
    unit: str
    bounds: tuple[float, float]
    doc: str
    off: float | None = None


@dataclass(frozen=True)
class State:
    """A memory of the effect, zero at rest; `scale` is a typical size in SI."""

    name: str
    unit: str
    scale: float


class Effect:
    """Base of every effect: one subclass per file in `ctrlgen/effects/`.

    `term(s, p)` is the contribution, in the unit of the place. `s` gives `value` (the signal at this
    place and channel before any effect), `all` (the same for every channel, a vector), `index` (of
    this channel) and the effect's own states; for axis channels also `displacement` and
    the actuator's `state`, such as its temperature. `p` gives the parameters in SI.
    """

    library: ClassVar[dict[str, type[Effect]]] = {}
    kind: ClassVar[str]
    place: ClassVar[Place]
    source: ClassVar[str]
    params: ClassVar[tuple[Param, ...]]
    states: ClassVar[tuple[State, ...]] = ()
    channel_unit: ClassVar[str | None] = None  # set where a parameter has the dimension of the channel

    def __init__(self, at: str, values: dict[str, Quantity]) -> None:
        self.at = at
        self.values = values

    def __init_subclass__(cls) -> None:
        if not any(p.off is not None for p in cls.params):
            raise TypeError(
                f"{cls.__name__}: give one parameter an `off` value, so that the model without this "
                f"effect is a special case of the model with it"
            )
        cls.kind = cls.__module__.rpartition(".")[2]
        Effect.library[cls.kind] = cls

    def term(self, s: SimpleNamespace, p: SimpleNamespace) -> ca.SX:
        """The contribution at this place and channel."""
        raise NotImplementedError

    def rates(self, s: SimpleNamespace, p: SimpleNamespace) -> dict[str, ca.SX]:
        """Time derivative of each state."""
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
        faults = [
            f"unknown key {key!r} (has: at, {', '.join(names)})" for key in given if key not in {"kind", "at", *names}
        ]
        at = given.get("at")
        if not isinstance(at, str):
            faults.append(f'at is missing: name the {chosen.place.value} channel, such as at = "1X", or "all"')
        values = {}
        for param in chosen.params:
            if param.name not in given:
                faults.append(
                    f'{param.name} is missing ({param.doc}); write for example {param.name} = "{param.bounds[1]:g} {param.unit}"'
                )
                continue
            low, high = (
                parse(f"{bound!r} {'' if param.unit == '1' else param.unit}", param.unit) for bound in param.bounds
            )
            try:
                values[param.name] = _read_quantity(param.unit, given[param.name])
            except ValueError as error:
                faults.append(f"{param.name}: {error}")
                continue
            if not low <= values[param.name].si <= high:
                faults.append(
                    f"{param.name} = {values[param.name].text} is outside {show(low, param.unit)} ... {show(high, param.unit)}"
                )
        if faults:
            raise ValueError(f"{kind}: " + "; ".join(faults))
        return chosen(str(at), values)

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        def validate(given: Any) -> Effect:
            try:
                return cls.read(given)
            except ValueError as error:
                raise PydanticCustomError("effect", "{message}", {"message": str(error)}) from error

        return core_schema.no_info_plain_validator_function(validate)


def _read_quantity(unit: str, given: Any) -> Quantity:
    read: Callable[[Any], Quantity] = quantity(unit).__metadata__[0].func
    return read(given)
