"""What a law may read."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Self, TypeAlias

import casadi as ca

Expression: TypeAlias = ca.SX
LawNumbers: TypeAlias = SimpleNamespace
"""The parameters of a law in SI, by name."""


@dataclass(frozen=True, kw_only=True)
class LawInputs:
    """What `Effect.term`, `rates` and `update` are given beside the law's parameters; all in SI.

    What only some devices or places have is None elsewhere; a law that `requires` it is not placed there.
    """

    value: Expression
    """The signal of this channel, before the effects of the same order at this place."""
    all: Expression
    """That signal for every channel, as a vector."""
    index: int
    """The place of this channel in `all`."""
    partner: int | None
    """The place of the other channel of a pair, at `partner_place` where the law names one."""
    scale: float
    """A typical size of the signal."""
    travel: float
    """A typical stage displacement."""
    states: SimpleNamespace
    """The law's own states by name; what `update` gave them where they are stepped."""
    ambient: Expression
    """The rise of the surroundings' temperature [K]."""
    sample_time: float
    """[s]; NaN where there is none."""
    displacements: Expression
    """Of all axes."""
    velocities: Expression
    """Of all axes; empty for a device without inertia."""
    second_order_kinematics: Callable[[], Expression]
    """() -> what finite rotations add to the pose, a vector; see `DevicePhysics`."""
    tangent_compliance: Callable[[], Expression]
    """() -> by how much less the stages yield than at home, a vector; see `BalancedPhysics`."""
    drives: Expression = None
    """What the amplifiers deliver at this instant, a vector over the channels of `Place.DRIVE`; at the sensor's place."""
    rate: Expression | None = None
    """The derivative of `value` [1/s]; where the motion gives it, at places of the platform."""
    second_rate: Expression | None = None
    """Its second derivative [1/s^2]; for `update` only."""
    displacement: Expression = None
    """Of this axis; at places of an axis, as all below."""
    velocity: Expression = None
    """Of this axis; None for a device without inertia."""
    accelerations: Expression = None
    """Of all axes; of an imposed motion only."""
    force: Expression = None
    """What the stage takes at this displacement."""
    temperature: Expression = None
    """The state of this axis's heater."""
    temperature_at_rest: Expression = None
    """The same at rest."""
    holding_heat: Expression = None
    """The power that holds the heater at its temperature, which is what it loses there [W]; without the laws of the heat."""

    def with_states(self, states: Mapping[str, Expression]) -> Self:
        """The same with other values of some states."""
        return replace(self, states=SimpleNamespace(**{**vars(self.states), **states}))
