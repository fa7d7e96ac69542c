"""B A^-1 of symbolic matrices, by their entries where what is coupled is small."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

LARGEST_WRITTEN = 6  # rows all coupled with each other that are eliminated one by one: beyond, a thousand operations


def over(B: ca.MX, A: ca.MX) -> ca.MX:
    """B A^-1, (m, n), of B (m, n) and a regular A (n, n) whose diagonal has no zero. The rows that stand `_apart` are eliminated first,
    then the others where these are few. Where they are many: with A = [[P, Q], [R, D]], D diagonal, and X A = B,

    X_1 (P - Q D^-1 R) = B_1 - B_2 D^-1 R,  X_2 = (B_2 - X_1 Q) D^-1.
    """
    apart = _apart(A.sparsity())
    core = [i for i in range(A.size1()) if i not in apart]
    if len(core) <= LARGEST_WRITTEN:
        given = ca.SX.sym("B", B.sparsity()), ca.SX.sym("A", A.sparsity())
        return ca.Function("over", list(given), [_by_elimination(*given, [*apart, *core])])(B, A)
    P, Q, R, D = A[core, core], A[core, apart], A[apart, core], ca.diag(1 / ca.diag(A[apart, apart]))
    X_2 = B[:, apart] @ D
    X_1 = (B[:, core] - X_2 @ R) @ ca.inv(P - Q @ D @ R)
    return ca.horzcat(X_1, X_2 - X_1 @ Q @ D)[:, np.argsort([*core, *apart]).tolist()]


def _by_elimination(B: ca.SX, A: ca.SX, order: Sequence[int]) -> ca.SX:
    """B A^-1 by Gauss's elimination in an `order` of the diagonal, without a search for pivots. In an implicit step A is 1 - M N_Y, near
    the identity where the rates N are slow, of a large positive diagonal where they are stiff and stable: no pivot is small."""
    A, B, over_pivot = ca.SX(A), ca.SX(B), {}
    for i, k in enumerate(order):
        over_pivot[k] = 1 / A[k, k]
        later = list(order[i + 1 :])
        for j in (j for j in later if A[k, j].nnz()):
            times = A[k, j] * over_pivot[k]
            A[later, j] -= A[later, k] * times
            B[:, j] -= B[:, k] * times
    for i, k in reversed(list(enumerate(order))):
        for j in (j for j in order[i + 1 :] if A[j, k].nnz()):
            B[:, k] -= B[:, j] * A[j, k]
        B[:, k] *= over_pivot[k]
    return B


def _apart(pattern: ca.Sparsity) -> list[int]:
    """Rows of a square matrix none of which holds an entry in the column of another of them, found in the order of their entries, the
    fewest first: the lags of one creep, each of which follows the displacement alone."""
    n, entries = pattern.size1(), np.zeros(pattern.shape, dtype=bool)
    entries[pattern.row(), pattern.get_col()] = True
    coupled = (entries | entries.T) & ~np.eye(n, dtype=bool)
    found: list[int] = []
    for i in np.argsort(coupled.sum(axis=1), kind="stable").tolist():
        if not coupled[i, found].any():
            found.append(i)
    return sorted(found)
