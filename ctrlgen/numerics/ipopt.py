"""Nonlinear programmes, solved by IPOPT through CasADi.

    minimise    cost(x)
    subject to  bounds[0] <= x <= bounds[1],  row_bounds[0] <= rows(x) <= row_bounds[1]

Source: A. Waechter, L. T. Biegler, Math. Program. 106 (2006) 25; the options are documented at https://coin-or.github.io/Ipopt.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import casadi as ca
import numpy as np

STOPPED = {"User_Requested_Stop", "NonIpopt_Exception_Thrown"}  # CasADi raises nothing else of its own inside IPOPT


@dataclass(frozen=True)
class NonlinearProgramme:
    """Minimise `cost` over the `unknowns` (n,), with `rows` (m,) between `row_bounds` and the unknowns between `bounds`.

    `derivatives`: CasADi's options `grad_f`, `jac_g`, `hess_lag`, for a programme whose derivatives are better stated than derived.
    """

    unknowns: ca.MX
    cost: ca.MX
    rows: ca.MX
    row_bounds: tuple[np.ndarray, np.ndarray]
    bounds: tuple[np.ndarray | float, np.ndarray | float] = (-np.inf, np.inf)
    derivatives: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class IpoptOptions:
    """Options by IPOPT's names; None leaves IPOPT's default, which may depend on the other options.

    `tol` is of the scaled optimality error.
    """

    tol: float
    max_iter: int | None = None
    mu_strategy: str | None = None
    mehrotra_algorithm: str | None = None
    nlp_scaling_method: str | None = None
    bound_relax_factor: float | None = None
    honor_original_bounds: str | None = None
    jac_c_constant: str | None = None
    jac_d_constant: str | None = None
    hessian_constant: str | None = None


@dataclass(frozen=True)
class NlpSolution:
    """The unknowns (n,) with which IPOPT ended after `iterations`; an optimum where `converged`. `status` is IPOPT's word for it."""

    unknowns: np.ndarray
    iterations: int
    converged: bool
    status: str


def solve_nlp(programme: NonlinearProgramme, start: np.ndarray | float, options: IpoptOptions) -> NlpSolution:
    """The local optimum that IPOPT reaches from `start`. Raises KeyboardInterrupt where a signal stopped it."""
    given = {f.name: getattr(options, f.name) for f in fields(options) if getattr(options, f.name) is not None}
    settings = {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes", **given}, **programme.derivatives}
    expressions = {"x": programme.unknowns, "f": programme.cost, "g": programme.rows}
    if programme.derivatives:
        expressions["p"] = ca.MX.sym("p", 0)  # functions of derivatives take parameters too
    solver = ca.nlpsol("programme", "ipopt", expressions, settings)
    (low, high), (row_low, row_high) = programme.bounds, programme.row_bounds
    answer = solver(x0=start, lbx=low, ubx=high, lbg=row_low, ubg=row_high)
    stats = solver.stats()
    if stats["return_status"] in STOPPED:
        raise KeyboardInterrupt
    return NlpSolution(answer["x"].full().ravel(), stats["iter_count"], stats["success"], stats["return_status"])
