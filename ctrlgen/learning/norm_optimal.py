"""The next drives: norm-optimal iterative learning control with the device's limits, by sequential quadratic programmes.

    minimise    sum_k |W (y_k(u) + d_k - r_k)|^2 + rho^2 sum_k |(u_k - u_now,k) / s|^2
    subject to  the sample equations along the path and every limit of the device

d is what repeats beyond the model, r the command, W one over the typical size of each channel and s the drive that moves the signal by
such a size at rest. Each programme is linear about the run before it and sparse: its unknowns are drives and states of every
sample. Without an active limit it is one linear system, otherwise IPOPT solves it; composite limits are added where they would be broken.
Sources: S. Gunnarsson, M. Norrloef, Automatica 37 (2001) 2011, eq. (8); J. van Zundert, T. Oomen, Mechatronics 54 (2018) 62.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg

from ctrlgen.core.errors import SolverError
from ctrlgen.learning.lifted import Lifted, Linearised
from ctrlgen.numerics.ipopt import IpoptOptions, NonlinearProgramme, solve_nlp

STEP_WEIGHT = 1e-2  # rho: a hundredth of the signal's own weight, so that what the drives hardly move is left alone
MOST_PROGRAMMES = 6
SETTLED = 1e-7  # of the drives' range, by which the last programme still changes them
SMALLEST_STEP = 1 / 16  # of a programme's step, before it counts as no improvement
OPTIONS = IpoptOptions(
    tol=1e-9,
    honor_original_bounds="yes",
    # a quadratic programme with linear rows
    mehrotra_algorithm="yes",
    jac_c_constant="yes",
    jac_d_constant="yes",
    hessian_constant="yes",
)
ADDED_WITHIN = 0.1  # of a limit: rows of composite limits are added at samples that come so near


@dataclass(frozen=True)
class Wanted:
    """What the run is to do: `target` r - d (n, n_y), `weights` W (n_y,), and the drives `now` (n, n_u)."""

    target: np.ndarray
    weights: np.ndarray
    now: np.ndarray


def next_drives(lifted: Lifted, wanted: Wanted) -> np.ndarray:
    """The drives (n, n_u) of the next run. Raises SolverError where IPOPT finds none."""
    u = np.clip(wanted.now, *lifted.model.u_bounds)
    along = lifted.linearise(u)
    scale = drive_scale(along, wanted.weights)
    cost = _cost(along.y, u, wanted, scale)
    for _ in range(MOST_PROGRAMMES):
        full, share = _programme(lifted, along, wanted, scale), 1.0
        while True:
            tried = u + share * (full - u)
            then = lifted.linearise(tried)
            reached = _cost(then.y, tried, wanted, scale)
            if reached <= cost or share <= SMALLEST_STEP:
                break
            share /= 2
        if not reached <= cost:
            break
        moved = np.abs(tried - u).max() / np.ptp(wanted.now)
        u, along, cost = tried, then, reached
        if moved < SETTLED:
            break
    return u


def _cost(y: np.ndarray, u: np.ndarray, wanted: Wanted, scale: np.ndarray) -> float:
    off, step = wanted.weights * (y - wanted.target), STEP_WEIGHT * (u - wanted.now) / scale
    return float(np.sum(off**2) + np.sum(step**2))


def drive_scale(along: Linearised, weights: np.ndarray) -> np.ndarray:
    """(n_u,) the drive that, held, moves the weighted signal by one: the median along the path."""
    n_s = along.A.shape[1]
    held = np.linalg.lstsq
    gains = []
    for k in np.linspace(0, len(along.A) - 1, min(len(along.A), 25)).astype(int):
        moved = held(np.eye(n_s) - along.A[k], along.B[k], rcond=None)[0]
        gains.append(np.linalg.norm(weights[:, None] * (along.C[k] @ moved + along.D[k]), axis=0))
    gain = np.median(gains, axis=0)
    return 1 / np.maximum(gain, 1e-9 * max(gain.max(), 1e-300))


def _programme(lifted: Lifted, at: Linearised, wanted: Wanted, scale: np.ndarray) -> np.ndarray:
    """The drives (n, n_u) that are best for the linearised run; composite limits are added until all are kept."""
    rows = np.zeros(at.limited.shape, bool)
    while True:
        full, limited = linear_programme(lifted, at, wanted, scale, rows)
        low, high = _composite_bounds(lifted)
        near = ADDED_WITHIN * np.where(np.isfinite(high - low), high - low, np.maximum(np.abs(low), np.abs(high)))
        near = np.where(np.isfinite(near), near, 0.0)
        broken = (limited > np.maximum(high, at.limited) * (1 + 1e-9)) | (limited < np.minimum(low, at.limited))
        if not (broken & ~rows).any():
            return full
        rows |= ((limited > high - near) | (limited < low + near)) & broken.any(axis=0)


def _composite_bounds(lifted: Lifted) -> tuple[np.ndarray, np.ndarray]:
    low, high = list[float](), list[float]()
    for limit in lifted.composite:
        count = limit.expr.numel()
        low += [limit.bounds[0]] * count
        high += [limit.bounds[1]] * count
    return np.array(low), np.array(high)


def linear_programme(
    lifted: Lifted, at: Linearised, wanted: Wanted, scale: np.ndarray, rows: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """One quadratic programme in w = (dv, dS), scaled; with the composite limits of `rows` (n, n_l). The drives, and the limited
    quantities to first order."""
    m, n = lifted.model, lifted.n
    n_u, n_s = at.B.shape[2], at.B.shape[1]
    size = np.concatenate([m.x_scale, m.z_scale])
    A, B = at.A * size / size[:, None], at.B * scale / size[:, None]
    CD = wanted.weights[:, None] * np.concatenate([at.D * scale, at.C * size], axis=2)
    off = wanted.weights * (at.y - wanted.target)
    v, now = lifted.held(at.drive), lifted.held(wanted.now)
    ahead = (v - now) / scale
    blocks = np.transpose(CD, (0, 2, 1)) @ CD
    blocks[:, range(n_u), range(n_u)] += STEP_WEIGHT**2
    slope = np.einsum("kij,ki->kj", CD, off)
    slope[:, :n_u] += STEP_WEIGHT**2 * ahead
    width = n_u + n_s
    each = sp.block_diag([np.hstack([-B[k], np.eye(n_s)]) for k in range(n)], format="csr")
    equations = each - _carried(A, n_u, lifted.closed, lifted.static)
    low, high = _bounds(lifted, at, v, scale, size)
    extra, extra_low, extra_high = _rows(lifted, at, v, rows, scale, size)
    constraints = sp.vstack([equations, extra], format="csc")
    hessian = sp.block_diag(list(blocks), format="csc")
    free = _unlimited(hessian, slope.ravel(), equations.tocsc())
    bounds = low.ravel(), high.ravel(), extra_low, extra_high
    w = free if _keeps(free, extra, *bounds) else _limited(hessian, slope.ravel(), constraints, n * n_s, *bounds)
    w = w.reshape(n, width)
    dv, dS = w[:, :n_u] * scale, w[:, n_u:] * size
    limited = at.limited + np.einsum("kij,kj->ki", at.E, dS) + np.einsum("kij,kj->ki", at.G, dv)
    return np.clip(lifted.acting(v + dv, at.drive), *m.u_bounds), limited


def _unlimited(hessian: sp.csc_matrix, slope: np.ndarray, equations: sp.csc_matrix) -> np.ndarray:
    """The optimum with the sample equations alone: one sparse linear system."""
    system = sp.bmat([[hessian, equations.T], [equations, None]], format="csc")
    right = np.concatenate([-slope, np.zeros(equations.shape[0])])
    return scipy.sparse.linalg.splu(system).solve(right)[: len(slope)]


def _keeps(
    w: np.ndarray,
    extra: sp.csr_matrix,
    low: np.ndarray,
    high: np.ndarray,
    extra_low: np.ndarray,
    extra_high: np.ndarray,
) -> bool:
    rows = extra @ w
    inside = (w >= low).all() and (w <= high).all()
    return bool(inside and (rows >= extra_low).all() and (rows <= extra_high).all())


def _limited(
    hessian: sp.csc_matrix,
    slope: np.ndarray,
    constraints: sp.csc_matrix,
    equations: int,
    low: np.ndarray,
    high: np.ndarray,
    extra_low: np.ndarray,
    extra_high: np.ndarray,
) -> np.ndarray:
    """The optimum with all limits, by IPOPT, which is given the matrices as they are. Raises SolverError, and KeyboardInterrupt on a
    signal."""
    H, a = ca.MX(ca.DM(hessian)), ca.MX(ca.DM(constraints))
    w, p = ca.MX.sym("w", len(slope)), ca.MX.sym("p", 0)
    factor, multipliers = ca.MX.sym("factor"), ca.MX.sym("multipliers", constraints.shape[0])
    value, rows = ca.bilin(H, w, w) / 2 + ca.dot(ca.DM(slope), w), ca.mtimes(a, w)
    derivatives = {
        "calc_lam_p": False,
        "no_nlp_grad": True,
        "grad_f": ca.Function("nlp_grad_f", [w, p], [value, ca.mtimes(H, w) + slope], ["x", "p"], ["f", "grad_f_x"]),
        "jac_g": ca.Function("nlp_jac_g", [w, p], [rows, a], ["x", "p"], ["g", "jac_g_x"]),
        "hess_lag": ca.Function(
            "nlp_hess_l",
            [w, p, factor, multipliers],
            [ca.triu(factor * H)],
            ["x", "p", "lam_f", "lam_g"],
            ["triu_hess_gamma_x_x"],
        ),
    }
    zeros = np.zeros(equations)
    row_bounds = np.concatenate([zeros, extra_low]), np.concatenate([zeros, extra_high])
    solution = solve_nlp(NonlinearProgramme(w, value, rows, row_bounds, (low, high), derivatives), 0.0, OPTIONS)
    if not solution.converged:
        raise SolverError(
            f"IPOPT finds no drives for the next run ({solution.status}); look at the limits of the device that the recorded "
            "drives already break, or solve the scenario anew"
        )
    return solution.unknowns


def _carried(A: np.ndarray, n_u: int, closed: bool, static: bool) -> sp.csr_matrix:
    """The part of the equations that carries the state from the sample before."""
    n, n_s = len(A), A.shape[1]
    width, k = n_u + n_s, np.arange(n)
    kept = k if closed else k[1:] if not static else k[:0]
    i, j = np.meshgrid(np.arange(n_s), np.arange(n_s), indexing="ij")
    row = (kept[:, None, None] * n_s + i).ravel()
    column = (((kept - 1) % n)[:, None, None] * width + n_u + j).ravel()
    return sp.csr_matrix((A[kept].ravel(), (row, column)), shape=(n * n_s, n * width))


def _bounds(
    lifted: Lifted, at: Linearised, v: np.ndarray, scale: np.ndarray, size: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of w (n, n_u + n_s): of drives, states and displacements; what is beyond already must not go further."""
    m = lifted.model
    low_u, high_u = m.u_bounds
    low_v, high_v = low_u - v, high_u - v
    if not lifted.closed and not lifted.static:
        low_v[0] = high_v[0] = 0.0  # the path begins at rest
    low_S = np.concatenate([m.x_bounds[0], m.z_bounds[0]]) - at.S
    high_S = np.concatenate([m.x_bounds[1], m.z_bounds[1]]) - at.S
    low, high = np.hstack([low_v / scale, low_S / size]), np.hstack([high_v / scale, high_S / size])
    return np.minimum(low, 0.0), np.maximum(high, 0.0)


def _rows(
    lifted: Lifted, at: Linearised, v: np.ndarray, rows: np.ndarray, scale: np.ndarray, size: np.ndarray
) -> tuple[sp.csr_matrix, np.ndarray, np.ndarray]:
    """Composite limits at `rows` (n, n_l), and the limits on rates of drives: matrix, lower and upper bounds."""
    parts = [_composite_rows(lifted, at, rows, scale, size)]
    if lifted.model.rate_limits and not lifted.static:
        parts.append(_rate_rows(lifted, v, scale, len(scale) + len(size)))
    matrices, lows, highs = zip(*parts, strict=True)
    # what is beyond already must not go further
    return sp.vstack(matrices, format="csr"), np.minimum(np.concatenate(lows), 0), np.maximum(np.concatenate(highs), 0)


def _composite_rows(
    lifted: Lifted, at: Linearised, rows: np.ndarray, scale: np.ndarray, size: np.ndarray
) -> tuple[sp.csr_matrix, np.ndarray, np.ndarray]:
    width, (low, high), (k, i) = len(scale) + len(size), _composite_bounds(lifted), np.nonzero(rows)
    values = np.hstack([at.G[k, i] * scale, at.E[k, i] * size])
    unit = np.maximum(np.abs(values).max(axis=1, initial=0.0), 1e-300)
    places = np.repeat(np.arange(len(k)), width), (k[:, None] * width + np.arange(width)).ravel()
    matrix = sp.csr_matrix(((values / unit[:, None]).ravel(), places), shape=(len(k), lifted.n * width))
    return matrix, (low[i] - at.limited[k, i]) / unit, (high[i] - at.limited[k, i]) / unit


def _rate_rows(
    lifted: Lifted, v: np.ndarray, scale: np.ndarray, width: int
) -> tuple[sp.csr_matrix, np.ndarray, np.ndarray]:
    """Each limited drive minus itself one sample before."""
    m, n, drives = lifted.model, lifted.n, np.array(lifted.model.rate_places)
    k = np.arange(0 if lifted.closed else 1, n)
    change = (v[k] - v[k - 1])[:, drives]
    now, before = ((samples[:, None] * width + drives).ravel() for samples in (k, (k - 1) % n))
    row = np.arange(change.size)
    ones = np.ones(change.size)
    places = np.tile(row, 2), np.concatenate([now, before])
    matrix = sp.csr_matrix((np.concatenate([ones, -ones]), places), shape=(change.size, n * width))
    low, high = (((bound[drives] * lifted.sample_time - change) / scale[drives]).ravel() for bound in m.rate_bounds)
    return matrix, low, high
