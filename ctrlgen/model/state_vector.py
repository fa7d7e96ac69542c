"""The states x of a model: of the actuators, of the effects, and the velocities of axes with inertia."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ctrlgen.core.units import base_unit
from ctrlgen.devices import DevicePhysics
from ctrlgen.effects import State
from ctrlgen.model.effect_terms import Member

TYPICAL_RATE = 100.0  # 1/s: a typical velocity is a typical displacement times this
Memory = tuple[Member, State, ca.SX]  # a state of an effect on one channel, and its symbol


@dataclass(frozen=True)
class Component:
    """One component of x: its symbol, name, SI unit, typical size and value at `rest`, which may hold free parameters."""

    symbol: ca.SX
    name: str
    unit: str
    scale: float
    rest: float | ca.SX = 0.0


def components(physics: DevicePhysics, memories: Sequence[Memory], v: ca.SX) -> list[Component]:
    """The components of x in their order."""
    state, listed = physics.state, list[Component]()
    if state is not None:
        names = (f"{state.name}_{channel}" for channel in state.channels)
        columns = zip(
            ca.vertsplit(state.expr), names, map(base_unit, state.units), state.scale, physics.rest, strict=True
        )
        listed += [Component(*column) for column in columns]
    listed += [
        Component(x, x.name(), base_unit(m.channel.unit_of(s)), m.channel.si(s.scale, s)) for m, s, x in memories
    ]
    unit, scale = base_unit(f"({physics.travel_unit})/s"), TYPICAL_RATE * physics.displacement_scale
    velocities = zip(ca.vertsplit(v), physics.axes, strict=False)
    return listed + [Component(x, f"velocity_{axis}", unit, scale) for x, axis in velocities]


@dataclass(frozen=True)
class MemoryPlaces:
    """Places in x of the effects' states that are not integrated, or that need an implicit integrator; see `Model`."""

    stepped: dict[int, ca.SX]
    resting: dict[int, ca.SX]
    clocks: tuple[int, ...]
    bristles: tuple[int, ...]
    free: tuple[int, ...]
    arbitrary: tuple[int, ...]


def memory_places(memories: Sequence[Memory], first: int, closed: Callable[[ca.SX], ca.SX]) -> MemoryPlaces:
    """The places of the effects' states, of which the `first` is the first in x; `closed` completes what a new value is made of."""
    placed = [(first + k, member, state) for k, (member, state, _) in enumerate(memories)]
    bristles = tuple(k for k, m, s in placed if m.effect.set_valued and not (s.stepped or s.clock))
    return MemoryPlaces(
        {k: closed(m.stepped[s.name]) for k, m, s in placed if s.stepped},
        {k: closed(m.resting[s.name]) for k, m, s in placed if s.name in m.resting},
        tuple(k for k, _, s in placed if s.clock),
        bristles,
        tuple(k for k, _, s in placed if s.free or k in bristles),
        tuple(k for k, _, s in placed if s.arbitrary),
    )


def at_nominal(values: Sequence[float | ca.SX], p: ca.SX, p_nominal: np.ndarray) -> np.ndarray:
    """Values that may hold free parameters, at their nominal ones."""
    return ca.Function("rest", [p], [ca.vertcat(*map(ca.SX, values), ca.SX(0, 1))])(p_nominal).full().ravel()
