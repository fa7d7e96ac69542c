"""Drives of least effort within their limits, for a device with more drives than axes.

The inverse of the device with one force for each axis (`ctrlgen.model.allocation`) gives the forces f_k that a path takes; the drives are

    minimise    sum_k sum_i w_i (u_k,i / r_i)^2
    subject to  B_k u_k = f_k,    low <= u_k <= high,    low rate <= (u_k - u_k-1) / T <= high rate.

Where the closed form keeps the limits it is the answer. Else a linear programme says whether any drives keep them: if so IPOPT finds
those of least effort, a convex quadratic programme; if not, its drives break the limits by the least sum, in shares of their ranges,
which is what an explanation names. Where limits on rates couple the samples and only an answer is asked for, two smaller programmes
give it for most paths. Some samples k_1 < k_2 < ... have to satisfy

    low rate <= (u_k_j+1 - u_k_j) / (k_j+1 - k_j) T <= high rate,

as the mean of what the samples between them keep: where no drives do, none follow the path. Those farthest inside of the limits are
joined by lines in time and corrected to B_k u_k = f_k; where these keep every limit, they follow it.
"""

from __future__ import annotations

from dataclasses import replace
from enum import Enum
from functools import cached_property
from itertools import combinations

import casadi as ca
import numpy as np

from ctrlgen.devices.limit import ranges, spans
from ctrlgen.model.allocation import INDEPENDENT, Allocation, effort_weights
from ctrlgen.model.model import Model
from ctrlgen.trajectory.inverse.clock import Settled
from ctrlgen.trajectory.inverse.drive_programmes import (
    Refutation,
    diagonal,
    least_excess,
    least_squares,
    least_worst,
    limited_rows,
    polished,
)
from ctrlgen.trajectory.inverse.motion import Motion
from ctrlgen.trajectory.inverse.path_inverse import PERIODS, InverseTrajectory, PathInverse
from ctrlgen.trajectory.inverse.violations import NEGLIGIBLE, violations

COARSE = 100  # samples along a path that decide for most whether its rates can be kept
SURE = 1e-4  # of a range, by which a path must break limits for the multipliers of another path to say so: they are rounded
FOLLOWS = 1e-2  # share of a correction that a drive takes whose rate is limited, where others can

Bounds = tuple[np.ndarray, np.ndarray]  # lower and upper, (n_u,) or (n_axes,)


class Wanted(Enum):
    """Which drives are asked for."""

    LEAST = "those of least effort"
    ANY = "any that keep the limits"


class RedundantInverse(PathInverse):
    """The inverse of a `model` with more drives than axes: `inner` is that of the forces, `allocation` the drives of least effort."""

    def __init__(self, model: Model, inner: PathInverse, allocation: Allocation) -> None:
        super().__init__(model, inner.follow, inner.clock)
        self.inner, self.allocation = inner, allocation

    @property
    def without_memories(self) -> RedundantInverse:
        """The same of the device without the effects that have memories."""
        plain = self.inner.without_memories
        return self if plain is self.inner else RedundantInverse(self.model, plain, self.allocation)

    def trajectory(self, motion: Motion, periods: int = PERIODS) -> InverseTrajectory:
        """The trajectory of the forces, with drives instead of these. The drives break limits only where none keep them."""
        return self._allocated(self.inner.trajectory(motion, periods), motion)

    def held(self, motion: Motion) -> InverseTrajectory:
        """The trajectory of held forces, with drives instead of these."""
        return self._allocated(self.inner.held(motion), motion)

    def displacements(self, motion: Motion) -> np.ndarray:
        """The displacements (n, n_axes) of the inverse of the forces."""
        return self.inner.displacements(motion)

    def at_rest(self, target: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The equilibrium of the inverse of the forces, with the drives of least effort."""
        x, z, f = self.inner.at_rest(target)
        return x, z, self.drives(z[None], f[None])[0]

    def slope(self, target: np.ndarray) -> np.ndarray:
        """The slope (n_axes, channels) of the inverse of the forces."""
        return self.inner.slope(target)

    def keeps_limits(
        self, motion: Motion, chosen: np.ndarray | None = None, margin: float = 0.0, periods: int = PERIODS
    ) -> bool:
        """By the samples `chosen` where nothing but the samples matters; with limits on rates and samples `chosen`, paths within a
        thousandth or so of a limit are taken as beyond it."""
        if self._rate_bounds(margin) is not None and chosen is not None and len(motion) >= 2 * COARSE:
            return self._evidently_keeps(motion, margin, periods)
        if self.model.rate_limits or self._facets is None:
            needed = self._allocated(self.inner.trajectory(motion, periods), motion, margin, Wanted.ANY)
            return needed.solved and not needed.violations(self.model, margin)
        separate = self.inner.equilibria_at(motion if chosen is None else motion.at(chosen))
        if separate is None:
            needed = self.inner.trajectory(motion, periods)
            if not needed.solved:
                return False
            separate = needed.x, needed.z, needed.u
        x, z, f = separate
        u = np.clip(self._closed_form(z, f), *self._bounds(margin))
        return self._attainable(f, margin) and not violations(self.model, x, z, u, margin)

    def _evidently_keeps(self, motion: Motion, margin: float, periods: int) -> bool:
        """Whether drives that join those of few samples keep every limit. What these samples take is looked at before all others are."""
        closed = motion.closed
        n = len(motion) if closed else len(motion) + 1
        k = np.unique(np.linspace(0, n - 1, COARSE).round().astype(int))
        few = self._pushed_at(motion, k)
        if few is not None and not self._within_reach(*few, margin):
            return False
        bounds, rates, gaps = self._bounds(margin), self._rate_bounds(margin), _gaps(k, n, closed)
        assert rates is not None  # asked for by `keeps_limits`
        coarse = None
        if few is not None and np.any(_out(self._closed_form(*few), bounds, rates, gaps)):
            coarse = self._coarse(self._slopes(few[0]), few[1], bounds, rates, gaps)
            if coarse is None:
                return False
        needed = self.inner.trajectory(motion, periods)
        z, f = self._pushed(needed, motion)
        if not needed.solved or not self._within_reach(z, f, margin):
            return False
        u, B = self._closed_form(z, f), self._slopes(z)
        if np.any(_out(u, bounds, rates, _gaps(np.arange(n), n, closed))):
            coarse = self._coarse(B[k], f[k], bounds, rates, gaps) if coarse is None else coarse
            joined = None if coarse is None else self._joined(k, coarse, B, f, bounds, rates, closed)
            if joined is None:
                return False
            u = joined
        return not _with_drives(needed, u).violations(self.model, margin)

    def _allocated(
        self, needed: InverseTrajectory, motion: Motion, margin: float = 0.0, wanted: Wanted = Wanted.LEAST
    ) -> InverseTrajectory:
        """The trajectory `needed` of the forces, with the `wanted` drives instead of these."""
        if not np.all(np.isfinite(needed.u)):
            u = np.full((len(needed.u), self.model.u.numel()), np.nan)
            return replace(needed, u=u, u_start=u[0])
        if isinstance(self.clock, Settled):
            u = self.drives(needed.z, needed.u, margin=margin, wanted=wanted)
            return replace(needed, u=u, u_start=u[0])
        z, f = self._pushed(needed, motion)
        return _with_drives(needed, self.drives(z, f, needed.closed, margin, wanted))

    def _pushed(self, needed: InverseTrajectory, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """Where each held drive leads, and the force it pushes with; before an open path stands that which holds its first target."""
        z = needed.z[motion.following]
        if motion.closed:
            return z, needed.u
        _, z_start, f_start = self.inner.at_rest(motion.position[0])
        return np.vstack([z_start, z]), np.vstack([f_start, needed.u])

    def _pushed_at(self, motion: Motion, places: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Displacements and forces as in `_pushed`, at some `places` alone; None where these take all samples."""
        if motion.closed:
            return self.inner.leads_to(motion, places)
        later = self.inner.leads_to(motion, places[1:] - 1)
        if later is None:
            return None
        _, z_start, f_start = self.inner.at_rest(motion.position[0])
        return np.vstack([z_start, later[0]]), np.vstack([f_start, later[1]])

    def drives(
        self, z: np.ndarray, f: np.ndarray, closed: bool = False, margin: float = 0.0, wanted: Wanted = Wanted.LEAST
    ) -> np.ndarray:
        """(n, n_u) the drives that push with the forces `f` (n, n_axes) at the displacements `z`, in time one after the other."""
        n, u, bounds, rates = len(f), self._closed_form(z, f), self._bounds(margin), self._rate_bounds(margin)
        out = _out(u, bounds, rates, _gaps(np.arange(n), n, closed))
        chosen = out if np.all(np.isfinite(u)) else np.zeros(n, dtype=bool)
        if chosen.any():
            u[chosen] = self._solved(self._slopes(z[chosen]), f[chosen], u[chosen], bounds, rates, closed, wanted)
        return u

    def _closed_form(self, z: np.ndarray, f: np.ndarray) -> np.ndarray:
        """(n, n_u) the drives of least effort without limits."""
        return self.allocation.drive.map(len(f))(z.T, f.T).full().T

    @cached_property
    def _facets(self) -> np.ndarray | None:
        """(m, n_axes) the normals of the set of forces that drives within limits give, {B u}, a zonotope: each is normal to n_axes - 1
        columns of B. None where B changes with the displacement, or drives have no limits. Source: P. McMullen, Trans. Amer. Math. Soc.
        159 (1971) 91."""
        m, (low, high) = self.model, self.model.u_bounds
        if ca.depends_on(ca.jacobian(m.balance, m.u), m.z) or not np.all(np.isfinite(high - low)):
            return None
        B, n = self._slopes(np.zeros((1, len(m.axes))))[0] * (high - low) / m.force_scale, len(m.axes)
        normals = []
        for columns in combinations(range(B.shape[1]), n - 1):
            _, sizes, rows = np.linalg.svd(B[:, columns].T, full_matrices=True)
            if n == 1 or sizes.min() > INDEPENDENT * np.abs(B).max():
                normals.append(rows[-1])
        return np.array(normals) / m.force_scale

    def _within_reach(self, z: np.ndarray, f: np.ndarray, margin: float) -> bool:
        """Whether the displacements `z` are in range, and drives within their limits give the forces `f` as far as `_facets` tell."""
        low, high = _narrowed(self.model.z_bounds, margin)
        slack = NEGLIGIBLE * ranges((low, high), self.model.z_scale)
        if not np.all(np.isfinite(f)) or np.any((z < low - slack) | (z > high + slack)):
            return False
        return self._facets is None or self._attainable(f, margin)

    def _attainable(self, f: np.ndarray, margin: float) -> bool:
        """Whether drives within their limits give each of the forces `f` (n, n_axes)."""
        assert self._facets is not None
        low, high = self._bounds(margin)
        along = self._facets @ self._slopes(np.zeros((1, f.shape[1])))[0]
        most, least = (np.maximum(along * a, along * b).sum(axis=1) for a, b in ((low, high), (-low, -high)))
        pushed = f @ self._facets.T
        slack = NEGLIGIBLE * np.abs(along * (high - low)).max(axis=1)
        return bool(np.all(pushed <= most + slack) and np.all(-pushed <= least + slack))

    def _slopes(self, z: np.ndarray) -> np.ndarray:
        """(n, n_axes, n_u) B at each displacement."""
        n, n_u = len(z), self.model.u.numel()
        return self._B.map(n)(z.T).full().reshape(-1, n, n_u).swapaxes(0, 1)

    @cached_property
    def _B(self) -> ca.Function:
        m = self.model
        return ca.Function(
            "B", [m.z], [ca.densify(ca.substitute(ca.jacobian(m.balance, m.u), m.p, ca.DM(m.p_nominal)))]
        )

    def _bounds(self, margin: float) -> Bounds:
        return _narrowed(self.model.u_bounds, margin)

    def _rate_bounds(self, margin: float) -> Bounds | None:
        """Of the change from one sample to the next; None where the samples do not act on one another so."""
        if isinstance(self.clock, Settled) or not self.model.rate_limits:
            return None
        low, high = _narrowed(self.model.rate_bounds, margin)
        return low * self.clock.sample_time, high * self.clock.sample_time

    def _solved(
        self,
        B: np.ndarray,
        f: np.ndarray,
        begin: np.ndarray,
        bounds: Bounds,
        rates: Bounds | None,
        closed: bool,
        asked: Wanted,
    ) -> np.ndarray:
        """The programme of the module's text, begun at the closed form; where no drives keep the limits, or not those of least
        effort are `asked` for, those that break them least, or where the answer is no, perhaps the closed form."""
        m, n, n_u = self.model, len(f), self.model.u.numel()
        if rates is not None and asked is Wanted.ANY and n >= 2 * COARSE:
            k = np.unique(np.linspace(0, n - 1, COARSE).round().astype(int))
            coarse = self._coarse(B[k], f[k], bounds, rates, _gaps(k, n, closed))
            if coarse is None:
                return begin
            joined = self._joined(k, coarse, B, f, bounds, rates, closed)
            if joined is not None:
                return joined
        span = 1 / np.sqrt(effort_weights(m) / m.drive_weights)
        shares = B * span
        size = np.linalg.norm(shares, axis=2)  # what full drives push
        pushed = diagonal(shares / size[:, :, None])
        limited = limited_rows(bounds, rates, span, _gaps(np.arange(n), n, closed), n)
        wanted = (f / size).ravel()
        least, excess = least_excess(pushed, wanted, limited)
        if excess > NEGLIGIBLE or asked is not Wanted.LEAST:
            return least.reshape(n, n_u) * span
        weights = np.tile(m.drive_weights / m.drive_weights.max(), n)
        u = least_squares(weights, pushed, wanted, limited, (begin / span).ravel()).reshape(n, n_u) * span
        return polished(u, shares, f, (bounds[0] / span, bounds[1] / span), span)

    def _coarse(
        self, B: np.ndarray, f: np.ndarray, bounds: Bounds, rates: Bounds, gaps: np.ndarray
    ) -> np.ndarray | None:
        """Drives of few samples, `gaps` apart, farthest inside of the limits; None where these show that none keep them."""
        span = 1 / np.sqrt(effort_weights(self.model) / self.model.drive_weights)
        shares = B * span
        size = np.linalg.norm(shares, axis=2)
        limited, wanted = limited_rows(bounds, rates, span, gaps, len(f)), (f / size).ravel()
        if any(r.excess(wanted, limited) > SURE for r in self._refutations):
            return None
        least, excess, refutation = least_worst(diagonal(shares / size[:, :, None]), wanted, limited)
        if excess > NEGLIGIBLE and self._facets is not None:  # what refutes this path may refute the next
            self._refutations.append(refutation)
        return None if excess > NEGLIGIBLE else least.reshape(len(f), -1) * span

    @cached_property
    def _refutations(self) -> list[Refutation]:
        """What has shown of paths that no drives keep their limits, for slopes B that are the same everywhere."""
        return []

    def _joined(
        self,
        k: np.ndarray,
        coarse: np.ndarray,
        B: np.ndarray,
        f: np.ndarray,
        bounds: Bounds,
        rates: Bounds,
        closed: bool,
    ) -> np.ndarray | None:
        """The drives `coarse` of the samples `k` joined by lines in time and corrected to the forces `f`; None where they break limits."""
        n, span = len(f), 1 / np.sqrt(effort_weights(self.model) / self.model.drive_weights)
        at = np.arange(n)
        if closed:
            k, coarse = np.append(k, n), np.vstack([coarse, coarse[:1]])
        u = np.column_stack([np.interp(at, k, drive) for drive in coarse.T])
        yields = np.where(np.isfinite(rates[1] - rates[0]), FOLLOWS, 1.0) * span  # most where no rate is limited
        missing = np.linalg.solve((B * yields**2) @ B.swapaxes(1, 2), f[:, :, None] - B @ u[:, :, None])
        u += (yields[:, None] ** 2 * (B.swapaxes(1, 2) @ missing))[:, :, 0]
        return None if np.any(_out(u, bounds, rates, _gaps(at, n, closed))) else u


def _gaps(k: np.ndarray, n: int, closed: bool) -> np.ndarray:
    """Samples from each of `k` to the next, on a closed path of `n` also from the last to the first."""
    return np.append(np.diff(k), n - k[-1] + k[0]) if closed else np.diff(k)


def _out(u: np.ndarray, bounds: Bounds, rates: Bounds | None, gaps: np.ndarray) -> np.ndarray:
    """(n,) whether drives break their bounds; where they, or the `rates` over their `gaps`, break any limit, all do: one acts on the
    others."""
    out = np.any((u < bounds[0]) | (u > bounds[1]), axis=1)
    if rates is not None:
        change = (np.roll(u, -1, axis=0) - u)[: len(gaps)] / gaps[:, None]
        out[:] = np.any(out) or np.any((change < rates[0]) | (change > rates[1]))
    return out


def _with_drives(needed: InverseTrajectory, u: np.ndarray) -> InverseTrajectory:
    """`needed` with the held drives `u`, of an open path that before it among them."""
    return replace(needed, u=u, u_start=u[-1]) if needed.closed else replace(needed, u=u[1:], u_start=u[0])


def _narrowed(bounds: Bounds, margin: float) -> Bounds:
    """Bounds moved inward by a share of the range, or of the bound where there is one."""
    low, high = bounds
    size = spans(bounds)
    by = margin * np.where(np.isfinite(size), size, 0.0)
    return low + by, high - by
