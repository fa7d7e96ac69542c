"""A piezo stack that works against a stiffness: blocked force, own stiffness, voltage. Linear, without hysteresis and creep."""

from __future__ import annotations

from typing import Any

from ctrlgen.physics.screw import Scalar


def stiffness(a: Any) -> Scalar:
    """k_p = F_b/s [N/m]: blocking force divided by free stroke."""
    return a.blocking_force / a.stroke


def blocked_force(V: Scalar, a: Any) -> Scalar:
    """F_b V/V_max [N] at zero travel, `V` [V]."""
    return a.blocking_force / a.voltage_limit * V


def voltage_rate(V: Scalar, u: Scalar, a: Any) -> Scalar:
    """dV/dt = (u - V)/tau [V/s]: the amplifier's output resistance charges the stack."""
    return (u - V) / a.time_constant
