"""Where a law acts that does not act everywhere: beyond an edge of one quantity, or on a short stretch of it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import casadi as ca

from ctrlgen.effects._law_inputs import Expression, LawInputs, LawNumbers
from ctrlgen.effects._parameter import Param
from ctrlgen.effects._shape_bounds import ShapeBounds, itself

EDGE = (
    Param("edge", "travel", (-5.0, 5.0), "displacement at which it sets in"),
    Param("width", "travel", (1e-5, 0.5), "width over which it sets in"),
)
STRETCH = (
    Param("position", "travel", (-5.0, 5.0), "d_0: middle of the stretch"),
    Param("length", "travel", (1e-3, 2.0), "w: length of the stretch"),
    Param("width", "travel", (1e-5, 0.5), "r: width over which it sets in and ends"),
)
# Of a sample: an integrator's step. A force that jumps between two nodes of a step acts too long or too short by a part of it.
STEP = 0.25
# Of the width w of (1 + tanh(2 x/w))/2: the straight ramp that changes as gradually, in the root mean square
RAMP = math.pi / 2
CORNER = 1e-6  # typical travels over which the corner of a spring is rounded: less than what is touched


class Side(StrEnum):
    """On which side of a number a law acts: `OUTWARD`, away from zero, by the number's sign; `BOTH`, farther from zero than it, either
    way; `AROUND`, on a stretch with the number in its middle."""

    ABOVE = "above"
    BELOW = "below"
    OUTWARD = "outward"
    BOTH = "both"
    AROUND = "around"


@dataclass(frozen=True)
class ActsIn:
    """The region of a law: of which `quantity`, on which `side` of the law's parameter `at`; `length`, of a stretch, another parameter;
    `over` the one that says how gradually it sets in, as a straight ramp of `ramp` times that about the edge would."""

    quantity: str
    at: str
    side: Side
    length: str = ""
    over: str = ""
    ramp: float = RAMP


def above(everywhere: str) -> dict[str, ShapeBounds]:
    """Of a law above an `EDGE`: one that lies below all that is recorded has no other side."""
    return {"edge": ShapeBounds(low=everywhere), **itself("width")}


def below(everywhere: str) -> dict[str, ShapeBounds]:
    """The same of a law below it."""
    return {"edge": ShapeBounds(high=everywhere), **itself("width")}


def beyond_edge(s: LawInputs, p: LawNumbers, side: int) -> Expression:
    """(1 + tanh(2 sigma (d - d_0)/W))/2, W^2 = w^2 + (v h/4)^2: zero before the edge d_0 on its `side` sigma, one beyond, changing over
    the width w, but no faster than within a quarter of a sample h, so that the moment at which the edge is crossed counts."""
    return (1 + ca.tanh(2 * side * (s.displacement - p.edge) / _over(s, p))) / 2


def on_stretch(s: LawInputs, p: LawNumbers) -> Expression:
    """`plateau` of the displacement on the `STRETCH`, W as of an edge."""
    return plateau(s.displacement - p.position, p.length, _over(s, p))


def with_end(numbers: dict[str, float]) -> dict[str, float]:
    """The numbers of a stretch one end of which is the `edge` of a law that has one end: that which is nearer to it moves there. As given
    without an edge or a stretch, and where nothing would be left of the stretch."""
    if not {"edge", "position", "length"} <= numbers.keys():
        return numbers
    edge, half = numbers["edge"], numbers["length"] / 2
    low, high = numbers["position"] - half, numbers["position"] + half
    low, high = (edge, high) if abs(edge - low) < abs(edge - high) else (low, edge)
    return numbers | {"position": (low + high) / 2, "length": high - low} if high > low else numbers


def plateau(x: Expression, length: Expression, width: Expression) -> Expression:
    """(tanh(2 (x + w/2)/W) - tanh(2 (x - w/2)/W))/2: one on the stretch w about zero, zero elsewhere, changing over W at both ends."""
    return (ca.tanh(2 * (x + length / 2) / width) - ca.tanh(2 * (x - length / 2) / width)) / 2


def _over(s: LawInputs, p: LawNumbers) -> Expression:
    """The width of an edge, or a quarter of the way of a sample."""
    h = 0.0 if math.isnan(s.sample_time) else s.sample_time
    return ca.sqrt(p.width**2 + (STEP * h * s.velocity) ** 2)


def ramp(x: Expression, corner: Expression) -> Expression:
    """x^2/(x + e), x where positive: zero before, x beyond, the corner rounded over e."""
    x = ca.fmax(x, 0)
    return x**2 / (x + corner)
