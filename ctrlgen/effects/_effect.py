"""The interface of a law: one symbolic term at one place of a device."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from enum import Enum
from types import MappingProxyType
from typing import ClassVar

from ctrlgen.core.units import Quantity, same_dimension
from ctrlgen.effects._family import Family
from ctrlgen.effects._law_inputs import Expression, LawInputs, LawNumbers
from ctrlgen.effects._parameter import Channel, Param, State
from ctrlgen.effects._plainer import Plainer
from ctrlgen.effects._region import ActsIn
from ctrlgen.effects._shape_bounds import ShapeBounds


class Place(Enum):
    """Where a term is added on the way from the command to the reading."""

    DRIVE = "drive"  # to what the amplifier delivers to an actuator
    HEAT = "heat"  # to the power that arrives in an actuator's heater, whatever the drive is
    FORCE = "force"  # to the force on the actuator bar, positive along the actuator's push
    DISPLACEMENT = "displacement"  # between the stage and the mechanism that it carries
    POSE = "pose"  # between the mechanism and the platform
    SENSOR = "sensor"  # between the platform and the reported pose


class Apart(Enum):
    """How a law that remembers much is applied to a reading as a whole, with its amplitude [s]."""

    LATE = "late"  # the reading of so long ago
    MEAN = "mean"  # its mean over the time since


class Effect:
    """Base of every effect: one law a file in `ctrlgen/effects/`, or in a package of its author. One that acts at several places or axes
    is named for each.

    `term(s, p)` is the law's contribution, in the unit of the place: `p` holds the parameters in SI, and `LawInputs` says what `s`
    holds.
    """

    library: ClassVar[dict[str, type[Effect]]] = {}
    kind: ClassVar[str]  # the class's name as a device file writes it: 'drive_gain' of DriveGain
    title: ClassVar[str]  # what it is, without symbols, for a report; by default the first line of the law's file
    place: ClassVar[Place]
    source: ClassVar[str]
    package: ClassVar[str] = ""  # the installed package that brings it; none of ctrlgen's own
    params: ClassVar[tuple[Param, ...]]
    states: ClassVar[tuple[State, ...]] = ()
    # Of what its residual is like: a diagnosis holds it beside what the model-free shares speak for. None names no cause.
    family: ClassVar[Family | None] = None
    # What the law is where a fit of one of its shapes ends at a bound. A shape that is left out is the law itself there.
    at_bounds: ClassVar[Mapping[str, ShapeBounds]] = MappingProxyType({})
    # What the search believes of a law of another package: an `estimation.law_prior.LawPrior`. Ours have rows in `estimation.priors`.
    prior: ClassVar[object] = None
    # The plainer law that it generalises, if there is one in the library.
    plainer: ClassVar[Plainer | None] = None
    # Where it acts, if not everywhere.
    acts_in: ClassVar[ActsIn | None] = None
    # Remembers so much that a simulation of a recording applies it to the simulated readings as a whole, where nothing follows it,
    # and leaves it out of the model: `estimation.late_readings`.
    apart: ClassVar[Apart | None] = None
    # Follows a reading in steps, between which it has no slope: where nothing follows it, a fit leaves it out and takes it as noise.
    in_steps: ClassVar[bool] = False
    # What the device must have: words of `_requirements`.
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
    # Asks what reaches the readings from its place, and may find that nothing does: its amplitude may be free all the same.
    asks: ClassVar[bool] = False
    # False: no controller can undo it, or need try. One is made of a model without a sample time, which leaves the law out.
    inverted: ClassVar[bool] = True
    # The parameter that bounds how fast a drive may change, if there is one: along a path it is a limit.
    limits_rate: ClassVar[str] = ""
    # Its amplitude [s] moves a signal in time, so far that no slope at zero tells what it would explain.
    moves_in_time: ClassVar[bool] = False
    # Of a law that looks back, or shifts: by how much of its amplitude [s] a slow reading comes late.
    late_by: ClassVar[float] = 0.0
    # Of a wave, with a `phase`: further numbers that change their sign with its amplitude, as those of even harmonics do half a turn later.
    of_even_harmonics: ClassVar[tuple[str, ...]] = ()
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
        same = Effect.library.get(cls.kind)
        if same is not None and same.__module__ != cls.__module__:
            raise TypeError(
                f"{same.__module__} has a law of the name {cls.kind}; name the class {cls.__name__} otherwise"
            )
        Effect.library[cls.kind] = cls

    def placed(self) -> dict[str, str]:
        """The keys of its [[effect]] table before its numbers: kind, package, at, of."""
        keys = {"kind": self.kind, "package": self.package, "at": self.at, "of": self.of or ""}
        return {key: text for key, text in keys.items() if text}

    @classmethod
    def runs_on_the_clock(cls) -> bool:
        """Whether what it does depends on when it is: it holds for the records whose clock it was found on, and for no other run."""
        return any(state.clock for state in cls.states)

    @classmethod
    def amplitude(cls) -> Param:
        """The parameter that switches the effect off."""
        return next(p for p in cls.params if p.off is not None)

    @classmethod
    def contradiction(cls, p: dict[str, float]) -> str:
        """Why parameters [SI] describe something else than the law; empty where they do not."""
        return ""

    @classmethod
    def inertia(cls, numbers: dict[str, float]) -> float | None:
        """What it adds with these `numbers` [SI] to the mass that moves when the stage moves slowly; None where it carries none."""
        return None

    @classmethod
    def meant(cls, numbers: dict[str, float]) -> tuple[str, dict[str, float]] | None:
        """The kind and the numbers [SI] of the law that these `numbers` are, where they contradict this one's name; None where no other
        law of the library is the same."""
        return None

    @classmethod
    def as_plainer(cls, numbers: dict[str, float]) -> dict[str, float]:
        """The numbers [SI] of the law `plainer` where this one, with these `numbers`, is that law; those of other names are not read."""
        return numbers

    @classmethod
    def from_plainer(cls, numbers: dict[str, float]) -> dict[str, float]:
        """Where a fit of this law begins [SI] that a plainer form of it, with these `numbers`, has ended."""
        return numbers

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

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        """The contribution at this place and channel."""
        raise NotImplementedError

    def rates(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        """Time derivative of each state that is integrated; clocks run by themselves."""
        return {}

    def update(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        """Each stepped state after the present sample, from its value before; `term` sees the new one."""
        return {}

    def resting(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        """Stepped states where nothing has changed for long, of those that one `update` does not bring there."""
        return {}

    def kept(self, sample_time: float | None, free: bool) -> tuple[State, ...]:
        """The states at this sample time [s], of which a law that looks back by samples needs more the shorter it is; `free`: its
        amplitude may be moved from the file's. Raises ValueError, of its amplitude, where they are too many to build."""
        return self.states

    def reaches(self, sample_time: float) -> float:
        """Up to where its amplitude may be moved [SI] with the states `kept` of one that is free; infinite where they bound it nowhere."""
        return float("inf")

    def after_sample(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        """`update`, with the states that keep their value through a record, and ramps, which begin anew."""
        kept = {state.name: getattr(s.states, state.name) for state in self.states if state.per_record}
        return kept | dict.fromkeys(self.ramps(), 0.0) | self.update(s, p)

    def ramps(self) -> frozenset[str]:
        """The states that are integrated within each sample, from zero: of them `term` sees how far they are."""
        return frozenset(state.name for state in self.states if state.ramp)
