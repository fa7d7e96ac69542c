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
from ctrlgen.trajectory.inverse.balanced import PERIODS, InverseTrajectory
from ctrlgen.trajectory.inverse.motion import Command, Motion
from ctrlgen.trajectory.inverse.sampled import SampledInverse, SampledTrajectory

MOST_EQUILIBRIUM_STEPS = 50  # of Newton's method, from the device without effects
LAPS = 3  # of a closed path, after which memories are near enough to where they repeat to begin there


class InertialInverse:
    """The inverse of a model with inertia along motions of its signal `follow`, one sample every `sample_time` [s].

    `approximate`: in continuous time only, with internal states at rest, for searches.
    """

    def __init__(self, model: Model, follow: str, sample_time: float, approximate: bool = False) -> None:
        self.model, self.follow, self.sample_time, self.approximate = model, follow, sample_time, approximate
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
        return SampledInverse(self.model, self.follow, self.sample_time)

    def trajectory(self, command: Command, closed: bool, periods: int = PERIODS) -> InverseTrajectory:
        """What the motion `command` takes; not finite where no drive was found. `periods` is not read: a closed path repeats."""
        assert isinstance(command, Motion)  # of devices in balance only samples are followed
        x, z, u = self._continuous(command)
        if self._exact(u):
            return InverseTrajectory(x, z, u, self._at_start(command, closed, u), True)
        try:
            found = self.sampled(command, closed)
        except SolverError:
            return InverseTrajectory(x, z, u * np.nan, u[0])
        return self.needed(found, command, closed)

    def needed(self, found: SampledTrajectory, command: Motion, closed: bool) -> InverseTrajectory:
        """Sampled drives as what the motion takes."""
        return InverseTrajectory(found.x, found.z, found.u, self._at_start(command, closed, found.u), True)

    def _at_start(self, command: Motion, closed: bool, u: np.ndarray) -> np.ndarray:
        """(n_u,) the drive before the motion: that at rest where it starts, if that is asked for."""
        return u[0] if closed or not self.model.rate_limits else self.at_rest(command.position[0])[2]

    def sampled(self, command: Motion, closed: bool) -> SampledTrajectory:
        """The drives that lead along the samples of `command` while each is held. Raises SolverError where none are found."""
        x, z, u = self._begin(command)
        exact = self._exact(self._continuous(command)[2])
        begin = np.hstack([x, z])
        if not exact and not closed:
            begin[0] = np.concatenate(self.at_rest(command.position[0])[:2])
            held = self.at_rest(command.position[-1])[2]
            u[-1] = np.where(np.isfinite(held), held, u[-1])
        if self._memories:
            begin = self._sampled.remembered(begin, u, self._memories, LAPS if closed else 1)
        following = np.roll(u, -1, axis=0) if closed else np.vstack([u[1:], u[-1:]])
        settles = not self._memories  # else what holds the end still changes
        return self._sampled.solve(command.position, begin, (u + following) / 2, closed, settles)

    @property
    def _memories(self) -> tuple[int, ...]:
        """The internal states of effects; the others are of the mechanics, the actuators or a loop."""
        m = self.model
        return tuple(i for i in self.dynamics.internal if m.n_states <= i < m.x.numel() - m.v.numel())

    def displacements(self, command: Command, closed: bool) -> np.ndarray:
        """z (n, n_axes) along a motion."""
        return self.trajectory(command, closed).z

    def at_rest(self, target: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """x (n_x,), z (n_axes,) and u (n_u,) of the equilibrium at `target` (channels,); not finite where there is none."""
        still = Motion(target[None], np.zeros((self.dynamics.order, 1, len(target))))
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
        """(n_axes, channels) d displacement / d target at rest there."""
        r = ca.SX.sym("r", len(target))
        still = ca.horzcat(r, ca.SX.zeros(len(target), self.dynamics.order))
        z = self.dynamics.kernel(still)[1]
        return ca.Function("slope", [r], [ca.jacobian(z, r)])(target).full()

    def keeps_limits(
        self,
        command: Command,
        closed: bool,
        chosen: np.ndarray | None = None,
        margin: float = 0.0,
        periods: int = PERIODS,
    ) -> bool:
        """Whether `command` can be followed with a `margin`, a share of each limit. All samples are judged, whichever are `chosen`."""
        needed = self.trajectory(command, closed, periods)
        return needed.solved and not needed.violations(self.model, self.sample_time, closed, margin)

    def forces_at(self, command: Command, closed: bool, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Where the drives at the samples `chosen` lead, z (n, n_axes), and these, u (n, n_u); None where the drives depend on more than
        their own samples."""
        assert isinstance(command, Motion)
        if not self.approximate and self.remembers:
            return None
        following = np.append(np.arange(1, len(command)), 0 if closed else len(command) - 1)
        _, _, u = self._continuous(command.at(chosen))
        _, z, _ = self._continuous(command.at(following[chosen]))
        return (z, u) if self._exact(u) else None

    def _continuous(self, command: Motion) -> list[np.ndarray]:
        """x (n, n_x), z (n, n_axes), u (n, n_u) in continuous time, internal states at rest."""
        samples = np.hstack(list(command.stacked()))
        return [v.full().T for v in self.dynamics.kernel.map(len(command))(samples)]

    def _exact(self, u: np.ndarray) -> bool:
        """Whether the drives in continuous time are all that the motion takes, or all that is asked for."""
        return (self.approximate or not self.remembers) and bool(np.all(np.isfinite(u)))

    def _begin(self, command: Motion) -> list[np.ndarray]:
        """The same; where an effect has no inverse in closed form, of the device without effects, their states at rest."""
        found = self._continuous(command)
        if all(np.all(np.isfinite(v)) for v in found) or not self.model.device.effect:
            return found
        m, plain = self.model, self._without(lambda effect: True)
        x, z, u = plain._continuous(command)
        own, n_v = m.n_states, m.v.numel()
        memories = np.tile(m.rest[own : m.x.numel() - n_v], (len(command), 1))
        return [np.hstack([x[:, :own], memories, x[:, own:]]), z, u]

    def _without(self, left_out: Callable[[Effect], bool], approximate: bool = False) -> InertialInverse:
        device = self.model.device
        kept = tuple(e for e in device.effect if not left_out(e))
        plain = build_model(device.model_copy(update={"effect": kept}), sample_time=self.sample_time)
        model = ganged_as(plain, self.model).limited_as(self.model)
        return InertialInverse(model, self.follow, self.sample_time, approximate)

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
