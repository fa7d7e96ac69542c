"""What a part loses little by little: the share of it that is gone at a time."""

from __future__ import annotations

import casadi as ca

from ctrlgen.effects._law_inputs import LawInputs, LawNumbers
from ctrlgen.effects._parameter import State

CLOCK = (State("t", "s", 1.0, clock=True),)


def lost_share(s: LawInputs, p: LawNumbers) -> ca.SX:
    """r T (1 - exp(-t/T)), t from the common zero of the records' clock: r per second at first, r T in the end."""
    return p.rate * p.levels_off * (1 - ca.exp(-s.states.t / p.levels_off))
