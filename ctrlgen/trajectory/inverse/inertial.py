"""What a device with inertia would have to do to follow a motion exactly, were there no limits.

In continuous time the target with its derivatives gives states and drive sample by sample (`ctrlgen.model.inverse_dynamics`). Where
they do not give all states (memories of effects, dry friction), or where an effect has no inverse in closed form, all samples are
solved for at once (`ctrlgen.trajectory.inverse.sampled`), begun at the device without these effects.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import casadi as ca
import numpy as np

from ctrlgen.core.errors import SolverError
from ctrlgen.effects import Effect
from ctrlgen.model.allocation import ganged_as
from ctrlgen.model.assembly import build_model
from ctrlgen.model.inverse_dynamics import InverseDynamics, inverse_dynamics
from ctrlgen.model.model import Model
from ctrlgen.numerics.newton import newton_solver
from ctrlgen.trajectory.inverse.clock import Sampled
from ctrlgen.trajectory.inverse.motion import Motion
from ctrlgen.trajectory.inverse.path_inverse import PERIODS, InverseTrajectory, PathInverse
from ctrlgen.trajectory.inverse.sampled import SampledInverse

MOST_EQUILIBRIUM_STEPS = 50  # of Newton's method, from the device without effects
LAPS = 3  # of a closed path, after which memories are near enough to where they repeat to begin there


class InertialInverse(PathInverse):
    """The inverse of a model with inertia. `approximate`: in continuous time only, with internal states at rest, for searches."""

    clock: Sampled

    def __init__(self, model: Model, follow: str, clock: Sampled, approximate: bool = False) -> None:
        super().__init__(model, follow, clock)
        self.approximate = approximate
        self.dynamics: InverseDynamics = inverse_dynamics(model, follow)

    @property
    def remembers(self) -> bool:
        """Whether states are not determined by the target, so that what a sample needs depends on others."""
        return bool(self.dynamics.internal)

    @cached_property
    def without_memories(self) -> InertialInverse:
        """The same of the device without the effects that have memories, approximate."""
        return self._without(lambda effect: bool(effect.states), approximate=True) if self.remembers else self

    @cached_property
    def _sampled(self) -> SampledInverse:
        return SampledInverse(self.model, self.follow, self.clock.sample_time)

    def trajectory(self, motion: Motion, periods: int = PERIODS) -> InverseTrajectory:
        """In continuous time where that gives all states, else under held drives; `periods` is not read: a closed path repeats."""
        x, z, u = self._continuous(motion)
        if self._exact(u):
            return InverseTrajectory(x, z, u, self._at_start(motion, u), self.clock, motion.closed, True)
        try:
            return self.held(motion)
        except SolverError:
            return InverseTrajectory(x, z, u * np.nan, u[0], self.clock, motion.closed)

    def _at_start(self, motion: Motion, u: np.ndarray) -> np.ndarray:
        """(n_u,) the drive before the motion: that at rest where it starts, if that is asked for."""
        return u[0] if motion.closed or not self.model.rate_limits else self.at_rest(motion.position[0])[2]

    def held(self, motion: Motion) -> InverseTrajectory:
        """The inverse of held drives by `SampledInverse`. Raises SolverError where there are no such drives."""
        x, z, u = self._begin(motion)
        exact = self._exact(self._continuous(motion)[2])
        begin = np.hstack([x, z])
        if not exact and not motion.closed:
            begin[0] = np.concatenate(self.at_rest(motion.position[0])[:2])
            at_end = self.at_rest(motion.position[-1])[2]
            u[-1] = np.where(np.isfinite(at_end), at_end, u[-1])
        if self._memories:
            begin = self._sampled.remembered(begin, u, self._memories, LAPS if motion.closed else 1)
        settles = not self._memories  # else what holds the end still changes
        near = (u + u[motion.following]) / 2
        answer = self._sampled.solve(motion.position, begin, near, motion.closed, settles)
        return InverseTrajectory(
            answer.x,
            answer.z,
            answer.u,
            self._at_start(motion, answer.u),
            self.clock,
            motion.closed,
            solved=True,
            iterations=answer.iterations,
        )

    @property
    def _memories(self) -> tuple[int, ...]:
        """The internal states of effects; the others are of the mechanics, the actuators or a loop."""
        m = self.model
        return tuple(i for i in self.dynamics.internal if m.n_states <= i < m.x.numel() - m.v.numel())

    def at_rest(self, target: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The equilibrium in closed form where that is exact, else by Newton's method."""
        still = Motion(target[None], np.zeros((self.dynamics.order, 1, len(target))), False)
        x, z, u = (v[0] for v in self._begin(still))
        if self._exact(self._continuous(still)[2]):
            return x, z, u
        m, sizes = self.model, np.concatenate([self.model.x_scale, self.model.z_scale, self.model.u_scale])
        try:
            root = self._equilibrium(np.concatenate([x, z, u]) / sizes, target).full().ravel() * sizes
        except RuntimeError:  # of CasADi: no equilibrium
            root = sizes * np.nan
        x, z, u = np.split(root, np.cumsum([m.x.numel(), m.z.numel()]))
        return x, z, u

    def slope(self, target: np.ndarray) -> np.ndarray:
        """The derivative of the kernel of the inverse dynamics, at rest."""
        r = ca.SX.sym("r", len(target))
        still = ca.horzcat(r, ca.SX.zeros(len(target), self.dynamics.order))
        z = self.dynamics.kernel(still)[1]
        return ca.Function("slope", [r], [ca.jacobian(z, r)])(target).full()

    def leads_to(self, motion: Motion, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Drives and next displacements in continuous time; None where the motion alone does not give all states."""
        if not self.approximate and self.remembers:
            return None
        _, _, u = self._continuous(motion.at(chosen))
        _, z, _ = self._continuous(motion.at(motion.following[chosen]))
        return (z, u) if self._exact(u) else None

    def _continuous(self, motion: Motion) -> list[np.ndarray]:
        """x (n, n_x), z (n, n_axes), u (n, n_u) in continuous time, internal states at rest."""
        samples = np.hstack(list(motion.stacked()))
        return [v.full().T for v in self.dynamics.kernel.map(len(motion))(samples)]

    def _exact(self, u: np.ndarray) -> bool:
        """Whether the drives in continuous time are all that the motion takes, or all that is asked for."""
        return (self.approximate or not self.remembers) and bool(np.all(np.isfinite(u)))

    def _begin(self, motion: Motion) -> list[np.ndarray]:
        """The same; where an effect has no inverse in closed form, of the device without effects, their states at rest."""
        exact = self._continuous(motion)
        if all(np.all(np.isfinite(v)) for v in exact) or not self.model.device.effect:
            return exact
        m, plain = self.model, self._without(lambda effect: True)
        x, z, u = plain._continuous(motion)
        n_states, n_v = m.n_states, m.v.numel()
        memories = np.tile(m.rest[n_states : m.x.numel() - n_v], (len(motion), 1))
        return [np.hstack([x[:, :n_states], memories, x[:, n_states:]]), z, u]

    def _without(self, left_out: Callable[[Effect], bool], approximate: bool = False) -> InertialInverse:
        device = self.model.device
        kept = tuple(e for e in device.effect if not left_out(e))
        plain = build_model(device.model_copy(update={"effect": kept}), sample_time=self.clock.sample_time)
        model = ganged_as(plain, self.model).limited_as(self.model)
        return InertialInverse(model, self.follow, self.clock, approximate)

    @cached_property
    def _equilibrium(self) -> ca.Function:
        """((x, z, u) scaled, target) -> (x, z, u) scaled, by Newton's method on the model's own equations at rest."""
        m, signal = self.model, self.model.signals[self.follow]
        w, target = ca.SX.sym("w", m.x.numel() + m.z.numel() + m.u.numel()), ca.SX.sym("target", signal.expr.numel())
        rows = ca.vertcat(
            m.starting / m.x_scale, m.balance / m.force_scale, (signal.expr - target) / np.array(signal.scale)
        )
        sizes = np.concatenate([m.x_scale, m.z_scale, m.u_scale])
        rows = ca.substitute(rows, ca.vertcat(m.x, m.z, m.u, m.p), ca.vertcat(w * sizes, ca.DM(m.p_nominal)))
        return newton_solver("equilibrium", rows, w, target, step_below=1e-12, most_steps=MOST_EQUILIBRIUM_STEPS)
