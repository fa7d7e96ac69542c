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

from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from itertools import combinations

import casadi as ca
import numpy as np
import scipy.sparse as sp
from scipy.optimize import linprog

from ctrlgen.core.errors import SolverError
from ctrlgen.model.allocation import INDEPENDENT, Allocation, allocate, effort_weights
from ctrlgen.model.model import Model
from ctrlgen.trajectory.inertial_inverse import InertialInverse
from ctrlgen.trajectory.motion import Command, Motion, samples_of
from ctrlgen.trajectory.path_inverse import PERIODS, InverseTrajectory, PathInverse
from ctrlgen.trajectory.sampled_inverse import SampledTrajectory
from ctrlgen.trajectory.violations import NEGLIGIBLE, violations

TOLERANCE = 1e-10  # of a share: IPOPT's of the optimality error, the linear programme's of each row
MOST_ITERATIONS = 200
NEAR = 1e-6  # ranges from a limit within which a drive is at it
COARSE = 100  # samples along a path that decide for most whether its rates can be kept
FOLLOWS = 1e-2  # share of a correction that a drive takes whose rate is limited, where others can


class Wanted(Enum):
    """Which drives are asked for."""

    LEAST = "those of least effort"
    ANY = "any that keep the limits"
    EVIDENT = "any that keep the limits where few samples show that some do"


class LeastEffortInverse:
    """The inverse of a `model` with more drives than axes along paths of its signal `follow`: `inner` is that of the forces."""

    def __init__(self, model: Model, inner: PathInverse | InertialInverse, allocation: Allocation) -> None:
        self.model, self.inner, self.allocation = model, inner, allocation
        self.sample_time = inner.sample_time

    @property
    def without_memories(self) -> LeastEffortInverse:
        """The same of the device without the effects that have memories."""
        plain = self.inner.without_memories
        return self if plain is self.inner else LeastEffortInverse(self.model, plain, self.allocation)

    def trajectory(self, command: Command, closed: bool, periods: int = PERIODS) -> InverseTrajectory:
        """What a path takes; the drives break limits only where none keep them."""
        return self._allocated(self._forces(command, closed, periods), samples_of(command)[0], closed)

    def _forces(self, command: Command, closed: bool, periods: int) -> InverseTrajectory:
        """What a path takes, with forces instead of drives."""
        if isinstance(self.inner, InertialInverse):
            return self.inner.trajectory(command, closed, periods)
        assert isinstance(command, np.ndarray)  # of devices in balance only samples are followed
        return self.inner.trajectory(command, closed, periods)

    def sampled(self, command: Motion, closed: bool) -> SampledTrajectory:
        """The drives that lead a device with inertia along the samples of `command` while each is held. Raises SolverError."""
        assert isinstance(self.inner, InertialInverse)
        found = self.inner.sampled(command, closed)
        return replace(found, u=self.needed(found, command, closed).u)

    def needed(self, found: SampledTrajectory, command: Motion, closed: bool) -> InverseTrajectory:
        """Sampled forces, or drives, as what the motion takes."""
        forces = (
            found.u
            if found.u.shape[1] == len(self.model.axes)
            else np.einsum("kij,kj->ki", self._slopes(found.z), found.u)
        )
        begin = InverseTrajectory(found.x, found.z, forces, forces[0], True)
        return self._allocated(begin, command.position[0], closed)

    def displacements(self, command: Command, closed: bool) -> np.ndarray:
        """z (n, n_axes) along a path, whatever the drives."""
        return self._forces(command, closed, PERIODS).z

    def at_rest(self, target: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """x, z and u of the equilibrium at `target`; not finite where there is none."""
        x, z, f = self.inner.at_rest(target)
        return x, z, self.drives(z[None], f[None])[0]

    def slope(self, target: np.ndarray) -> np.ndarray:
        """(n_axes, channels) d displacement / d target at rest there."""
        return self.inner.slope(target)

    def keeps_limits(
        self,
        command: Command,
        closed: bool,
        chosen: np.ndarray | None = None,
        margin: float = 0.0,
        periods: int = PERIODS,
    ) -> bool:
        """Whether `command` can be followed with a `margin`, a share of each limit; where nothing but the samples matters, judged by
        those `chosen`; with limits on rates and samples `chosen`, paths within a thousandth or so of a limit are taken as beyond it."""
        if self.model.rate_limits or self._facets is None:
            found = self._forces(command, closed, periods)
            wanted = Wanted.ANY if chosen is None else Wanted.EVIDENT
            found = self._allocated(found, samples_of(command)[0], closed, margin, wanted)
            return found.solved and not found.violations(self.model, self.sample_time, closed, margin)
        if isinstance(command, np.ndarray) and isinstance(self.inner, PathInverse) and not self.inner.remembers:
            x, z, f = self.inner.equilibria(command if chosen is None else command[chosen])
        else:
            found = self._forces(command, closed, periods)
            x, z, f = found.x, found.z, found.u
            if not found.solved:
                return False
        u = np.clip(self.allocation.drive.map(len(z))(z.T, f.T).full().T, *self._bounds(margin))
        return self._attainable(f, margin) and not violations(self.model, x, z, u, margin)

    def _allocated(
        self, found: InverseTrajectory, first: np.ndarray, closed: bool, margin: float = 0.0, wanted: Wanted = Wanted.LEAST
    ) -> InverseTrajectory:  # fmt: skip
        """`found` with drives instead of forces."""
        if not np.all(np.isfinite(found.u)):
            u = np.full((len(found.u), self.model.u.numel()), np.nan)
            return replace(found, u=u, u_start=u[0])
        if self.sample_time is None:
            u = self.drives(found.z, found.u, margin=margin, wanted=wanted)
            return replace(found, u=u, u_start=u[0])
        z = np.vstack([found.z[1:], found.z[:1] if closed else found.z[-1:]])  # where each drive leads
        if closed:
            u = self.drives(z, found.u, closed, margin, wanted)
            return replace(found, u=u, u_start=u[-1])
        _, z_start, f_start = self.inner.at_rest(first)
        u = self.drives(np.vstack([z_start, z]), np.vstack([f_start, found.u]), margin=margin, wanted=wanted)
        return replace(found, u=u[1:], u_start=u[0])

    def drives(
        self, z: np.ndarray, f: np.ndarray, closed: bool = False, margin: float = 0.0, wanted: Wanted = Wanted.LEAST
    ) -> np.ndarray:  # fmt: skip
        """(n, n_u) the drives that push with the forces `f` (n, n_axes) at the displacements `z`, in time one after the other."""
        timed = self.sample_time is not None and bool(self.model.rate_limits)
        n = len(f)
        u = self.allocation.drive.map(n)(z.T, f.T).full().T
        low, high = (np.tile(bound, (n, 1)) for bound in self._bounds(margin))
        out = np.any((u < low) | (u > high), axis=1)
        if timed:
            before = np.vstack([u[-1:] if closed else u[:1], u[:-1]])
            slowest, fastest = self._rate_bounds(margin)
            change = u - before
            out[:] = np.any(out) or np.any((change < slowest) | (change > fastest))  # one sample acts on the others
        chosen = out if np.all(np.isfinite(u)) else np.zeros(n, dtype=bool)
        if chosen.any():
            rates = self._rate_bounds(margin) if timed else None
            u[chosen] = self._solved(
                self._slopes(z[chosen]), f[chosen], u[chosen], self._bounds(margin), rates, closed, wanted
            )
        return u

    @cached_property
    def _facets(self) -> np.ndarray | None:
        """(m, n_axes) the normals of the set of forces that drives within limits give, {B u}, a zonotope: each is normal to n_axes - 1
        columns of B. None where B changes with the displacement, or drives have no limits. Source: P. McMullen, Trans. Amer. Math. Soc.
        159 (1971) 91."""
        m, (low, high) = self.model, self.model.u_bounds
        if ca.depends_on(ca.jacobian(m.balance, m.u), m.z) or not np.all(np.isfinite(high - low)):
            return None
        B, n = self._slopes(np.zeros((1, len(m.axes))))[0] * (high - low) / m.force_scale, len(m.axes)
        found = []
        for columns in combinations(range(B.shape[1]), n - 1):
            _, sizes, rows = np.linalg.svd(B[:, columns].T, full_matrices=True)
            if n == 1 or sizes.min() > INDEPENDENT * np.abs(B).max():
                found.append(rows[-1])
        return np.array(found) / m.force_scale

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

    def _bounds(self, margin: float) -> tuple[np.ndarray, np.ndarray]:
        return _narrowed(self.model.u_bounds, margin)

    def _rate_bounds(self, margin: float) -> tuple[np.ndarray, np.ndarray]:
        """Of the change from one sample to the next."""
        low, high = _narrowed(self.model.rate_bounds, margin)
        return low * (self.sample_time or 0.0), high * (self.sample_time or 0.0)

    def _solved(
        self, B: np.ndarray, f: np.ndarray, begin: np.ndarray, bounds: tuple[np.ndarray, np.ndarray],
        rates: tuple[np.ndarray, np.ndarray] | None, closed: bool, asked: Wanted,
    ) -> np.ndarray:  # fmt: skip
        """The programme of the module's text, begun at the closed form; where no drives keep the limits, or not those of least
        effort are `asked` for, those that break them least, or where the answer is no, perhaps the closed form."""
        m, n, n_u = self.model, len(f), self.model.u.numel()
        if rates is not None and asked is not Wanted.LEAST and n >= 2 * COARSE:
            few = self._interpolated(B, f, begin, bounds, rates, closed)
            if few is not None or asked is Wanted.EVIDENT:
                return begin if few is None else few
        span = 1 / np.sqrt(effort_weights(m) / m.drive_weights)
        shares = B * span
        size = np.linalg.norm(shares, axis=2)  # what full drives push
        pushed = _diagonal(shares / size[:, :, None])
        limited = _limited_rows(bounds, rates, span, np.ones(n if closed else n - 1), n)
        wanted = (f / size).ravel()
        least, excess = _least_excess(pushed, wanted, limited)
        if excess > NEGLIGIBLE or asked is not Wanted.LEAST:
            return least.reshape(n, n_u) * span
        weights = np.tile(m.drive_weights / m.drive_weights.max(), n)
        u = _least_squares(weights, pushed, wanted, limited, (begin / span).ravel()).reshape(n, n_u) * span
        return _polished(u, shares, f, (bounds[0] / span, bounds[1] / span), span)

    def _interpolated(
        self, B: np.ndarray, f: np.ndarray, begin: np.ndarray, bounds: tuple[np.ndarray, np.ndarray],
        rates: tuple[np.ndarray, np.ndarray], closed: bool,
    ) -> np.ndarray | None:  # fmt: skip
        """Drives that keep the limits, from those of `COARSE` samples; those `begin` of the closed form, which break them, where these
        samples show that none keep them; None where neither is shown."""
        n = len(f)
        k = np.unique(np.linspace(0, n - 1, COARSE).round().astype(int))
        gaps = np.append(np.diff(k), n - k[-1]) if closed else np.diff(k)
        span = 1 / np.sqrt(effort_weights(self.model) / self.model.drive_weights)
        shares = B[k] * span
        size = np.linalg.norm(shares, axis=2)
        pushed = _diagonal(shares / size[:, :, None])
        limited = _limited_rows(bounds, rates, span, gaps, len(k))
        least, excess = _least_worst(pushed, (f[k] / size).ravel(), limited)
        if excess > NEGLIGIBLE:
            return begin
        coarse, at = least.reshape(len(k), -1) * span, np.arange(n)
        if closed:
            k, coarse = np.append(k, n), np.vstack([coarse, coarse[:1]])
        u = np.column_stack([np.interp(at, k, own) for own in coarse.T])
        yields = np.where(np.isfinite(rates[1] - rates[0]), FOLLOWS, 1.0) * span  # most where no rate is limited
        missing = np.linalg.solve((B * yields**2) @ B.swapaxes(1, 2), f[:, :, None] - B @ u[:, :, None])
        u += (yields[:, None] ** 2 * (B.swapaxes(1, 2) @ missing))[:, :, 0]
        change = np.diff(u, axis=0, prepend=u[-1:] if closed else u[:1])
        kept = np.all((u >= bounds[0]) & (u <= bounds[1]) & (change >= rates[0]) & (change <= rates[1]))
        return u if kept else None


@dataclass(frozen=True)
class _Rows:
    """low <= A s <= high, rows without a bound left out, in shares of ranges."""

    A: sp.csr_array
    low: np.ndarray
    high: np.ndarray

    def __post_init__(self) -> None:
        kept = np.flatnonzero(np.isfinite(self.low) | np.isfinite(self.high))
        for name in ("A", "low", "high"):
            object.__setattr__(self, name, getattr(self, name)[kept])

    def joined(self, other: _Rows) -> _Rows:
        """Both."""
        A = sp.vstack([self.A, other.A], format="csr")
        return _Rows(A, np.append(self.low, other.low), np.append(self.high, other.high))


def _diagonal(blocks: np.ndarray) -> sp.csr_array:
    """The block diagonal matrix of `blocks` (n, rows, columns)."""
    n = len(blocks)
    return sp.bsr_array((blocks, np.arange(n), np.arange(n + 1))).tocsr()


def _limited_rows(
    bounds: tuple[np.ndarray, np.ndarray], rates: tuple[np.ndarray, np.ndarray] | None, span: np.ndarray, gaps: np.ndarray, n: int
) -> _Rows:  # fmt: skip
    """The limits of the drives of `n` samples, and of their changes, `gaps` times the `rates`, from each to the next, of a closed path also
    from the last to the first."""
    limited = _Rows(sp.eye(n * len(span), format="csr"), *(np.tile(bound / span, n) for bound in bounds))
    if rates is None:
        return limited
    allowed = np.where(np.isfinite(rates[1] - rates[0]), rates[1] - rates[0], span)
    step = (sp.eye(n, k=1) - sp.eye(n) + sp.eye(n, k=1 - n)).tocsr()[: len(gaps)]
    change = sp.kron(sp.diags_array(1 / gaps) @ step, sp.diags_array(span / allowed), format="csr")
    return limited.joined(_Rows(change, *(np.tile(bound / allowed, len(gaps)) for bound in rates)))


def _least_worst(pushed: sp.csr_array, wanted: np.ndarray, limited: _Rows) -> tuple[np.ndarray, float]:
    """Drives that push as `wanted` and stay inside of limits, or break them, by the same most or least share, and that share, negative
    inside; by a linear programme. Raises SolverError."""
    one = sp.csr_array(np.ones((len(limited.low), 1)))
    return _programme(pushed, wanted, limited, one, -1.0)


def _least_excess(pushed: sp.csr_array, wanted: np.ndarray, limited: _Rows) -> tuple[np.ndarray, float]:
    """Drives that push as `wanted` and break limits by the least sum, and that sum; by a linear programme. Raises SolverError."""
    return _programme(pushed, wanted, limited, sp.eye(limited.A.shape[0], format="csr"), 0.0)


def _programme(
    pushed: sp.csr_array, wanted: np.ndarray, limited: _Rows, beyond: sp.csr_array, least: float
) -> tuple[np.ndarray, float]:
    """Minimises the sum of excesses e >= `least`, low - `beyond` e <= A s <= high + `beyond` e; s and the largest e. Raises SolverError."""
    n, m = limited.A.shape[1], beyond.shape[1]
    above, below = np.isfinite(limited.high), np.isfinite(limited.low)
    A = sp.vstack(
        [sp.hstack([limited.A, -beyond], format="csr")[above], sp.hstack([-limited.A, -beyond], format="csr")[below]]
    )
    answer = linprog(
        np.append(np.zeros(n), np.ones(m)), A_ub=A, b_ub=np.append(limited.high[above], -limited.low[below]), b_eq=wanted,
        A_eq=sp.hstack([pushed, sp.csr_array((len(wanted), m))]), method="highs", options={"primal_feasibility_tolerance": TOLERANCE},
        bounds=np.column_stack([np.append(np.full(n, -np.inf), np.full(m, least)), np.full(n + m, np.inf)]),
    )  # fmt: skip
    if answer.x is None:
        raise SolverError(f"no drives push as the path needs ({answer.message}); command a smaller or slower path")
    return answer.x[:n], float(answer.x[n:].max(initial=least))


def _least_squares(
    weights: np.ndarray, pushed: sp.csr_array, wanted: np.ndarray, limited: _Rows, begin: np.ndarray
) -> np.ndarray:
    """The drives of least effort among those that push as `wanted` within limits, by IPOPT. Raises SolverError where it finds none."""
    A = sp.vstack([pushed, limited.A], format="csc")
    s = ca.MX.sym("s", A.shape[1])
    problem = {"x": s, "f": ca.dot(weights, s**2), "g": ca.mtimes(ca.DM(A), s)}
    options = {
        "print_time": False,
        "ipopt": {
            "print_level": 0, "sb": "yes", "tol": TOLERANCE, "max_iter": MOST_ITERATIONS, "nlp_scaling_method": "none",
            "mu_strategy": "adaptive", "bound_relax_factor": 0.0, "jac_c_constant": "yes", "jac_d_constant": "yes",
            "hessian_constant": "yes",
        },
    }  # fmt: skip
    solver = ca.nlpsol("least_effort", "ipopt", problem, options)
    answer = solver(x0=begin, lbg=np.append(wanted, limited.low), ubg=np.append(wanted, limited.high))
    status = solver.stats()["return_status"]
    if status in ("User_Requested_Stop", "NonIpopt_Exception_Thrown"):
        raise KeyboardInterrupt
    if not solver.stats()["success"]:
        raise SolverError(f"IPOPT found no drives of least effort ({status}); command a smaller or slower path")
    return answer["x"].full().ravel()


def _polished(
    u: np.ndarray, shares: np.ndarray, f: np.ndarray, bounds: tuple[np.ndarray, np.ndarray], span: np.ndarray
) -> np.ndarray:
    """`u` with what IPOPT's tolerance leaves of the forces `f` taken up by the drives that are not at a limit."""
    s = u / span
    for k, own in enumerate(shares):
        free = own * ~np.any(np.abs(s[k] - np.array(bounds)) < NEAR, axis=0)
        s[k] += np.linalg.lstsq(free, f[k] - own @ s[k], rcond=INDEPENDENT)[0]
    return s * span


def _narrowed(bounds: tuple[np.ndarray, np.ndarray], margin: float) -> tuple[np.ndarray, np.ndarray]:
    """Bounds moved inward by a share of the range, or of the bound where there is one."""
    low, high = bounds
    both = np.isfinite(high - low)
    size = np.where(both, high - low, np.where(np.isfinite(low), abs(low), abs(high)))
    by = margin * np.where(np.isfinite(size), size, 0.0)
    return low + by, high - by


def path_inverse(model: Model, follow: str, sample_time: float | None) -> PathInverse | LeastEffortInverse:
    """The inverse of a model without inertia along paths. Raises InputError where the drives do not push the axes independently."""
    if not model.redundant:
        return PathInverse(model, follow, sample_time)
    allocation = allocate(model)
    return LeastEffortInverse(model, PathInverse(allocation.ganged, follow, sample_time), allocation)


def motion_inverse(model: Model, follow: str, sample_time: float) -> InertialInverse | LeastEffortInverse:
    """The same of a model with inertia."""
    if not model.redundant:
        return InertialInverse(model, follow, sample_time)
    allocation = allocate(model)
    return LeastEffortInverse(model, InertialInverse(allocation.ganged, follow, sample_time), allocation)
