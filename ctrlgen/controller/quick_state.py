"""The actuator state that a displacement needs, by polynomials in place of roots, quotients and Newton steps.

Where each row of the kernel follows from one displacement alone it is replaced by a polynomial over the displacement's range, off by
less than a `SHARE` of the range in the displacement (`ctrlgen.numerics.proven_polynomial`). The model itself is not changed.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ctrlgen.numerics.proven_polynomial import ProvenPolynomial, proven_inverse, proven_polynomial

SHARE = 1e-7  # of the range: less than two roundings of a float at its end, 6 pm of the MEMS hexapod's 55 um
REACH_SHARE = 5e-7  # of the range: what a float's slack of the drives leaves room for, half of it on the MEMS hexapod
CHEAP = frozenset((ca.OP_ADD, ca.OP_SUB, ca.OP_MUL, ca.OP_NEG, ca.OP_SQ, ca.OP_TWICE, ca.OP_ASSIGN))


@dataclass(frozen=True)
class QuickState:
    """`state` (x, z, wanted) -> actuator states as polynomials; the highest `degree`, and `off` [SI], by how much a displacement
    appears changed at most."""

    state: ca.Function
    degree: int
    off: float


@dataclass(frozen=True)
class QuickReach:
    """`displacement` (x,) actuator states -> displacements (n,) as polynomials, those of states beyond the range at its ends, where they
    are exact; the highest `degree`, `off` [m] by how much, and `state_off` (n,) [SI] by how much a state appears changed at most."""

    displacement: ca.Function
    degree: int
    off: float
    state_off: np.ndarray


def quick_reach(state: ca.Function, low: np.ndarray, high: np.ndarray) -> QuickReach | None:
    """The inverse of a kernel `state` whose rows follow from the displacement of the same row each, for displacements low ... high (n,),
    off by less than `REACH_SHARE` of the range. None where a row has none."""
    x = ca.SX.sym("x", state.size1_out(0))
    known: dict[str, ProvenPolynomial | None] = {}
    values: list[ca.SX] = []
    found: list[ProvenPolynomial] = []
    for i, row in enumerate(of_one_displacement(state)):
        if row is None or row[0] != i:
            return None
        f = row[1]
        key = f"{f(ca.SX.sym('v'))} {low[i]!r} {high[i]!r}"
        if key not in known:
            known[key] = proven_inverse(f, float(low[i]), float(high[i]), REACH_SHARE)
        polynomial = known[key]
        if polynomial is None:
            return None
        ends = sorted(float(f(bound)) for bound in (low[i], high[i]))
        values.append(polynomial.of(ca.fmin(ca.fmax(x[i], ends[0]), ends[1])))
        found.append(polynomial)
    if not found:
        return None
    function = ca.Function("reached", [x], [ca.vertcat(*values)], ["x"], ["result"])
    degree, off = max(len(p.coefficients) - 1 for p in found), max(p.off for p in found)
    return QuickReach(function, degree, off, np.array([p.off / p.flattest for p in found]))


def quick_state(state: ca.Function, low: np.ndarray, high: np.ndarray) -> QuickState | None:
    """The polynomials of a kernel `state` for displacements low ... high (n,); None where a row has none, or needs none."""
    rows = state_polynomials(state, low, high, even_cheap=False)
    if not rows:
        return None
    names = ["x", "z", "wanted"]
    x, z, wanted = (ca.SX.sym(name, *state.size_in(name)) for name in names)
    values = ca.vertcat(*(polynomial.of(wanted[i]) for i, polynomial in rows))
    degree = max(len(polynomial.coefficients) - 1 for _, polynomial in rows)
    off = max(polynomial.off for _, polynomial in rows)
    return QuickState(ca.Function("state", [x, z, wanted], [values], names, ["result"]), degree, off)


def state_polynomials(
    state: ca.Function, low: np.ndarray, high: np.ndarray, even_cheap: bool
) -> tuple[tuple[int, ProvenPolynomial], ...] | None:
    """Of each row of a kernel `state` the displacement that it is a function of, and its polynomial for displacements low ... high (n,);
    None where a row has none, or, unless `even_cheap`, where it is one already."""
    polynomials: dict[str, ProvenPolynomial | None] = {}
    found: list[tuple[int, ProvenPolynomial]] = []
    for each in of_one_displacement(state):
        if each is None:
            return None
        i, f = each
        if not even_cheap and _is_cheap(f):
            return None
        key = f"{f(ca.SX.sym('v'))} {low[i]!r} {high[i]!r}"
        if key not in polynomials:
            polynomials[key] = proven_polynomial(f, float(low[i]), float(high[i]), SHARE)
        polynomial = polynomials[key]
        if polynomial is None:
            return None
        found.append((i, polynomial))
    return tuple(found)


def of_one_displacement(state: ca.Function) -> list[tuple[int, ca.Function] | None]:
    """Of each row of a kernel `state` the displacement that it is a function of, and the function; None for a row that is of none, or of
    more."""
    x, z, wanted = (ca.SX.sym(name, *state.size_in(name)) for name in ("x", "z", "wanted"))
    found: list[tuple[int, ca.Function] | None] = []
    for row in ca.vertsplit(state(x, z, wanted)) if state.size1_out(0) else []:
        places = ca.jacobian_sparsity(row, wanted).get_col()
        if len(places) != 1 or ca.depends_on(row, ca.vertcat(x, z)):
            found.append(None)
            continue
        i, own = int(places[0]), ca.SX.sym("v")
        found.append((i, ca.Function("f", [own], [ca.substitute(row, wanted[i], own)], {"cse": True})))
    return found


def _is_cheap(f: ca.Function) -> bool:
    cheap = CHEAP | {ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST}
    return all(f.instruction_id(k) in cheap for k in range(f.n_instructions()))
