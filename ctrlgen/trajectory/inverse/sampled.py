"""The drive that leads a device with inertia along a path when it is held from sample to sample.

The drive of the continuous inverse, held, comes late by half a sample. Here drives and states of all samples are solved for at once,

    y_k+1 = step(y_k, u_k),     minimise  1/2 sum_k |h(y_k) - r_k|^2 + 1/2 w^2 sum_k |u_k - u_c(t_k + T/2)|^2,

step being the shipped integrator's, r the path, u_c the continuous inverse; in typical sizes. A sampled system of relative degree
two or more has zeros near or outside the unit circle (K. J. Astrom, P. Hagander, J. Sternby, Automatica 20 (1984) 31), so that
inverting it sample by sample would make the drive alternate or grow. Solving for all samples is the non-causal, stable inverse
(S. Devasia, D. Chen, B. Paden, IEEE Trans. Autom. Control 41 (1996) 930), and w keeps out what the motion cannot show: a drive
that alternates from sample to sample. A closed path is periodic; an open one starts in equilibrium, and is left with the drive that
holds its end where that does not depend on the motion before. Newton's method with the exact derivatives of the step (Gauss-Newton:
the residual is nearly zero at the solution).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from ctrlgen.core.errors import SolverError
from ctrlgen.model.discretisation import one_step_map
from ctrlgen.model.model import Model

DRIVE_WEIGHT = 1e-6  # w: below a millionth of what the full drive moves, a drive is left as it is
MOST_STEPS = 30  # of Newton's method; smooth forces take three to six
CONVERGED = 1e-13  # typical sizes of a step: rounding
STALLED = 1e-7  # typical sizes: a step that grows again below it is rounding
HELD_AFTER = 16  # samples at rest after an open path, and no less than a quarter of it, count like its own: vibration there is an error
HALVINGS = 10  # of a step that does not come nearer


@dataclass(frozen=True)
class SampledTrajectory:
    """States x (n, n_x), displacements z (n, n_axes), drives u (n, n_u) [SI]: u_k is held from sample k to k + 1; `iterations` of
    Newton's method."""

    x: np.ndarray
    z: np.ndarray
    u: np.ndarray
    iterations: int


class SampledInverse:
    """The inverse of a model under drives held for `sample_time` [s], along its signal `follow`."""

    def __init__(self, model: Model, follow: str, sample_time: float) -> None:
        self.model, self.sample_time = model, sample_time
        signal = model.signals[follow]
        self.output, self.output_scale = signal.expr, np.array(signal.scale)
        self.y_scale, self.u_scale = np.concatenate([model.x_scale, model.z_scale]), model.u_scale

    @cached_property
    def _functions(self) -> tuple[ca.Function, ca.Function]:
        """(y, u) -> (y one sample on, its slopes by y and u) and y -> (h, its slope), in typical sizes."""
        m = self.model
        after = one_step_map(m, self.sample_time)
        y, u = ca.SX.sym("y", len(self.y_scale)), ca.SX.sym("u", len(self.u_scale))
        at = ca.vertcat(m.x, m.z, m.u, m.p), ca.vertcat(y * self.y_scale, u * self.u_scale, ca.DM(m.p_nominal))
        step = ca.substitute(ca.vertcat(after.x, after.z), *at) / self.y_scale
        h = ca.substitute(self.output, *at) / self.output_scale
        named = {"cse": True}
        return (
            ca.Function("step", [y, u], [step, ca.jacobian(step, y), ca.jacobian(step, u)], named),
            ca.Function("output", [y], [h, ca.jacobian(h, y)], named),
        )

    def remembered(self, begin: np.ndarray, drives: np.ndarray, internal: tuple[int, ...], laps: int) -> np.ndarray:
        """`begin` (n, n_x + n_axes) [SI] with the `internal` states where the motion in the other columns and the `drives` (n, n_u) take
        them from the first sample on, in the last of some `laps`."""
        places, others = list(internal), [i for i in range(begin.shape[1]) if i not in internal]
        memory, motion, u = (
            ca.SX.sym(name, size) for name, size in (("m", len(places)), ("o", len(others)), ("u", len(self.u_scale)))
        )
        y = ca.SX(begin.shape[1], 1)
        y[places], y[others] = memory, motion
        after = self._functions[0](y, u)[0][places]
        along = ca.Function("along", [memory, ca.vertcat(motion, u)], [after, memory]).mapaccum(len(begin))
        scaled, now = begin / self.y_scale, (begin / self.y_scale)[0, places]
        for _ in range(laps):
            then, before = along(now, np.hstack([scaled[:, others], drives / self.u_scale]).T)
            now = then[:, -1]
        scaled[:, places] = before.full().T
        return scaled * self.y_scale

    def solve(
        self, path: np.ndarray, begin: np.ndarray, drives: np.ndarray, closed: bool, end_given: bool
    ) -> SampledTrajectory:
        """The drives that lead along `path` (n, channels) [SI], begun at the states and displacements `begin` (n, n_x + n_axes), near
        the `drives` (n, n_u). An open path starts at begin[0]; where `end_given`, its last drive stays what it is, that which holds the
        end, and the device is to stay there. Raises SolverError where Newton's method does not converge, as with forces that jump."""
        y, u, target = begin / self.y_scale, drives / self.u_scale, path / self.output_scale
        n = len(u)
        held = max(HELD_AFTER, n // 4) if end_given and not closed else 0
        after = 0 if closed else 1 + held  # samples that the last drive leads to
        y, target = np.vstack([y, *[y[-1:]] * after]), np.vstack([target, *[target[-1:]] * after])
        u = np.vstack([u, *[u[-1:]] * held])
        given = _given(y, u, closed, 1 + held if end_given else 0)
        problem = _Problem(*self._functions, target, u, closed)
        previous = np.inf
        for iteration in range(1, MOST_STEPS + 1):
            system = _Linearised(problem, y, u)
            dy, du = system.step(given)
            size = max(np.abs(dy).max(), np.abs(du).max())
            if not np.isfinite(size):
                break
            share = 1.0
            while size > STALLED and share > 2.0**-HALVINGS:
                if _Linearised(problem, y + share * dy, u + share * du).merit < system.merit:
                    break
                share /= 2
            y, u = y + share * dy, u + share * du
            if size < CONVERGED or (size < STALLED and size > previous / 2):
                x, z = np.split(y[:n] * self.y_scale, [self.model.x.numel()], axis=1)
                return SampledTrajectory(x, z, u[:n] * self.u_scale, iteration)
            previous = size
        raise SolverError(
            f"no drive held from sample to sample was found: Newton's method still changes it by {previous:.1g} of its size after "
            f"{MOST_STEPS} steps{_blamed(self.model)}; raise sample_rate, make the path slower, or leave out effects whose force jumps"
        )


@dataclass(frozen=True)
class _Problem:
    """What is solved, scaled: the functions of one sample, the `target` (n or n + 1, channels), the drives (n, n_u) to stay `near`."""

    step: ca.Function
    output: ca.Function
    target: np.ndarray
    near: np.ndarray
    closed: bool


class _Linearised:
    """The problem at one trajectory y (n or n + 1, n_y), u (n, n_u): its residuals and slopes."""

    def __init__(self, problem: _Problem, y: np.ndarray, u: np.ndarray) -> None:
        step, output, closed = problem.step, problem.output, problem.closed
        n, self.n_y, self.n_u = len(u), y.shape[1], u.shape[1]
        after, A, B = step.map(n)(y[:n].T, u.T)
        h, C = output.map(len(y))(y.T)
        following = np.roll(y, -1, axis=0) if closed else y[1:]
        self.defect = after.full().T - following
        self.error, self.off = h.full().T - problem.target, DRIVE_WEIGHT * (u - problem.near)
        A, B, C = (_blocks(step, 1, A, n), _blocks(step, 2, B, n), _blocks(output, 1, C, len(y)))
        shift = sp.eye(n, len(y), k=1, format="lil")
        if closed:
            shift[-1, 0] = 1.0
        ends = sp.hstack([A, sp.csc_array((n * self.n_y, (len(y) - n) * self.n_y))])
        self.dynamics = sp.hstack([ends - sp.kron(shift, sp.eye(self.n_y)), B], format="csc")
        self.outputs, self.size_y = C, y.size

    @property
    def merit(self) -> float:
        """Half the sum of squares of all residuals."""
        total = 0.5 * sum(float(np.sum(r**2)) for r in (self.defect, self.error, self.off))
        return total if np.isfinite(total) else np.inf

    def step(self, given: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The Gauss-Newton step of y and u, zero where they are `given`; not finite where the equations cannot be solved."""
        J, n_u = self.dynamics, self.off.size
        H = sp.block_diag([self.outputs.T @ self.outputs, DRIVE_WEIGHT**2 * sp.eye(n_u)])
        gradient = np.concatenate([self.outputs.T @ self.error.ravel(), DRIVE_WEIGHT * self.off.ravel()])
        keep = np.flatnonzero(~given)
        H, J = sp.csc_array(H)[:, keep][keep], J[:, keep]
        K = sp.block_array([[H, J.T], [J, None]], format="csc")
        change = np.zeros(len(given))
        try:
            change[keep] = splu(K).solve(-np.concatenate([gradient[keep], self.defect.ravel()]))[: len(keep)]
        except RuntimeError:  # singular
            change[:] = np.nan
        return change[: self.size_y].reshape(-1, self.n_y), change[self.size_y :].reshape(-1, self.n_u)


def _given(y: np.ndarray, u: np.ndarray, closed: bool, drives: int) -> np.ndarray:
    """Which of the unknowns, all states and then all drives, are given: of an open path the first state and the last `drives`."""
    given = np.zeros(y.size + u.size, dtype=bool)
    if not closed:
        given[: y.shape[1]] = True
        given[given.size - drives * u.shape[1] :] = True
    return given


def _blocks(function: ca.Function, output: int, values: ca.DM, n: int) -> sp.csc_array:
    """The block diagonal matrix of the n slopes that a mapped function gave side by side."""
    pattern = function.sparsity_out(output)
    rows, columns = np.array(pattern.row(), dtype=int), np.array(pattern.get_col(), dtype=int)
    k = np.arange(n)[:, None]
    shape = (n * pattern.size1(), n * pattern.size2())
    places = (rows + k * pattern.size1()).ravel(), (columns + k * pattern.size2()).ravel()
    return sp.csc_array((np.array(values.nonzeros()), places), shape=shape)


def _blamed(model: Model) -> str:
    """The effects of the device with states of their own or dry friction, for the message."""
    kinds = sorted({e.kind for e in model.device.effect if e.states or e.set_valued})
    return f" (the device has {', '.join(kinds)})" if kinds else ""
