"""Dahl's bristles: a contact that bends, then slides."""

from __future__ import annotations

import casadi as ca

from ctrlgen.effects import Expression, LawInputs, LawNumbers, Param, State

STILL = 1e-6  # of v_s: keeps speed/tanh(speed) from being 0/0 at rest
SHARPEST = 1e-5  # typical travels a second: v_s of a contact that does not creep, as Dahl's
CONTACT = (
    Param("force", "channel", (0.0, 1.0), "force of sliding", off=0.0),
    Param("reach", "travel", (1e-6, 0.03), "displacement over which the contact yields"),
    Param("smoothing", "travel/s", (SHARPEST, 1e3), "v_s, below which it creeps"),
)
BRISTLES = (State("z", "1", 1.0),)


def bristle_rate(s: LawInputs, p: LawNumbers) -> Expression:
    """dz/dt = v (1 - z/tanh(v/v_s))/r: z from -1 to 1, over about the reach r."""
    speed = ca.sqrt((s.velocity / p.smoothing) ** 2 + STILL**2)
    return (s.velocity - p.smoothing * speed / ca.tanh(speed) * s.states.z) / p.reach
