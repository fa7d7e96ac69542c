"""The interface of a law: one symbolic term at one place of a device."""

from __future__ import annotations

import re
import sys
from enum import Enum
from types import SimpleNamespace
from typing import ClassVar

import casadi as ca

from ctrlgen.core.units import Quantity, same_dimension
from ctrlgen.effects._parameter import Channel, Param, State


class Place(Enum):
    """Where a term is added on the way from the command to the reading."""

    DRIVE = "drive"  # to what the amplifier delivers to an actuator
    HEAT = "heat"  # to the power that arrives in an actuator's heater, whatever the drive is
    FORCE = "force"  # to the force on the actuator bar, positive along the actuator's push
    DISPLACEMENT = "displacement"  # between the stage and the mechanism that it carries
    POSE = "pose"  # between the mechanism and the platform
    SENSOR = "sensor"  # between the platform and the reported pose


class Effect:
    """Base of every effect: one law a file in `ctrlgen/effects/`; one that acts at several places or axes is named for each.

    `term(s, p)` is the law's contribution, in the unit of the place. `p` holds the parameters in SI. `s` holds:

    value, rate [1/s], second_rate [1/s^2]: the signal of this channel, before the effects of the same order at this place, and
        its derivatives; rate and second_rate are None where the motion does not give them, second_rate is for `update` only
    all, index, partner: that signal for every channel as a vector, the index of this channel, and that of the other of a pair (at
        `partner_place`, where the law names one)
    scale, travel: typical sizes of the signal and of the stage displacement
    the effect's own states, by name
    ambient [K]: rise of the surroundings' temperature; sample_time [s]
    second_order_kinematics(), tangent_compliance(): vectors of the device, see `BalancedPhysics`; only where it has them
    displacements, velocities (of all axes; no velocities for a device without inertia)
    and, at places of an axis: displacement, velocity (None for a device without inertia), accelerations (of all axes; None but
        for an imposed motion), force (that the stage takes at this displacement), and the actuator's state, such as its
        temperature, with its rest
    """

    library: ClassVar[dict[str, type[Effect]]] = {}
    kind: ClassVar[str]  # the class's name as a device file writes it: 'drive_gain' of DriveGain
    title: ClassVar[str]  # what it is, without symbols, for a report; by default the first line of the law's file
    place: ClassVar[Place]
    source: ClassVar[str]
    params: ClassVar[tuple[Param, ...]]
    states: ClassVar[tuple[State, ...]] = ()
    # What the device must have, of: acceleration, actuator, ambient, balanced, bipolar, displacement_command, force, heat,
    # sample_time, second_order_kinematics, spatial, state, tangent_compliance, unheated, velocity, voltage.
    requires: ClassVar[frozenset[str]] = frozenset()
    # Couples a channel to another one, `of`, whose index is `partner`; a symmetric one acts on both.
    pairs: ClassVar[bool] = False
    symmetric: ClassVar[bool] = False
    # Where the other one, `of`, is a channel; None: at the law's own place.
    partner_place: ClassVar[Place | None] = None
    # Restrict the effect to channels of this dimension, or of one of these; of the partner, "channel" means the same one.
    channel_unit: ClassVar[str | tuple[str, ...] | None] = None
    partner_unit: ClassVar[str | None] = None
    # Among the effects at one place: those of a higher order act on what those of lower orders leave.
    order: ClassVar[int] = 0
    # May put energy into the stage.
    active: ClassVar[bool] = False
    # Shifts the recorded drive by its amplitude [s] in simulations of recordings; adds nothing to the model.
    shifts_drive: ClassVar[bool] = False
    # Its amplitude [s] moves a signal in time, so far that no slope at zero tells what it would explain.
    moves_in_time: ClassVar[bool] = False
    # The force at standstill takes any value that holds the stage there (dry friction). The integrator must then be
    # implicit, in the effect's states too, whose rates must be linear in the states.
    set_valued: ClassVar[bool] = False

    def __init__(self, at: str, values: dict[str, Quantity], of: str | None = None) -> None:
        self.at = at
        self.values = values
        self.of = of

    def _value(self) -> tuple[object, ...]:
        return type(self), self.place, self.at, self.of, tuple(self.values.items())

    def __eq__(self, other: object) -> bool:
        """Two effects are equal where one law acts at one place with the same numbers."""
        return isinstance(other, Effect) and self._value() == other._value()

    def __hash__(self) -> int:
        return hash(self._value())

    def __init_subclass__(cls, listed: bool = True) -> None:
        cls.kind = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", cls.__name__).lower()
        if "title" not in vars(cls):
            cls.title = (sys.modules[cls.__module__].__doc__ or cls.kind).strip().split("\n")[0].rstrip(".")
        if not listed:  # a law that is named once per place or axis, by its subclasses
            return
        if not any(p.off is not None for p in cls.params):
            raise TypeError(
                f"{cls.__name__}: give one parameter an `off` value, so that the model without this "
                f"effect is a special case of the model with it"
            )
        Effect.library[cls.kind] = cls

    @classmethod
    def amplitude(cls) -> Param:
        """The parameter that switches the effect off."""
        return next(p for p in cls.params if p.off is not None)

    @classmethod
    def contradiction(cls, p: dict[str, float]) -> str:
        """Why parameters [SI] describe something else than the law; empty where they do not."""
        return ""

    @classmethod
    def applies_to(cls, channel: Channel) -> bool:
        """Whether the law has a meaning at this channel (of a pair: `paired_with` the other one)."""
        units = (cls.channel_unit,) if isinstance(cls.channel_unit, str) else cls.channel_unit
        if units is not None and not any(same_dimension(channel.unit, unit) for unit in units):
            return False
        if not cls.pairs:
            return True
        wanted = channel.unit if cls.partner_unit == "channel" else cls.partner_unit or channel.partner_unit
        itself = cls.partner_place is None and channel.partner == channel.name
        return channel.partner is not None and not itself and same_dimension(channel.partner_unit, wanted)

    def term(self, s: SimpleNamespace, p: SimpleNamespace) -> ca.SX:
        """The contribution at this place and channel."""
        raise NotImplementedError

    def rates(self, s: SimpleNamespace, p: SimpleNamespace) -> dict[str, ca.SX]:
        """Time derivative of each state that is integrated; clocks run by themselves."""
        return {}

    def update(self, s: SimpleNamespace, p: SimpleNamespace) -> dict[str, ca.SX]:
        """Each stepped state after the present sample, from its value before; `term` sees the new one."""
        return {}

    def after_sample(self, s: SimpleNamespace, p: SimpleNamespace) -> dict[str, ca.SX]:
        """`update`, with the states that keep their value through a record."""
        return {state.name: getattr(s, state.name) for state in self.states if state.per_record} | self.update(s, p)
