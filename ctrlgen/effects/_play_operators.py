"""Weighted play operators of several widths: the elements of rate-independent hysteresis (Prandtl-Ishlinskii).

`hysteresis` of a stage and `drive_hysteresis` of a piezo stack share these expressions and stay two laws: the one is a restoring
force that slips with the displacement and places reversals between samples, the other a lag of the drive itself, so that their
terms, units and parameters differ. `asymmetric_hysteresis` and `bouc_wen` are differential laws without plays.
"""

from __future__ import annotations

from types import SimpleNamespace

import casadi as ca

ELEMENTS = 8


def play_names() -> list[str]:
    """Names of the states that hold the plays P_1 to P_8."""
    return [f"play{j}" for j in range(1, ELEMENTS + 1)]


def weighted_lag(s: SimpleNamespace, value: ca.SX, taper: ca.SX) -> ca.SX:
    """sum_j w_j (value - P_j), w_j ~ j^-taper, sum w_j = 1."""
    weights = [float(j) ** -taper for j in range(1, ELEMENTS + 1)]
    return sum(w * (value - getattr(s, name)) for w, name in zip(weights, play_names(), strict=True)) / sum(weights)


def updated_plays(s: SimpleNamespace, path: list[ca.SX], reach: ca.SX) -> dict[str, ca.SX]:
    """The plays after the input has taken the values of `path` in turn: P_j stays within r_j = reach j/8 of each value."""
    new = {}
    for j, name in enumerate(play_names(), start=1):
        radius, new[name] = reach * j / ELEMENTS, getattr(s, name)
        for value in path:
            new[name] = ca.fmax(ca.fmin(new[name], value + radius), value - radius)
    return new
