"""Equations with a symmetric, positive matrix as expressions without pivots.

Source: G. H. Golub, C. F. Van Loan, Matrix Computations (4th ed.), section 4.2.
"""

from __future__ import annotations

import functools
from typing import Any, TypeAlias

import casadi as ca

Matrix: TypeAlias = ca.SX | ca.DM


def solve_symmetric(A: Matrix, right: Matrix) -> Matrix:
    """x (n, m) with A x = `right`, A (n, n) symmetric and positive, of which the lower triangle is read."""
    return substitute(factor(A), right)


def factor(A: Matrix) -> Matrix:
    """A (n, n), symmetric and positive -> L below the diagonal and D on it with A = L D L'; its lower triangle is read.

    With lengths in such units that forces and moments are of similar magnitude it needs no pivots: a third of the operations of the QR
    decomposition that CasADi would write, which are what a compiler sees of a mechanism.
    """
    return _factor(A.shape[0])(A)


def substitute(factors: Matrix, right: Matrix) -> Matrix:
    """x (n, m) with L D L' x = `right`, L below the diagonal and D on it."""
    return _substitution(*right.shape)(factors, right)


@functools.cache
def _factor(n: int) -> ca.Function:
    A = ca.SX.sym("A", n, n)
    F = ca.SX(ca.Sparsity.lower(n))
    for i in range(n):
        for j in range(i):
            F[i, j] = (A[i, j] - sum(F[i, k] * F[k, k] * F[j, k] for k in range(j))) / F[j, j]
        F[i, i] = A[i, i] - sum(F[i, k] ** 2 * F[k, k] for k in range(i))
    return ca.Function("factor", [A], [F])


@functools.cache
def _substitution(n: int, columns: int) -> ca.Function:
    F, right = ca.SX.sym("F", ca.Sparsity.lower(n)), ca.SX.sym("b", n, columns)
    rows: list[Any] = []
    for i in range(n):
        rows.append(right[i, :] - sum(F[i, k] * rows[k] for k in range(i)))
    rows = [row / F[i, i] for i, row in enumerate(rows)]
    for i in reversed(range(n)):
        rows[i] = rows[i] - sum(F[k, i] * rows[k] for k in range(i + 1, n))
    return ca.Function("substitution", [F, right], [ca.vertcat(*rows)])
