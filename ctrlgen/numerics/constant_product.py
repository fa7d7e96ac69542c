"""M v of a constant matrix, written out number by number."""

from __future__ import annotations

import casadi as ca


def product(M: ca.DM, v: ca.SX | ca.MX) -> ca.SX | ca.MX:
    """M (m, n) v of a vector v (n,). Of a symbol of matrices it is a function with the entries of M in it: the product of a sparse matrix
    by a vector takes three times as long, looking up its places."""
    if isinstance(v, ca.SX):
        return M @ v
    numbers = ca.SX.sym("v", v.numel())
    return ca.Function("product", [numbers], [ca.densify(M @ numbers)])(v)
