"""More drives than axes, sample by sample: the drives of least effort within ranges and rates, in a fixed number of operations.

The weighted pseudo-inverse (`ctrlgen.model.allocation`) gives the drives u of least effort without limits. All drives that push alike are

    u + sum_g t_g w_g,   B w_g = 0,

and their effort is that of u plus a multiple of t_g^2 for each g where the w_g move different drives. Each w_g is one-dimensional, so that
limits leave an interval of t_g, and of it the number nearest to zero gives the least effort within limits: exact, without iteration. Drives
of which more than one can be moved without a push while the same others stand still are not dealt with.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
import scipy

from ctrlgen.controller.drive_rate import RateLimiter
from ctrlgen.model.allocation import INDEPENDENT
from ctrlgen.model.model import Model

NOTHING = 1e-12  # of the largest share of a drive in what pushes nothing: rounding


@dataclass(frozen=True, eq=False)
class NullMotion:
    """`direction` (n_u,) of the drives that push nothing together, the largest of a group 1; `groups`: which drives each moves;
    `low`, `high` (n_u,) their ranges."""

    direction: np.ndarray
    groups: tuple[tuple[int, ...], ...]
    low: np.ndarray
    high: np.ndarray

    def within(
        self, drive: np.ndarray, slowest: np.ndarray | None = None, fastest: np.ndarray | None = None
    ) -> np.ndarray:
        """`drive` (n_u,) moved along the null space into its range as little as can be, and, as far as the range allows, into
        `slowest` ... `fastest`. Where there are no such drives, out of range."""
        u = drive.copy()
        for those in self.groups:
            t = 0.0
            if slowest is not None and fastest is not None:
                t = self._into(t, drive, those, slowest, fastest)
            t = self._into(t, drive, those, self.low, self.high)
            for i in those:
                u[i] = drive[i] + t * self.direction[i]
        return u

    def _into(self, t: float, drive: np.ndarray, those: tuple[int, ...], low: np.ndarray, high: np.ndarray) -> float:
        """The number nearest to `t` of the interval that low ... high leave."""
        least, most = -np.inf, np.inf
        for i in those:
            ends = (low[i] - drive[i]) * (1 / self.direction[i]), (high[i] - drive[i]) * (1 / self.direction[i])
            least, most = max(least, min(ends)), min(most, max(ends))
        return min(max(t, least), most)


def of_least_effort(
    drive: np.ndarray, redundancy: NullMotion | None, rate: RateLimiter | None, *last: np.ndarray
) -> np.ndarray:
    """Gives, of all drives (n_u,) that push as `drive`, those of least effort within limits, and where there is a `rate` within it from the
    `last` ones as far as these allow."""
    if redundancy is None:
        return drive
    window = () if rate is None else (last[0] + rate.fall, last[0] + rate.rise)
    return redundancy.within(drive, *window)


def why_no_null_motion(model: Model) -> str | None:
    """Why the drives of least effort within limits have no such answer; None where they have, or there is nothing to choose."""
    if not model.redundant:
        return None
    if ca.depends_on(_slope(model), model.z):
        return "has more drives than axes, and forces whose slope by the drives changes with the displacement"
    for columns, moves in _parts(model):
        if moves.shape[1] > 1:
            names = ", ".join(model.signals["drive"].channels[i] for i in columns)
            return (
                f"has drives ({names}) with {moves.shape[1]} free choices for each motion; the controller can make one"
            )
    return None


def null_motion(model: Model) -> NullMotion | None:
    """That of a model with more drives than axes; None where there is none (`why_no_null_motion`)."""
    if not model.redundant or why_no_null_motion(model) is not None:
        return None
    direction, groups = np.zeros(model.u.numel()), []
    for columns, moves in _parts(model):
        if moves.shape[1]:
            w = moves[:, 0] * model.u_scale[columns]
            w[np.abs(w) <= NOTHING * np.abs(w).max()] = 0.0
            direction[columns] = w / w[np.argmax(np.abs(w))]
            groups.append(tuple(int(i) for i in columns if direction[i]))
    return NullMotion(direction, tuple(groups), *model.u_bounds)


def _slope(model: Model) -> ca.SX:
    """B (n_axes, n_u) [SI], the force by each drive."""
    return ca.substitute(ca.jacobian(model.balance, model.u), model.p, ca.DM(model.p_nominal))


def _parts(model: Model) -> list[tuple[np.ndarray, np.ndarray]]:
    """(drives, what of them pushes nothing (n, k), in typical sizes) of each set of drives that act on the same axes."""
    B = (
        ca.Function("B", [model.z], [ca.densify(_slope(model))])(0 * model.z_scale).full()
        * model.u_scale
        / model.force_scale
    )
    acts = (np.abs(B) > NOTHING * np.abs(B).max()).astype(float)
    count, part = scipy.sparse.csgraph.connected_components(acts.T @ acts, directed=False)
    parts = []
    for k in range(count):
        columns = np.flatnonzero(part == k)
        rows = np.any(acts[:, columns] > 0, axis=1)
        parts.append((columns, scipy.linalg.null_space(B[np.ix_(rows, columns)], rcond=INDEPENDENT)))
    return parts
