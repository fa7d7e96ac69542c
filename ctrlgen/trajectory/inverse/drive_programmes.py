"""The programmes that choose the drives of all samples at once: linear for whether limits can be kept, quadratic for least effort.

Drives are counted in shares of their ranges, s_i = u_i / r_i, and forces in what full drives push, so that every number is near one.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
import scipy  # its optimize takes a while to import, and comes when it is used
import scipy.sparse as sp

from ctrlgen.core.errors import SolverError
from ctrlgen.devices.limit import ranges
from ctrlgen.model.allocation import INDEPENDENT
from ctrlgen.numerics.ipopt import IpoptOptions, NonlinearProgramme, solve_nlp

TOLERANCE = 1e-10  # of a share: IPOPT's of the optimality error, the linear programme's of each row
OPTIONS = IpoptOptions(
    tol=TOLERANCE,
    max_iter=200,
    mu_strategy="adaptive",
    nlp_scaling_method="none",
    bound_relax_factor=0.0,
    # a quadratic programme with linear rows
    jac_c_constant="yes",
    jac_d_constant="yes",
    hessian_constant="yes",
)
NEAR = 1e-6  # ranges from a limit within which a drive is at it


@dataclass(frozen=True)
class Rows:
    """low <= A s <= high, rows without a bound left out, in shares of ranges; `over` the samples over which each row is a mean."""

    A: sp.csr_array
    low: np.ndarray
    high: np.ndarray
    over: np.ndarray

    def __post_init__(self) -> None:
        kept = np.flatnonzero(np.isfinite(self.low) | np.isfinite(self.high))
        for name in ("A", "low", "high", "over"):
            object.__setattr__(self, name, getattr(self, name)[kept])

    def joined(self, other: Rows) -> Rows:
        """These rows and those of `other` below each other."""
        A = sp.vstack([self.A, other.A], format="csr")
        low, high = np.append(self.low, other.low), np.append(self.high, other.high)
        return Rows(A, low, high, np.append(self.over, other.over))

    @property
    def bounds(self) -> np.ndarray:
        """The upper bounds of A s and -A s, infinite where there is none."""
        return np.append(self.high, -self.low)


@dataclass(frozen=True)
class Refutation:
    """Multipliers that show by weak duality that drives break limits: y (2 m,) <= 0 of the bounds of m rows of means over one sample, v of
    the forces."""

    y: np.ndarray
    v: np.ndarray

    def excess(self, wanted: np.ndarray, limited: Rows) -> float:
        """What drives must at least break limits by, as in `least_worst`, where they push as `wanted`, with the same slopes and bounds and
        as many samples as where the multipliers are from: with rows a_i of the limits, sum y_i a_i = -v B, so that
        t sum |y_i| >= v f + sum y_i b_i."""
        if len(self.y) != 2 * len(limited.over) or len(self.v) != len(wanted):
            return -np.inf
        y, bounded = self.y * np.tile(limited.over, 2), self.y != 0
        return float((self.v @ wanted + y[bounded] @ limited.bounds[bounded]) / -y.sum())


def diagonal(blocks: np.ndarray) -> sp.csr_array:
    """The block diagonal matrix of `blocks` (n, rows, columns)."""
    n = len(blocks)
    return sp.bsr_array((blocks, np.arange(n), np.arange(n + 1))).tocsr()


def limited_rows(
    bounds: tuple[np.ndarray, np.ndarray],
    rates: tuple[np.ndarray, np.ndarray] | None,
    span: np.ndarray,
    gaps: np.ndarray,
    n: int,
) -> Rows:
    """The limits of the drives of `n` samples, and of their changes, `gaps` times the `rates`, from each to the next, of a closed path also
    from the last to the first."""
    low, high = (np.tile(bound / span, n) for bound in bounds)
    limited = Rows(sp.eye(n * len(span), format="csr"), low, high, np.ones(n * len(span)))
    if rates is None:
        return limited
    allowed = ranges(rates, span)
    step = (sp.eye(n, k=1) - sp.eye(n) + sp.eye(n, k=1 - n)).tocsr()[: len(gaps)]
    change = sp.kron(sp.diags_array(1 / gaps) @ step, sp.diags_array(span / allowed), format="csr")
    slowest, fastest = (np.tile(rate / allowed, len(gaps)) for rate in rates)
    return limited.joined(Rows(change, slowest, fastest, np.repeat(gaps, len(span))))


def least_worst(pushed: sp.csr_array, wanted: np.ndarray, limited: Rows) -> tuple[np.ndarray, float, Refutation]:
    """Drives that push as `wanted` and stay inside of limits, or break them, by the same most or least share; that share, negative inside,
    and what shows that it is no less; by a linear programme. Raises SolverError."""
    one = sp.csr_array(np.ones((len(limited.low), 1)))
    return _programme(pushed, wanted, limited, one, -1.0)


def least_excess(pushed: sp.csr_array, wanted: np.ndarray, limited: Rows) -> tuple[np.ndarray, float]:
    """Drives that push as `wanted` and break limits by the least sum, and that sum; by a linear programme. Raises SolverError."""
    return _programme(pushed, wanted, limited, sp.eye(limited.A.shape[0], format="csr"), 0.0)[:2]


def _programme(
    pushed: sp.csr_array, wanted: np.ndarray, limited: Rows, beyond: sp.csr_array, least: float
) -> tuple[np.ndarray, float, Refutation]:
    """Minimises the sum of excesses e >= `least`, low - `beyond` e <= A s <= high + `beyond` e; s, the largest e, and the multipliers.
    Raises SolverError."""
    n, m = limited.A.shape[1], beyond.shape[1]
    given = np.isfinite(limited.bounds)
    A = sp.vstack([sp.hstack([limited.A, -beyond]), sp.hstack([-limited.A, -beyond])], format="csr")[given]
    answer = scipy.optimize.linprog(
        np.append(np.zeros(n), np.ones(m)),
        A_ub=A,
        b_ub=limited.bounds[given],
        b_eq=wanted,
        A_eq=sp.hstack([pushed, sp.csr_array((len(wanted), m))]),
        method="highs",
        options={"primal_feasibility_tolerance": TOLERANCE},
        bounds=np.column_stack([np.append(np.full(n, -np.inf), np.full(m, least)), np.full(n + m, np.inf)]),
    )
    if answer.x is None:
        raise SolverError(
            f"no drives give the forces that the path needs ({answer.message}); command a smaller or slower path"
        )
    y = np.zeros(len(given))
    y[given] = answer.ineqlin.marginals
    refutation = Refutation(y / np.tile(limited.over, 2), answer.eqlin.marginals)
    return answer.x[:n], float(answer.x[n:].max(initial=least)), refutation


def least_squares(
    weights: np.ndarray, pushed: sp.csr_array, wanted: np.ndarray, limited: Rows, begin: np.ndarray
) -> np.ndarray:
    """The drives of least effort among those that push as `wanted` within limits, by IPOPT. Raises SolverError where it finds none."""
    A = sp.vstack([pushed, limited.A], format="csc")
    s = ca.MX.sym("s", A.shape[1])
    row_bounds = np.append(wanted, limited.low), np.append(wanted, limited.high)
    programme = NonlinearProgramme(s, ca.dot(weights, s**2), ca.mtimes(ca.DM(A), s), row_bounds)
    solution = solve_nlp(programme, begin, OPTIONS)
    if not solution.converged:
        raise SolverError(
            f"IPOPT found no drives of least effort ({solution.status}); command a smaller or slower path"
        )
    return solution.unknowns


def polished(
    u: np.ndarray, shares: np.ndarray, f: np.ndarray, bounds: tuple[np.ndarray, np.ndarray], span: np.ndarray
) -> np.ndarray:
    """`u` with what IPOPT's tolerance leaves of the forces `f` taken up by the drives that are not at a limit."""
    s = u / span
    for k, share in enumerate(shares):
        free = share * ~np.any(np.abs(s[k] - np.array(bounds)) < NEAR, axis=0)
        s[k] += np.linalg.lstsq(free, f[k] - share @ s[k], rcond=INDEPENDENT)[0]
    return s * span
