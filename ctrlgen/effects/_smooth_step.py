"""A smooth step in time: the shape of an event that happens once and lasts."""

from __future__ import annotations

import casadi as ca

from ctrlgen.effects import LawInputs, LawNumbers, Param, State

WHEN = (
    Param("moment", "s", (-1e6, 1e6), "time of the middle of the step"),
    Param("rise", "s", (1e-4, 1.0), "duration of the step", paced=True),
)
CLOCK = (State("t", "s", 1.0, clock=True),)


def smooth_step(s: LawInputs, p: LawNumbers) -> ca.SX:
    """e(t) = (1 + tanh(pi (t - t_0)/T))/2, from 0 to 1; t counts from the common zero of the records' clock.

    It has the spread in time of a linear ramp from t_0 - T/2 to t_0 + T/2: 4 % at the ramp's start, 96 % at its end. Of a step
    shorter than a sample, a recording shows the middle only.
    """
    return (1 + ca.tanh(ca.pi * (s.states.t - p.moment) / p.rise)) / 2
