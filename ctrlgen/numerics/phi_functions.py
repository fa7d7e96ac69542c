"""The functions phi_k(M) = sum_j M^j/(j + k)!, k = 0, 1, 2, ...: phi_0 = e^M, phi_k = M phi_(k+1) + 1/k!.

y' = A y + v_1 + v_2 s + v_3 s^2/2, s = t/h from 0 to 1, is solved by y(h) = e^(hA) y(0) + h sum_k phi_k(hA) v_k.
Source: M. Hochbruck, A. Ostermann, Acta Numerica 19 (2010) 209, eqs. (2.10)-(2.13).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import factorial

import casadi as ca
import numpy as np
import scipy

HELD_ORDER = 12  # of the series of phi_1 for a held drive: its remainder is 1/13! for |hA| = 1
RAMP_ORDER = 18  # of the series of phi_1 to phi_3 for a linear drive: its remainder is 1/19!, below rounding
# |h rate| below which phi_k of one lag is summed: its closed form loses digits to cancellation there.
SERIES_BELOW = 1.0


def phi_matrices(M: np.ndarray, count: int) -> list[np.ndarray]:
    """[phi_0, ..., phi_count] of a matrix M (n, n), each (n, n); M may be singular.

    They are the first row of blocks of the exponential of one larger matrix, eq. (2.11); 1/k! of what M neither moves nor is moved by,
    which is left out of it: its size goes into the time by the third power.
    """
    n = len(M)
    moving = M.any(axis=0) | M.any(axis=1)
    if not moving.all():
        phi = [np.eye(n) / factorial(k) for k in range(count + 1)]
        if moving.any():
            for whole, part in zip(phi, phi_matrices(M[np.ix_(moving, moving)], count), strict=True):
                whole[np.ix_(moving, moving)] = part
        return phi
    large = np.zeros(((count + 1) * n, (count + 1) * n))
    large[:n, :n] = M
    for k in range(count):
        large[k * n : (k + 1) * n, (k + 1) * n : (k + 2) * n] = np.eye(n)
    phi = np.split(scipy.linalg.expm(large)[:n], count + 1, axis=1)
    if n == 1 and M[0, 0]:
        phi[1] = np.expm1(M) / M  # to rounding, also for lags that are over within a sample
    return phi


def held_gain(rate: ca.SX, h: float | ca.SX) -> ca.SX:
    """h phi_1(h rate) of one lag, h where the rate is identically zero: one exponential, since generated C computes it in
    every sample. Its relative error is the rounding divided by |h rate|."""
    return h if rate.is_zero() else (ca.exp(rate * h) - 1) / rate


def varied_gain(rate: ca.SX, h: ca.SX, longest: float) -> ca.SX:
    """`held_gain` of an h that is a symbol, positive and at most `longest`. Of a lag that is slower than that by its series, whose
    remainder is below rounding: the closed form would lose the digits of short times."""
    if rate.is_zero() or not rate.is_constant() or abs(float(rate)) * longest > SERIES_BELOW:
        return held_gain(rate, h)
    a, largest = rate * h, abs(float(rate)) * longest
    order = next(k for k in range(1, RAMP_ORDER + 1) if largest**k / factorial(k + 1) < np.finfo(float).eps / 4)
    total = ca.SX(1 / factorial(order))
    for j in range(order - 1, 0, -1):
        total = total * a + 1 / factorial(j)
    return h * total


def increment(A: ca.SX, values: Sequence[ca.SX], h: float, doublings: int) -> ca.SX:
    """h sum_k phi_k(h A) v_k (n,) for `values` v_1, v_2, ... (at most three), A (n, n) coupling the states.

    The series for h/2^doublings, where |h A|/2^doublings must not exceed 1, then phi_k(2 M) from phi_j(M), j <= k.
    """
    order = HELD_ORDER if len(values) == 1 else RAMP_ORDER
    if not doublings:
        total = 0
        for k, value in enumerate(values, 1):
            term = h / factorial(k) * value
            total = total + term
            for j in range(k + 1, order + k):
                term = h / j * ca.mtimes(A, term)
                total += term
        return total
    M, one = h / 2**doublings * A, ca.SX.eye(A.size1())
    phi = []
    for k in range(1, len(values) + 1):
        term = total = one / factorial(k) if k > 1 else one
        for j in range(k + 1, order + k):
            term = ca.mtimes(M, term) / j
            total += term
        phi.append(total)
    exponential = one + ca.mtimes(M, phi[0])
    for _ in range(doublings):
        phi, exponential = _doubled(phi, exponential), ca.mtimes(exponential, exponential)
    return h * sum(ca.mtimes(p, value) for p, value in zip(phi, values, strict=True))


def _doubled(phi: list[ca.SX], exponential: ca.SX) -> list[ca.SX]:
    """phi_1(2 M), phi_2(2 M), phi_3(2 M), as many as `phi` holds, from those of M and e^M."""
    doubled = [(phi[0] + ca.mtimes(exponential, phi[0])) / 2]
    if len(phi) > 1:
        doubled.append((ca.mtimes(phi[0], phi[0]) + 2 * phi[1]) / 4)
    if len(phi) > 2:
        doubled.append((ca.mtimes(phi[0], phi[1]) + 2 * phi[2] + phi[1]) / 8)
    return doubled


def lag_increment(rates: ca.SX, values: Sequence[ca.SX], h: float) -> ca.SX:
    """`increment` for uncoupled lags: `rates` (n,) is the diagonal of A. Exact to rounding for every h rate."""
    phi = [_scalar_phi(h * rate, len(values)) for rate in ca.vertsplit(rates)]
    return h * sum(ca.vertcat(*(of_lag[k] for of_lag in phi)) * value for k, value in enumerate(values))


def _scalar_phi(a: ca.SX, count: int) -> list[ca.SX]:
    """[phi_1(a), ..., phi_count(a)] of one number: the series near zero, the closed form elsewhere."""
    small = ca.fabs(a) < SERIES_BELOW
    safe = ca.if_else(small, 1.0, a)  # keeps 0/0 out of the branch that is not taken
    closed, phi = ca.expm1(safe) / safe, []
    for k in range(1, count + 1):
        term = total = ca.SX(1 / factorial(k))
        for j in range(k + 1, RAMP_ORDER + k):
            term = term * a / j
            total += term
        phi.append(ca.if_else(small, total, closed))
        closed = (closed - 1 / factorial(k)) / safe
    return phi
