"""The terms of a device's effects at each place between command and reading, and what an effect's law may read there."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import SimpleNamespace
from typing import TypeGuard

import casadi as ca

from ctrlgen.core.errors import Fault
from ctrlgen.core.units import same_dimension, written_unit
from ctrlgen.devices import BalancedPhysics, Device, DevicePhysics, ImposedPhysics, InertialPhysics
from ctrlgen.devices.limit import Limit, rate_limit
from ctrlgen.effects import REQUIREMENTS, Channel, Effect, LawInputs, Place, State, faults_at, is_group, means

# Typical displacements beyond which a law reads the stage's force at that end: a search may try values farther out, where
# no stage goes and a restoring force may have no value (a root of a negative number).
REACH = 10.0
LOOKS_BACK = "sample_time"  # what a law requires that looks back by samples


@dataclass
class Member:
    """One effect on one channel, with the symbols of the states that are `kept`; `rates`, `stepped` and `resting` are its law's
    answers."""

    effect: Effect
    values: SimpleNamespace
    channel: Channel
    index: int
    partner: int | None
    states: dict[str, ca.SX]
    kept: tuple[State, ...]
    rates: dict[str, ca.SX] = field(default_factory=dict)
    stepped: dict[str, ca.SX] = field(default_factory=dict)
    resting: dict[str, ca.SX] = field(default_factory=dict)

    def apply(self, s: LawInputs) -> ca.SX:
        """The term for the inputs `s`; keeps the states' rates and the new values of those that change once a sample."""
        by_default = {state.name: ca.SX(float(state.clock)) for state in self.kept}
        self.stepped = {name: ca.SX(value) for name, value in self.effect.after_sample(s, self.values).items()}
        self.resting = {name: ca.SX(value) for name, value in self.effect.resting(s, self.values).items()}
        s = s.with_states({name: value for name, value in self.stepped.items() if name not in self.effect.ramps()})
        self.rates = {**by_default, **self.effect.rates(s, self.values)}
        return self.effect.term(s, self.values)


class EffectTerms:
    """Adds the effects' terms place by place, in the order of `Effect.order`, and collects their states.

    `displacement` (n_axes,), `velocity` (n_axes, or none where it is not known) and `acceleration` are the model's
    symbols, `ambient` the rise of the surroundings [K]. `faults` lists the effects that do not fit the device. What the
    laws keep through a record is a state with `per_record`, zero without. The effects `apart`, by their places in the file, add no
    term; nor, without a `sample_time`, do those that look back by samples: at rest they do nothing.
    """

    def __init__(
        self,
        device: Device,
        physics: DevicePhysics,
        p: SimpleNamespace,
        displacement: ca.SX,
        velocity: ca.SX,
        acceleration: ca.SX,
        ambient: ca.SX,
        sample_time: float | None,
        per_record: bool,
        apart: Collection[int] = (),
    ) -> None:
        self.physics, self.ambient, self.sample_time, self.per_record = physics, ambient, sample_time, per_record
        self.apart = apart
        self.displacement, self.velocity, self.acceleration = displacement, velocity, acceleration
        reach = REACH * physics.displacement_scale
        self.within_reach = ca.fmin(ca.fmax(displacement, -reach), reach)
        self.mechanism_displacement = displacement  # with the effects' terms, once these are added
        self.signals_before: dict[Place, list[tuple[float, ca.SX]]] = {}  # (order, the signal before its terms)
        self.members: list[Member] = []
        self.faults: list[Fault] = []
        self.effects = device.effect
        for k, effect in enumerate(device.effect):
            self._place(k, effect, p.effect[k])

    def _place(self, k: int, effect: Effect, values: SimpleNamespace) -> None:
        """Adds one member for each channel on which the effect acts; collects its faults."""
        places = channels(self.physics, effect.place)
        names = [channel.name for channel in places]
        for need in sorted(effect.requires - available(self.physics) - {LOOKS_BACK}):
            what = f"{effect.kind} does not fit this device: it needs {REQUIREMENTS[need]}"
            self.faults.append(Fault(f"effect[{k}].kind", what))
        chosen = [i for i, c in enumerate(places) if means(effect.at, c.name, c.unit)]
        if not chosen:
            self.faults.append(Fault(f"effect[{k}].at", f"{effect.at!r} is not one of {', '.join(names)}, all"))
        partners = partner_channels(self.physics, effect)
        others = [channel.name for channel in partners]
        if effect.of is not None and effect.of not in others:
            self.faults.append(Fault(f"effect[{k}].of", f"{effect.of!r} is not one of {', '.join(others)}"))
            return
        other = None if effect.of is None else others.index(effect.of)
        pairs: list[tuple[int, int | None]] = [(i, other) for i in chosen]
        if effect.symmetric and other is not None:
            pairs += [(other, i) for i in chosen]
        for i, partner in pairs:
            channel = places[i] if partner is None else places[i].paired_with(partners[partner])
            if not effect.applies_to(channel):
                if not is_group(effect.at):
                    self.faults.append(Fault(f"effect[{k}].at", f"{effect.kind} cannot act on {names[i]}: wrong unit"))
                continue
            self.faults += [Fault(f"effect[{k}].{name}", text) for name, text in faults_at(effect, channel)]
            if k in self.apart or (LOOKS_BACK in effect.requires and self.sample_time is None):
                continue
            amplitude = effect.amplitude().name
            try:
                kept = effect.kept(self.sample_time, isinstance(getattr(values, amplitude), ca.SX))
            except ValueError as error:
                self.faults.append(Fault(f"effect[{k}].{amplitude}", str(error)))
                continue
            states = {
                s.name: ca.SX.sym(f"{effect.kind}_{k}_{s.name}_{names[i]}") if self._unknown(s) else ca.SX(0)
                for s in kept
            }
            self.members.append(Member(effect, values, channel, i, partner, states, kept))

    def added(self, place: Place, before: ca.SX) -> ca.SX:
        """`before` (channels,) plus every term of the effects at `place`."""
        total, members = ca.SX(before), [m for m in self.members if m.effect.place is place]
        levels = self.signals_before[place] = []
        for order in sorted({m.effect.order for m in members}):
            levels.append((order, total[:]))
            for member in members:
                if member.effect.order == order:
                    s = self.law_inputs(place, member.index, member.partner, member.states, order)
                    total[member.index] += member.apply(s)
        levels.append((float("inf"), total[:]))
        if place is Place.DISPLACEMENT:
            self.mechanism_displacement = total
        return total

    def law_inputs(
        self, place: Place, i: int, partner: int | None, states: dict[str, ca.SX], order: int = 0
    ) -> LawInputs:
        """What the law of an effect on channel `i` of `place` may read, with the effect's own `states`."""
        before = next(signal for level, signal in self.signals_before[place] if level >= order)
        channel = channels(self.physics, place)[i]
        at_platform = place in (Place.POSE, Place.SENSOR)
        delivered = {"drives": self.delivered} if place is Place.SENSOR else {}
        return LawInputs(
            value=before[i],
            all=before,
            index=i,
            partner=partner,
            scale=channel.scale,
            travel=channel.travel_scale,
            states=SimpleNamespace(**states),
            ambient=self.ambient,
            sample_time=math.nan if self.sample_time is None else self.sample_time,
            displacements=self.displacement,
            velocities=self.velocity,
            second_order_kinematics=lambda: self.second_order_kinematics,
            tangent_compliance=lambda: self.tangent_compliance,
            **delivered,
            **(self._of_platform(before[i]) if at_platform else self._of_axis(min(i, len(self.physics.axes) - 1))),
        )

    def _of_platform(self, value: ca.SX) -> dict[str, ca.SX]:
        """The derivatives by time of a signal of the platform, where the motion gives them, and the laws of the sensor that it has passed:
        none of one that keeps samples does."""
        if not isinstance(self.physics, InertialPhysics):
            return {}
        sensor = [m for m in self.members if m.effect.place is Place.SENSOR and m.rates]
        kept = [ca.vertcat(*m.states.values()) for m in sensor if LOOKS_BACK in m.effect.requires]
        if any(ca.depends_on(value, states) for states in kept):
            return {}
        moved = [(self.displacement, self.velocity), (self.velocity, self.acceleration)]
        moved += [
            (m.states[name], rate) for m in sensor for name, rate in m.rates.items() if m.states[name].is_symbolic()
        ]

        def rate_of(signal: ca.SX) -> ca.SX:
            return sum((ca.jtimes(signal, x, rate) for x, rate in moved), ca.SX(0))

        rate = rate_of(value)
        return {"rate": rate, "second_rate": rate_of(rate)}

    def _of_axis(self, i: int) -> dict[str, ca.SX]:
        """The motion, force and heater of axis i."""
        heater = self.physics.state if _has_heaters(self.physics) else None
        return {
            "displacement": self.displacement[i],
            "velocity": self.velocity[i] if self.velocity.numel() else None,
            "accelerations": self.imposed_acceleration,
            "force": self.restoring_force[i],
            "temperature": None if heater is None else heater.expr[i],
            "temperature_at_rest": None if heater is None else self.physics.rest[i],
            "holding_heat": None if heater is None else self.holding_heat[i],
        }

    @cached_property
    def delivered(self) -> ca.SX:
        """What the amplifiers deliver (channels,), with the effects of the drive; a symbol where no drive is known."""
        levels = self.signals_before.get(Place.DRIVE)
        return levels[-1][1] if levels else ca.SX.sym("drive", len(channels(self.physics, Place.DRIVE)))

    @cached_property
    def holding_heat(self) -> ca.SX:
        """The power (n_axes,) that holds each heater at its temperature, where the device's own rates, linear in the power, are zero."""
        assert _has_heaters(self.physics) and self.physics.state is not None
        heat = ca.SX.sym("heat", len(self.physics.axes))
        rates = self.physics.rates(self.physics.state.expr, heat)
        return -ca.substitute(rates, heat, 0 * heat) / ca.diag(ca.jacobian(rates, heat))

    @cached_property
    def restoring_force(self) -> ca.SX:
        """What the stages take within their reach; large for a mechanism of second order, hence built only for a law of an axis."""
        return self.physics.restoring_force(self.within_reach)

    @property
    def imposed_acceleration(self) -> ca.SX | None:
        """The accelerations (n_axes,) of an imposed motion; None where the forces decide on them."""
        n = len(self.physics.axes)
        return self.physics.drive.expr[2 * n : 3 * n] if isinstance(self.physics, ImposedPhysics) else None

    @cached_property
    def second_order_kinematics(self) -> ca.SX:
        """What finite rotations of the links add to the pose; large, hence built only when an effect asks for it."""
        assert self.physics.second_order_kinematics  # `available` says so
        return self.physics.second_order_kinematics(self.mechanism_displacement)

    @cached_property
    def tangent_compliance(self) -> ca.SX:
        """By how much less the stages yield to the links' load than at home; built only when an effect asks for it."""
        assert isinstance(self.physics, BalancedPhysics) and self.physics.tangent_compliance  # `available` says so
        return self.physics.tangent_compliance(self.within_reach)

    def rate_limits(self) -> tuple[Limit, ...]:
        """The limits on the drives' changes by time that the device states, and those of its effects (`Effect.limits_rate`), whatever the
        sample time: one a drive, the tighter of both."""
        drive, limits = self.physics.drive, {limit.name: limit for limit in self.physics.rate_limits}
        for effect in (e for e in self.effects if e.limits_rate):
            most = effect.values[effect.limits_rate]
            for i, (name, unit) in enumerate(zip(drive.channels, drive.units, strict=True)):
                if means(effect.at, name, unit):
                    limit = rate_limit(drive, i, -most.si, most.si, written_unit(most.text))
                    there = limits.get(limit.name, limit)
                    (low, high), (lowest, highest) = there.bounds, limit.bounds
                    limits[limit.name] = replace(there, lower=max(low, lowest), upper=min(high, highest))
        return tuple(limits.values())

    def memories(self) -> list[tuple[Member, State, ca.SX]]:
        """(member, state, its symbol) of every state of the effects, in the order in which they stand in the model's x."""
        return [
            (m, state, symbol)
            for m in self.members
            for state, symbol in zip(m.kept, m.states.values(), strict=True)
            if self._unknown(state)
        ]

    def _unknown(self, state: State) -> bool:
        return self.per_record or not state.per_record


def channels(physics: DevicePhysics, place: Place) -> list[Channel]:
    """The channels on which an effect of `place` can act."""
    feedback = physics.feedback if isinstance(physics, InertialPhysics) else None
    rows: Iterable[tuple[str, str, float]]
    if place is Place.SENSOR:
        rows = zip(*physics.readings, strict=True)
    elif place is Place.POSE:
        rows = zip(physics.components, physics.pose_units, physics.pose_scale, strict=True)
    elif place is Place.DRIVE and feedback is not None:  # u is the loop's reference, the amplifier's drive its command
        rows = ((axis, feedback.command.unit, feedback.command.scale) for axis in physics.axes)
    elif place is Place.DRIVE:
        rows = zip(physics.drive.channels, physics.drive.units, physics.drive.scale, strict=True)
    else:
        power = physics.power if _has_heaters(physics) else None
        unit, scale = {
            Place.HEAT: (power.unit, power.scale) if power else ("1", 1.0),
            Place.FORCE: (physics.force_unit, physics.force_scale),
            Place.DISPLACEMENT: (physics.travel_unit, physics.displacement_scale),
        }[place]
        rows = ((axis, unit, scale) for axis in physics.axes)
    travel, force = (physics.travel_unit, physics.displacement_scale), (physics.force_unit, physics.force_scale)
    return [Channel(*row, *travel, force_unit=force[0], force_scale=force[1]) for row in rows]


def partner_channels(physics: DevicePhysics, law: Effect | type[Effect]) -> list[Channel]:
    """The channels that may be the other one, `of`, of a law of pairs."""
    return channels(physics, law.partner_place or law.place)


def available(physics: DevicePhysics, sample_time: float | None = None) -> frozenset[str]:
    """What a device offers to an effect's law: words of `REQUIREMENTS`."""
    heated, balanced = _has_heaters(physics), isinstance(physics, BalancedPhysics)
    present = {
        "unheated": not heated,
        "heat": heated,
        "state": heated,
        "bipolar": physics.bipolar,
        "actuator": not isinstance(physics, ImposedPhysics),
        "balanced": balanced,
        "velocity": not balanced,
        "acceleration": isinstance(physics, ImposedPhysics),
        "ambient": True,
        LOOKS_BACK: sample_time is not None,
        "delivered": not isinstance(physics, ImposedPhysics) and not in_loop(physics),
        "displacement_command": balanced and same_dimension(physics.force_unit, physics.travel_unit),
        "force": any(same_dimension(physics.force_unit, unit) for unit in ("N", "N*m")),
        "spatial": len(physics.components) == 6,
        "spring": _pulls_home(physics),
        "voltage": any(same_dimension(unit, "V") for unit in physics.drive.units),
        "second_order_kinematics": physics.second_order_kinematics is not None,
        "tangent_compliance": isinstance(physics, BalancedPhysics) and physics.tangent_compliance is not None,
    }
    return frozenset(name for name, given in present.items() if given)


def in_loop(physics: DevicePhysics) -> bool:
    """Whether a feedback loop acts on the readings."""
    loop = physics.feedback if isinstance(physics, InertialPhysics) else None
    return loop is not None and loop.measures == "reading"


def _pulls_home(physics: DevicePhysics) -> bool:
    """Whether the restoring force depends on the displacement: not that of a stage whose stiffness is zero."""
    d = ca.SX.sym("d", len(physics.axes))
    return bool(ca.depends_on(ca.densify(ca.SX(physics.restoring_force(d))), d))


def _has_heaters(physics: DevicePhysics) -> TypeGuard[BalancedPhysics]:
    return isinstance(physics, BalancedPhysics) and physics.power is not None
