"""Weighted play operators of several widths: the elements of rate-independent hysteresis (Prandtl-Ishlinskii).

`hysteresis` of a stage, `drive_hysteresis` of a piezo stack and `displacement_hysteresis` of a joint behind the stage
share these expressions and stay three laws: the first is a restoring force that slips with the displacement and places
reversals between samples, the others are lags of a signal itself, so that their terms, units and parameters differ.
`asymmetric_lag` are the latter two with edges of their own, `weighted_hysteresis` with weights of their own; `asymmetric_hysteresis`
and `bouc_wen` are differential laws without plays.
"""

from __future__ import annotations

import casadi as ca

from ctrlgen.effects._law_inputs import LawInputs
from ctrlgen.effects._parameter import State
from ctrlgen.effects._shape_bounds import ShapeBounds, either

ELEMENTS = 8
# At the bounds of the reach, of the reversible part and of the taper
NO_LAG = either("a gain")
BESIDE_GAIN = ShapeBounds(low="a gain beside a smaller loop", high="a gain beside a smaller loop")
ONE_PLAY = ShapeBounds(low="a single play, or a gain")
LEAST_PART = 0.02  # of a play in what is left to it, where a fit begins


def play_states(unit: str) -> tuple[State, ...]:
    """The plays of a signal in `unit`, counted from where they begin, and the turning point before: P_j begins at turn + start r_j.

    At rest in the middle of all plays, at `turn`, start is 0; after a long way down to there it is 1, after a long way up -1.
    """
    plays = (State(name, unit, 1.0, stepped=True) for name in _play_names())
    return (*plays, State("turn", unit, 1.0, per_record=True), State("start", "1", 1.0, per_record=True))


def beginning(s: LawInputs, radius: ca.SX) -> ca.SX:
    """Where a play of this `radius` begins: within it; in its middle where the law has no `start`."""
    if not hasattr(s.states, "start"):
        return 0.0 * radius
    turn = s.states.turn if hasattr(s.states, "turn") else 0.0
    return turn + radius * ca.fmax(ca.fmin(s.states.start, 1.0), -1.0)


def weighted_lag(s: LawInputs, value: ca.SX, reach: ca.SX, taper: ca.SX) -> ca.SX:
    """sum_j w_j (value - P_j), w_j ~ j^-taper, sum w_j = 1."""
    weights = _weights(taper)
    return sum(w * lag for w, lag in zip(weights, lags(s, value, radii(reach)), strict=True)) / sum(weights)


def lags(s: LawInputs, value: ca.SX, widths: list[ca.SX]) -> list[ca.SX]:
    """value - P_j of the plays with these half widths."""
    return [value - getattr(s.states, name) - beginning(s, r) for name, r in zip(_play_names(), widths, strict=True)]


def following(value: ca.SX, reach: ca.SX, taper: ca.SX) -> ca.SX:
    """sum_j w_j P_j of plays that began in the middle, once their input has risen to `value`."""
    weights = _weights(taper)
    behind = sum(w * ca.fmin(r, value) for w, r in zip(weights, radii(reach), strict=True)) / sum(weights)
    return value - behind


def _weights(taper: ca.SX) -> list[ca.SX]:
    return [float(j) ** -taper for j in range(1, ELEMENTS + 1)]


def updated_plays(s: LawInputs, path: list[ca.SX], widths: list[ca.SX]) -> dict[str, ca.SX]:
    """The plays after the input has taken the values of `path` in turn: P_j stays within its half width of each value."""
    new = {}
    for name, radius in zip(_play_names(), widths, strict=True):
        first = beginning(s, radius)
        play = getattr(s.states, name) + first
        for value in path:
            play = ca.fmax(ca.fmin(play, value + radius), value - radius)
        new[name] = play - first
    return new


def kept_between(s: LawInputs, low: list[ca.SX], high: list[ca.SX], widths: list[ca.SX]) -> dict[str, ca.SX]:
    """The plays after a step at whose end P_j is within `low` ... `high`; they begin within their half `widths` at home."""
    new = {}
    for name, below, above, radius in zip(_play_names(), low, high, widths, strict=True):
        first = beginning(s, radius)
        new[name] = ca.fmax(ca.fmin(getattr(s.states, name) + first, above), below) - first
    return new


def _play_names() -> list[str]:
    return [f"play{j}" for j in range(1, ELEMENTS + 1)]


def radii(reach: ca.SX) -> list[ca.SX]:
    """r_j = reach j/8."""
    return [reach * j / ELEMENTS for j in range(1, ELEMENTS + 1)]


def graded_radii(reach: ca.SX) -> list[ca.SX]:
    """r_j = reach (j/8)^2: narrow plays closer to one another, from a 64th of the reach."""
    return [reach * (j / ELEMENTS) ** 2 for j in range(1, ELEMENTS + 1)]


def parted_weights(parts: list[ca.SX]) -> list[ca.SX]:
    """w_j (8,), of which each takes its part (7,) of what the narrower ones leave, and the last the rest: sum w_j = 1."""
    weights, left = [], 1.0
    for part in parts:
        weights.append(part * left)
        left = left * (1 - part)
    return [*weights, left]


def graded_parts(taper: float) -> list[float]:
    """The parts (7,) of graded plays that stand for plays of equal distances with w_j ~ j^-taper: each of these to the nearest. None is
    all or nothing, where the weights of the others would have no slope."""
    weights = [0.0] * ELEMENTS
    for j in range(1, ELEMENTS + 1):
        nearest = min(range(ELEMENTS), key=lambda i: abs(((i + 1) / ELEMENTS) ** 2 - j / ELEMENTS))
        weights[nearest] += float(j) ** -taper
    parts, left = [], sum(weights)
    for weight in weights[:-1]:
        parts.append(min(max(weight / left, LEAST_PART), 1 - LEAST_PART))
        left -= weight
    return parts
