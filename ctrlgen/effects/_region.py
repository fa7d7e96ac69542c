"""Where a law acts that does not act everywhere: beyond one displacement, with the edge smoothed."""

from __future__ import annotations

import casadi as ca

from ctrlgen.effects import Expression, LawInputs, LawNumbers, Param

EDGE = (
    Param("edge", "travel", (-5.0, 5.0), "displacement at which it sets in"),
    Param("width", "travel", (3e-4, 0.5), "width over which it sets in"),
)


def beyond_edge(s: LawInputs, p: LawNumbers, side: int) -> Expression:
    """(1 + tanh(2 sigma (d - d_0)/w))/2: zero before the edge d_0 on its `side` sigma, one beyond, changing over the width w."""
    return (1 + ca.tanh(2 * side * (s.displacement - p.edge) / p.width)) / 2
