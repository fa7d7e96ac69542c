"""Something that happens at one moment and lasts: the shape that several effects share."""

from __future__ import annotations

from types import SimpleNamespace

import casadi as ca

from ctrlgen.effects import Param, State

WHEN = (
    Param("moment", "s", (-1e6, 1e6), "middle of its rise"),
    Param("rise", "s", (1e-4, 1.0), "time it takes"),
)
CLOCK = (State("t", "s", 1.0, clock=True),)


def smooth_step(s: SimpleNamespace, p: SimpleNamespace) -> ca.SX:
    """(1 + tanh(pi (t - t_0)/T))/2 from 0 to 1, t from the common zero of the records' clock.

    It spreads in time as a straight rise from t_0 - T/2 to t_0 + T/2 does: 4 % are there at its begin, 96 % at its end.
    Of a rise that is shorter than a sample records tell the middle alone.
    """
    return (1 + ca.tanh(ca.pi * (s.t - p.moment) / p.rise)) / 2
