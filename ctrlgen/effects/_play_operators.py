"""Plays of several widths, weighted: what hysteresis that does not depend on the rate is made of (Prandtl-Ishlinskii)."""

from __future__ import annotations

from types import SimpleNamespace

import casadi as ca

ELEMENTS = 8


def names() -> list[str]:
    """Of the states that hold the plays P_1 to P_8."""
    return [f"play{j}" for j in range(1, ELEMENTS + 1)]


def lagging(s: SimpleNamespace, value: ca.SX, taper: ca.SX) -> ca.SX:
    """sum_j w_j (value - P_j), w_j ~ j^-taper, sum w_j = 1."""
    weights = [float(j) ** -taper for j in range(1, ELEMENTS + 1)]
    return sum(w * (value - getattr(s, name)) for w, name in zip(weights, names(), strict=True)) / sum(weights)


def followed(s: SimpleNamespace, path: list[ca.SX], reach: ca.SX) -> dict[str, ca.SX]:
    """The plays after the values of a `path`, one after the other: P_j stays within r_j = reach j/8 of each."""
    new = {}
    for j, name in enumerate(names(), start=1):
        radius, new[name] = reach * j / ELEMENTS, getattr(s, name)
        for value in path:
            new[name] = ca.fmax(ca.fmin(new[name], value + radius), value - radius)
    return new
