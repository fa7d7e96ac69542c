"""A function of displacements in as few coordinates as it depends on.

A motion that strains nothing changes no stress. Where f does not change along directions v_k, and the numbers v_ki at as many places i as
there are directions make a matrix that can be inverted, f(z) = f(z - sum_k lambda_k v_k) with those lambda for which these places are
zero: f follows from the others alone. Of the hexapod on three flat stages these are four in place of six, because no translation in their
plane strains a wire.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca
import numpy as np
import scipy

POINTS = 16  # at random in the range of displacements, at which slopes are taken: none is special
NOTHING = (
    1e-10  # of the steepest direction: the slope along one that changes nothing, as inverses of matrices were rounded
)


class FewCoordinates(NamedTuple):
    """`coordinates` (wanted,) -> few; `function` (few,) -> what the function is there."""

    coordinates: ca.Function
    function: ca.Function


def few_coordinates(function: ca.Function, low: np.ndarray, high: np.ndarray) -> FewCoordinates | None:
    """That of a `function` (x, z, wanted) for displacements low ... high (n,); None where it depends on all of them, or on x or z."""
    x, z, wanted = (ca.SX.sym(name, *function.size_in(name)) for name in ("x", "z", "wanted"))
    f = function(x, z, wanted) if function.n_in() == 3 else ca.SX(0, 1)
    if f.is_empty() or ca.depends_on(f, ca.vertcat(x, z)):
        return None
    slope = ca.Function("slope", [wanted], [ca.jacobian(f, wanted)])
    points = np.random.default_rng(1).uniform(low, high, (POINTS, len(low)))
    slopes = np.vstack([slope(point).full() for point in points]) * (high - low)
    if not np.all(np.isfinite(slopes)):
        return None
    steep, directions = np.linalg.svd(slopes)[1:]
    still = directions[np.sum(steep > NOTHING * steep[0]) :].T * (high - low)[:, None]
    count = still.shape[1]
    if not 0 < count < len(low):
        return None
    gone = np.sort(scipy.linalg.qr(still.T, pivoting=True)[2][:count])
    kept = np.setdiff1d(np.arange(len(low)), gone)
    by = still @ np.linalg.inv(still[gone])  # column k moves place gone_k by one, and no other of them
    by[np.abs(by) < NOTHING] = 0.0
    few = wanted[kept] - ca.mtimes(ca.sparsify(ca.DM(by[kept])), wanted[gone])
    own = ca.SX.sym("few", len(kept))
    at = ca.SX.zeros(len(low))
    at[kept] = own
    names = ["wanted"], ["few"], ["shares"]
    return FewCoordinates(
        ca.Function("coordinates", [wanted], [few], names[0], names[1]),
        ca.Function("of_few", [own], [ca.substitute(f, wanted, at)], names[1], names[2], {"cse": True}),
    )
