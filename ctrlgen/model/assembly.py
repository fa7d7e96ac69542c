"""A device's links and its effects' terms, joined place by place into the equations of a model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.units import base_unit, same_dimension
from ctrlgen.devices import Device, Links, Signal
from ctrlgen.devices.sensor import mounting_faults
from ctrlgen.effects import Effect, Place, Where

REACH = 10.0  # typical travels up to which a law is told the stage's force: beyond, a search may look but no stage goes


class Chain:
    """Joins a device's links and its effects' terms, place by place."""

    def __init__(
        self, device: Device, links: Links, p: SimpleNamespace, ambient: ca.SX, sample_time: float | None
    ) -> None:
        self.device, self.links, self.ambient, self.sample_time = device, links, ambient, sample_time
        self.z = ca.SX.sym("d", len(links.axes))
        reach = REACH * links.displacement_scale
        self.within_reach = ca.fmin(ca.fmax(self.z, -reach), reach)
        self.resisting = links.resistance(self.within_reach)
        self.v = ca.SX.sym("v", len(links.axes) if links.mass else 0)
        self.velocity = links.drive.expr[1] if links.imposed else self.v
        self.acceleration = ca.SX.sym("a", self.v.numel())
        self.before: dict[Place, list[tuple[float, ca.SX]]] = {}  # stages, and the signal before each
        self.held = self.held_value = ca.SX(0, 1)
        self.rates: ca.SX | None = None
        self.carried = self.z
        self.own_force = ca.SX(len(links.axes), 1)
        self.members: list[_Member] = []
        self.faults: list[Fault] = mounting_faults(device.sensor, links.components, links.pose_units)
        for k, effect in enumerate(device.effect):
            self._place(k, effect, p.effect[k])
        if self.faults:
            raise InputError(device.name, self.faults)

    def _place(self, k: int, effect: Effect, values: SimpleNamespace) -> None:
        """One member per channel on which the effect acts; its faults are noted."""
        places = channels(self.links, effect.place)
        names = [where.channel for where in places]
        for need in sorted(effect.needs - available(self.links, sample_time=self.sample_time)):
            self.faults.append(Fault(f"effect[{k}].kind", f"{effect.kind} acts on {need}, and this device has none"))
        chosen = range(len(names)) if effect.at == "all" else [i for i, c in enumerate(names) if c == effect.at]
        if not chosen:
            self.faults.append(Fault(f"effect[{k}].at", f"{effect.at!r} is not one of {', '.join(names)}, all"))
        if effect.of is not None and effect.of not in names:
            self.faults.append(Fault(f"effect[{k}].of", f"{effect.of!r} is not one of {', '.join(names)}"))
            return
        other = None if effect.of is None else names.index(effect.of)
        pairs = [(i, other) for i in chosen]
        if effect.mutual:
            pairs += [(other, i) for i in chosen]
        for i, partner in pairs:
            where = places[i] if partner is None else places[i].beside(places[partner])
            if not effect.fits(where):
                if effect.at != "all":
                    self.faults.append(Fault(f"effect[{k}].at", f"{effect.kind} has no meaning at {names[i]}"))
                continue
            self.faults += [Fault(f"effect[{k}].{name}", text) for name, text in effect.faults_at(where)]
            states = {s.name: ca.SX.sym(f"{effect.kind}_{k}_{s.name}_{names[i]}") for s in effect.states}
            self.members.append(_Member(effect, values, where, i, partner, states))

    def _with_terms(self, place: Place, before: ca.SX) -> ca.SX:
        """`before` plus every term of the effects at `place`, stage after stage; their rates are noted on the way."""
        total, here = ca.SX(before), [m for m in self.members if m.effect.place is place]
        levels = self.before[place] = []
        for stage in sorted({m.effect.stage for m in here}):
            levels.append((stage, total[:]))
            for member in here:
                if member.effect.stage == stage:
                    s = self.seen(place, member.index, member.partner, member.states, stage)
                    total[member.index] += member.act(s)
        levels.append((float("inf"), total[:]))
        return total

    def seen(
        self, place: Place, i: int, partner: int | None, states: dict[str, ca.SX], stage: int = 0
    ) -> SimpleNamespace:
        """What the law of an effect at channel `i` and a stage of `place` may read, with the effect's own `states`."""
        before = next(signal for level, signal in self.before[place] if level >= stage)
        s = SimpleNamespace(
            value=before[i], all=before, index=i, partner=partner, ambient=self.ambient, sample_time=self.sample_time,
            **states,
        )  # fmt: skip
        s.second_order, s.yielding = (lambda: self.second_order), (lambda: self.yielding)
        if place not in (Place.POSE, Place.SENSOR):
            i = min(i, len(self.links.axes) - 1)
            s.displacement, s.displacements = self.z[i], self.z
            s.velocity = self.velocity[i] if self.velocity.numel() else None
            heated = self.links.state is not None and self.links.heat_signal is not None
            s.state = self.links.state.expr[i] if heated else None
            s.rest = self.links.rest[i] if heated else None
            s.force = self.resisting[i]
        known = place in (Place.POSE, Place.SENSOR) and self.v.numel() and not self.links.imposed
        s.rate = ca.jtimes(s.value, self.z, self.v) if known else None
        s.second_rate = None
        if known:
            s.second_rate = ca.jtimes(s.rate, self.z, self.v) + ca.jtimes(s.rate, self.v, self.acceleration)
        where = channels(self.links, place)[s.index]
        s.scale, s.travel = where.scale, where.travel_scale
        return s

    @cached_property
    def second_order(self) -> ca.SX:
        """What finite turns add to the pose at the displacement carried; built when an effect asks."""
        return self.links.second_order(self.carried)

    @cached_property
    def yielding(self) -> ca.SX:
        """How much less the stages yield to the links' load than at home; built when an effect asks."""
        return self.links.yielding(self.within_reach)

    def parts(self, p: ca.SX, p_nominal: np.ndarray) -> dict[str, Any]:
        """The fields of `ctrlgen.model.model.Model`."""
        links, n = self.links, len(self.links.axes)
        z = self.z
        x = ca.SX(0, 1) if links.state is None else links.state.expr
        signals, balance, arriving, heat, produced = self._imposed(x) if links.imposed else self._driven(x)
        state = links.state
        memories = [
            (m, s, symbol) for m in self.members for s, symbol in zip(m.effect.states, m.states.values(), strict=True)
        ]
        memory_rates = ca.vertcat(ca.SX(0, 1), *(m.rates[s.name] for m, s, _ in memories))
        acceleration = balance / ca.vertcat(*links.mass) if links.mass else ca.SX(0, 1)
        first = x.numel()
        own = links.rates(x, arriving) if self.rates is None else self.rates
        rates = ca.vertcat(own, memory_rates, acceleration)
        following = {first + k: m.stepped[s.name] for k, (m, s, _) in enumerate(memories) if s.stepped}
        sampled = ca.substitute(rates, heat, produced)

        def closed(expr: ca.SX) -> ca.SX:
            moving = ca.substitute(ca.SX(expr), self.acceleration, acceleration)
            return ca.substitute(moving, self.held, self.held_value)

        signals = {role: replace(signal, expr=closed(signal.expr)) for role, signal in signals.items()}
        return dict(
            name=self.device.name,
            device=self.device,
            x=ca.vertcat(x, *(symbol for *_, symbol in memories), self.v),
            n_states=first,
            z=z,
            v=self.v,
            u=links.drive.expr,
            p=p,
            p_nominal=p_nominal,
            ambient=self.ambient,
            stepped={i: closed(value) for i, value in following.items()},
            sticking=self._sticking(),
            bristles=tuple(first + k for k, (m, s, _) in enumerate(memories) if m.effect.sticks and not s.stepped),
            acceleration=self.acceleration,
            held=self.held,
            held_value=self.held_value,
            sampled_rates=sampled,
            clocks=tuple(first + k for k, (_, s, _) in enumerate(memories) if s.clock),
            x_names=(
                *(() if state is None else (f"{state.name}_{channel}" for channel in state.channels)),
                *(symbol.name() for *_, symbol in memories),
                *(f"velocity_{axis}" for axis in links.axes[: self.v.numel()]),
            ),
            x_units=tuple(
                base_unit(u)
                for u in (
                    *(() if state is None else state.units),
                    *(m.where.unit_of(s) for m, s, _ in memories),
                    *(f"({links.travel_unit})/s",) * self.v.numel(),
                )
            ),
            heat=heat,
            heat_of_drive=closed(produced),
            rates_of_heat=closed(rates),
            balance=closed(balance),
            signals=signals,
            force_parts=links.resistance_parts(z),
            limits=tuple(
                links.limits(
                    SimpleNamespace(
                        drive=links.drive.expr,
                        state=x,
                        force=signals["force"].expr,
                        displacement=z,
                        carried=signals["displacement"].expr,
                        command=signals.get("command", links.drive).expr,
                    )
                )
            ),
            rest=np.concatenate([_numbers(links.rest, p, p_nominal), np.zeros(len(memories) + self.v.numel())]),
            x_scale=np.array(
                [
                    *(() if state is None else state.scale),
                    *(m.where.si(s.scale, s) for m, s, _ in memories),
                    *(100 * links.displacement_scale,) * self.v.numel(),
                ]
            ),
            z_scale=np.full(n, links.displacement_scale),
            u_scale=np.array(links.drive.scale),
            force_scale=links.force_scale,
            seen=self.seen,
        )

    def _driven(self, x: ca.SX) -> tuple[dict[str, Signal], ca.SX, ca.SX, ca.SX, ca.SX]:
        """Signals, force balance, arriving heat, the symbol of heat and what it is of the drive."""
        links, z, n = self.links, self.z, len(self.links.axes)
        displacement = self._with_terms(Place.DISPLACEMENT, z)
        self.carried = displacement
        pose = self._with_terms(Place.POSE, links.pose(displacement))
        reading = self._with_terms(Place.SENSOR, pose)
        u = links.drive.expr
        measured = reading if links.measured == "reading" else z
        command = links.feedback(u, measured, self.v, x) if links.feedback else u
        if links.feedback:  # computed at every sample and held until the next
            self.held, self.held_value = ca.SX.sym("held", n), command
        drive = self._with_terms(Place.DRIVE, self.held if links.feedback else u)
        produced = u - measured if links.feedback else links.heat(drive)
        heat = ca.SX.sym("heat", produced.numel())  # an unknown of its own: the inverse need not take squares apart
        arriving = self._with_terms(Place.HEAT, heat)
        if links.moving:
            pushed, self.rates = links.moving(drive, x, z, self.v)
        else:
            pushed = links.force(drive, x, z)
        drag = links.drag(self.v) if links.drag else ca.SX(n, 1)
        self.own_force = pushed - drag
        balance = self._with_terms(Place.FORCE, pushed) - links.resistance(z) - drag
        signals = {"drive": links.drive}
        if links.command_signal is not None:
            label, unit, column, size = links.command_signal
            signals["command"] = Signal("command", label, links.axes, (unit,) * n, column, command, (size,) * n)
        if links.heat_signal is not None:
            label, unit, column, size = links.heat_signal
            arrived = ca.substitute(arriving, heat, produced)
            signals["power"] = Signal("power", label, links.axes, (unit,) * n, column, arrived, (size,) * n)
        if links.state is not None:
            signals["state"] = links.state
        signals |= self._mechanical(pushed, displacement, pose, reading)
        return signals, balance, arriving, heat, produced

    def _sticking(self) -> tuple[int, ...]:
        """Axes with inertia on which an effect sticks, or whose own force bends with their velocity."""
        slopes = (
            [ca.jacobian(self.own_force[i], v) for i, v in enumerate(ca.vertsplit(self.v))] if self.v.numel() else []
        )
        bent = {i for i, slope in enumerate(slopes) if ca.depends_on(slope, self.v[i])}
        stuck = {m.index for m in self.members if m.effect.sticks and m.effect.place is Place.FORCE}
        return tuple(sorted((bent | stuck) if slopes else ()))

    def _imposed(self, x: ca.SX) -> tuple[dict[str, Signal], ca.SX, ca.SX, ca.SX, ca.SX]:
        """The same where the motion is given and the force that takes is read."""
        links, n = self.links, len(self.links.axes)
        drive = self._with_terms(Place.DRIVE, links.drive.expr)
        displacement = self._with_terms(Place.DISPLACEMENT, self.z)
        taken = links.force(drive, x, displacement) + links.resistance(displacement)
        helped = self._with_terms(Place.FORCE, ca.SX(n, 1))
        force = self._with_terms(Place.POSE, taken - helped)
        reading = self._with_terms(Place.SENSOR, force)
        signals = {"drive": links.drive, **self._mechanical(taken - helped, displacement, force, reading)}
        heat = ca.SX.sym("heat", n)
        return signals, drive[:n] - self.z, heat, heat, drive[:n]

    def _mechanical(self, force: ca.SX, displacement: ca.SX, pose: ca.SX, reading: ca.SX) -> dict[str, Signal]:
        links, axes, n = self.links, self.links.axes, len(self.links.axes)
        posed, travel = (links.components, links.pose_units), (links.displacement_scale,) * n
        units, sizes = (links.force_unit,) * n, (links.force_scale,) * n
        moved = (links.travel_unit,) * n
        return {
            "force": Signal("force", "actuator force", axes, units, "F_", force, sizes),
            "displacement": Signal("displacement", "stage displacement", axes, moved, "d_", displacement, travel),
            "pose": Signal("pose", "platform pose", *posed, "", pose, links.pose_scale),
            "reading": Signal("reading", "sensor reading", *posed, "reading_", reading, links.pose_scale),
        }


@dataclass
class _Member:
    """One effect on one channel, with what its law said when it was asked."""

    effect: Effect
    values: SimpleNamespace
    where: Where
    index: int
    partner: int | None
    states: dict[str, ca.SX]
    rates: dict[str, ca.SX] = field(default_factory=dict)
    stepped: dict[str, ca.SX] = field(default_factory=dict)

    def act(self, s: SimpleNamespace) -> ca.SX:
        """The term; the states' rates and new values are kept."""
        self.stepped = {name: ca.SX(value) for name, value in self.effect.update(s, self.values).items()}
        s.__dict__.update(self.stepped)
        idle = {state.name: ca.SX(float(state.clock)) for state in self.effect.states}
        self.rates = {**idle, **self.effect.rates(s, self.values)}
        return self.effect.term(s, self.values)


def channels(links: Links, place: Place) -> list[Where]:
    """Where an effect of `place` can act on a device."""
    if place in (Place.POSE, Place.SENSOR):
        rows = zip(links.components, links.pose_units, links.pose_scale, strict=True)
    elif place is Place.DRIVE and links.command_signal is not None:
        rows = ((axis, links.command_signal[1], links.command_signal[3]) for axis in links.axes)
    elif place is Place.DRIVE:
        rows = zip(links.drive.channels, links.drive.units, links.drive.scale, strict=True)
    else:
        heat = ("1", 1.0) if links.heat_signal is None else (links.heat_signal[1], links.heat_signal[3])
        unit, scale = {
            Place.HEAT: heat,
            Place.FORCE: (links.force_unit, links.force_scale),
            Place.DISPLACEMENT: (links.travel_unit, links.displacement_scale),
        }[place]
        rows = ((axis, unit, scale) for axis in links.axes)
    return [Where(*row, links.travel_unit, links.displacement_scale) for row in rows]


def available(links: Links, sample_time: float | None = None) -> frozenset[str]:
    """What a device gives an effect's law to read, in the words of `Effect.needs`."""
    present = {
        "unheated": links.heat_signal is None, "bipolar": links.bipolar, "actuator": not links.imposed,
        "velocity": links.mass is not None or links.imposed, "state": links.heat_signal is not None,
        "heat": links.heat_signal is not None, "ambient": True, "sample_time": sample_time is not None,
        "force": any(same_dimension(links.force_unit, unit) for unit in ("N", "N*m")), "spatial": len(links.components) == 6,
        "second_order": links.second_order is not None, "yielding": links.yielding is not None,
    }  # fmt: skip
    return frozenset(name for name, there in present.items() if there)


def _numbers(values: Sequence[float | ca.SX], p: ca.SX, p_nominal: np.ndarray) -> np.ndarray:
    """Values that may hold free parameters, at their nominal ones."""
    return ca.Function("rest", [p], [ca.vertcat(*map(ca.SX, values), ca.SX(0, 1))])(p_nominal).full().ravel()
