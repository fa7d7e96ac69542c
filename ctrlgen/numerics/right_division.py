"""B A^-1 of symbolic matrices, by their entries where what is coupled is small."""

from __future__ import annotations

import casadi as ca
import numpy as np

LARGEST_WRITTEN = 6  # rows of a matrix whose inverse is written out: a few hundred operations


def over(B: ca.MX, A: ca.MX) -> ca.MX:
    """B A^-1, (m, n), of B (m, n) and a regular A (n, n) whose diagonal has no zero. Of a larger A, the rows that stand `_apart` are
    eliminated first: with A = [[P, Q], [R, D]], D diagonal, and X A = B,

    X_1 (P - Q D^-1 R) = B_1 - B_2 D^-1 R,  X_2 = (B_2 - X_1 Q) D^-1.
    """
    n = A.size1()
    if n <= LARGEST_WRITTEN:
        return B @ _inverse(A)
    apart = _apart(A.sparsity())
    core = [i for i in range(n) if i not in apart]
    P, Q, R, D = A[core, core], A[core, apart], A[apart, core], ca.diag(1 / ca.diag(A[apart, apart]))
    X_2 = B[:, apart] @ D
    X_1 = (B[:, core] - X_2 @ R) @ _inverse(P - Q @ D @ R)
    return ca.horzcat(X_1, X_2 - X_1 @ Q @ D)[:, np.argsort([*core, *apart]).tolist()]


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


def _inverse(A: ca.MX) -> ca.MX:
    """The inverse of a small matrix, by its entries; of a larger one by a QR decomposition at run time.

    Minors lose digits to the stiffness of friction's bristles; one step of Schulz, X (2 - A X), squares what is missing
    (G. Schulz, Z. angew. Math. Mech. 13 (1933) 57).
    """
    if A.size1() > LARGEST_WRITTEN:
        return ca.inv(A)
    entries = ca.SX.sym("A", A.sparsity())
    rough = ca.inv(entries)
    better = rough @ (2 * ca.SX.eye(A.size1()) - entries @ rough)
    return ca.Function("inverse", [entries], [better])(A)
