"""A chain of relaxations whose time constants are evenly apart on a logarithmic scale, from tau to 10^D tau."""

from __future__ import annotations

import casadi as ca

from ctrlgen.effects._law_inputs import Expression, LawInputs, LawNumbers
from ctrlgen.effects._parameter import Param, State

CHAIN = range(9)
RELAXATIONS = tuple(State(f"z{j}", "travel", 1.0) for j in CHAIN)
SPECTRUM = (
    Param("tau", "s", (1e-3, 1e2), "shortest relaxation time", paced=True),
    Param("decades", "1", (1.0, 7.0), "D: decades after which it ends"),
)


def spacing(p: LawNumbers) -> Expression:
    """s, decades between two relaxation times: half a one, or more where nine of them have more to cover."""
    return ca.fmax(p.decades / len(CHAIN), 0.5)


def within(p: LawNumbers) -> list[Expression]:
    """w_j = min(max(D/s - j, 0), 1), what of each relaxation time lies within the decades."""
    return [ca.fmin(ca.fmax(p.decades / spacing(p) - j, 0.0), 1.0) for j in CHAIN]


def relaxed(s: LawInputs, weights: list[Expression]) -> Expression:
    """sum_j w_j z_j."""
    return sum(w * getattr(s.states, f"z{j}") for j, w in zip(CHAIN, weights, strict=True))


def relaxation_rates(s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
    """dz_j/dt = (d - z_j)/(10^(j s) tau)."""
    ratio = 10.0 ** spacing(p)
    return {f"z{j}": (s.value - getattr(s.states, f"z{j}")) / (ratio**j * p.tau) for j in CHAIN}
