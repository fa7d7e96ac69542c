"""What a device would have to do to follow a path exactly, were there no limits: the inverse, sample by sample.

    z_k = displacement(c_k),  x_k = state(z_k),  u_k = drive(x_k, z_k, z_k+1, x_k+1)

As many drives as followed channels leave nothing to choose: where these values keep every limit they are the trajectory, and
where they do not there is none. Effects with a memory of their own are carried along the path, a closed one until it repeats.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import casadi as ca
import numpy as np

from ctrlgen.model.allocation import ganged_as
from ctrlgen.model.assembly import build_model
from ctrlgen.model.inverse import Inverse, invert
from ctrlgen.model.model import Model
from ctrlgen.numerics.accelerated_periods import repeating_state
from ctrlgen.numerics.batched_evaluation import Recursion
from ctrlgen.trajectory.inverse.clock import Clock, Sampled
from ctrlgen.trajectory.inverse.motion import Motion
from ctrlgen.trajectory.inverse.path_inverse import PERIODS, InverseTrajectory, PathInverse
from ctrlgen.trajectory.inverse.violations import violations

JUDGED = 3  # periods after which it is foreseen whether it will settle
REPEATS = 1e-9  # typical sizes by which a state may differ after a period that repeats
PROVEN = 1e-6  # typical sizes by which an exact inverse may be off the command or out of balance


class BalancedInverse(PathInverse):
    """The inverse of a model without inertia."""

    def __init__(self, model: Model, follow: str, clock: Clock) -> None:
        super().__init__(model, follow, clock)
        self.static: Inverse = invert(model, follow, None)
        self.moving: Inverse | None = invert(model, follow, clock.sample_time) if isinstance(clock, Sampled) else None

    @property
    def remembers(self) -> bool:
        """Whether effects have memories, so that what a sample needs depends on those before it."""
        return self.model.x.numel() > self.model.n_states

    @cached_property
    def without_memories(self) -> BalancedInverse:
        """The same of the device without the effects that have memories."""
        if not self.remembers:
            return self
        device = self.model.device
        plain = device.model_copy(update={"effect": tuple(e for e in device.effect if not e.states)})
        model = ganged_as(build_model(plain), self.model).limited_as(self.model)
        return BalancedInverse(model, self.follow, self.clock)

    def trajectory(self, motion: Motion, periods: int = PERIODS) -> InverseTrajectory:
        """The trajectory by equilibria; carried along the path where effects have memories."""
        if self.remembers and self.moving is not None:
            return self._carried(motion, periods)
        x, z, u_held = self.equilibria(motion.position)
        if self.moving is None:
            settled = InverseTrajectory(x, z, u_held, u_held[0], self.clock, motion.closed)
            return self._checked(motion, settled)
        then = motion.following
        u = self._drive(x, z, x[then], z[then])
        return self._checked(motion, InverseTrajectory(x, z, u, u_held[0], self.clock, motion.closed, True))

    def at_rest(self, target: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The equilibrium at `target`, by the static kernels."""
        x, z, u = self.equilibria(target[None])
        return x[0], z[0], u[0]

    def slope(self, target: np.ndarray) -> np.ndarray:
        """The derivative of the displacement's static kernel."""
        m, r = self.model, ca.SX.sym("target", len(target))
        z = self.static.displacement(ca.DM(m.rest), ca.DM.zeros(m.z.numel()), r)
        return ca.Function("slope", [r], [ca.jacobian(z, r)])(target).full()

    def equilibria(self, targets: np.ndarray) -> list[np.ndarray]:
        """x (n, n_x), z (n, n_axes) and u (n, n_u) of the equilibria at each of `targets` (n, channels)."""
        return [v.full().T for v in self._equilibria.map(len(targets))(targets.T)]

    def _drive(self, x: np.ndarray, z: np.ndarray, x_then: np.ndarray, z_then: np.ndarray) -> np.ndarray:
        """The drives (n, n_u) that lead from each x, z to those one sample later."""
        assert self.moving is not None  # of motions only
        drive = self.moving.drive.map(len(x))
        return drive(x.T, z.T, z_then.T, x_then[:, : self.model.n_states].T).full().T

    def keeps_limits(
        self, motion: Motion, chosen: np.ndarray | None = None, margin: float = 0.0, periods: int = PERIODS
    ) -> bool:
        """Whether limits are kept, by the samples `chosen` alone where nothing is remembered and no rate is limited."""
        if chosen is None or self.remembers or self.moving is None or self.model.rate_limits:
            return super().keeps_limits(motion, chosen, margin, periods)
        x, z, u, _ = self._at(motion, chosen)
        return bool(np.all(np.isfinite(u))) and not violations(self.model, x, z, u, margin)

    def equilibria_at(self, motion: Motion) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """The equilibria at the samples; None where effects have memories."""
        if self.remembers:
            return None
        x, z, u = self.equilibria(motion.position)
        return x, z, u

    def leads_to(self, motion: Motion, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Drives and next displacements of a motion in time; None where effects have memories, and for equilibria."""
        if self.remembers or self.moving is None:
            return None
        _, _, u, z_then = self._at(motion, chosen)
        return z_then, u

    def _at(self, motion: Motion, chosen: np.ndarray) -> tuple[np.ndarray, ...]:
        """x, z and u at the samples `chosen` of a motion without memories, and z at those after them."""
        x, z, _ = self.equilibria(motion.position[chosen])
        x_then, z_then, _ = self.equilibria(motion.position[motion.following[chosen]])
        return x, z, self._drive(x, z, x_then, z_then), z_then

    @cached_property
    def _equilibria(self) -> ca.Function:
        """target -> (x, z, u) at rest there."""
        m, k = self.model, self.static
        target = ca.MX.sym("target", m.signals[self.follow].expr.numel())
        rest, home = ca.DM(m.rest), ca.DM.zeros(m.z.numel())
        z = k.displacement(rest, home, target)
        state = k.state(rest, home, z)
        x = ca.vertcat(state, k.memory(rest, home, z)) if self.remembers else state
        return ca.Function("equilibria", [target], [x, z, k.drive(rest, home, z, state)])

    @cached_property
    def _step(self) -> Recursion:
        """((x, z), next target) -> ((x, z) then, (x, z) now and u between)."""
        m, k = self.model, self.moving
        assert k is not None  # `_carried` is for motions
        now, target = (
            ca.MX.sym("now", m.x.numel() + m.z.numel()),
            ca.MX.sym("target", m.signals[self.follow].expr.numel()),
        )
        x, z = ca.vertsplit(now, [0, m.x.numel(), now.numel()])
        wanted = k.displacement(x, z, target)
        u = k.drive(x, z, wanted, k.state(x, z, wanted))
        step = ca.Function("step", [now, target], [ca.vertcat(k.advance(x, z, u), wanted), ca.vertcat(now, u)])
        return Recursion(step)

    def _carried(self, motion: Motion, periods: int) -> InverseTrajectory:
        """With the effects' memories, from rest at the first sample; of a closed path the first period that repeats, by itself or as
        extrapolated from those before, or that at which it is seen not to within `periods`."""
        m, command, closed = self.model, motion.position, motion.closed
        x, z, u_start = self.at_rest(command[0])
        if closed:  # slow memories are soon where they stay
            x[m.n_states :] = self.at_rest(command.mean(axis=0))[0][m.n_states :]
        ahead = np.vstack([command[1:], command[:1] if closed else command[-1:]])
        now, scale = np.concatenate([x, z]), np.concatenate([m.x_scale, m.z_scale])
        changes: list[float] = []
        starts = [now]

        def period(start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            after, along = self._step.run(start, ahead)
            return after[-1], along

        for _ in range(periods if closed else 1):
            now, along = period(starts[-1])
            changes.append(float(np.max(np.abs(now - starts[-1]) / scale)))
            starts.append(now)
            settles = changes[-1] * _shrinks(changes) ** (periods - len(changes)) <= REPEATS
            if changes[-1] <= REPEATS or (len(changes) >= JUDGED and not settles):
                break
        if closed and changes[-1] > REPEATS:  # the first period is that in which kinks settle
            left = periods - len(changes)
            found = repeating_state(lambda start: period(start)[0], starts[1:], scale, left, REPEATS)
            if found is not None:
                _, along = period(found)
                changes = [0.0]
        x, z, u = np.split(along, np.cumsum([len(x), len(z)]), axis=1)
        unsettled = _left(changes) if closed and changes[-1] > REPEATS else 0.0
        return self._checked(motion, InverseTrajectory(x, z, u, u_start, self.clock, closed, False, unsettled))

    def _checked(self, motion: Motion, needed: InverseTrajectory) -> InverseTrajectory:
        """`needed`, solved where it is finite and satisfies the model's own equations."""
        m, n = self.model, len(motion)
        signal = m.signals[self.follow]
        p = np.tile(m.p_nominal[:, None], (1, n))
        along = self._equations.map(n)(needed.x.T, needed.z.T, needed.drive_before.T, p)
        reached, balance = (v.full().T for v in along)
        off = np.concatenate([(reached - motion.position) / signal.scale, balance / m.force_scale], axis=1)
        solved = bool(np.all(np.isfinite(needed.u)) and np.all(np.abs(off) < PROVEN))
        return replace(needed, solved=solved)

    @cached_property
    def _equations(self) -> ca.Function:
        m = self.model
        return ca.Function("equations", [m.x, m.z, m.u, m.p], [m.signals[self.follow].expr, m.balance])


def _shrinks(changes: Sequence[float]) -> float:
    """The ratio of the last two changes from period to period; 0 where there is one."""
    return changes[-1] / changes[-2] if len(changes) > 1 and changes[-2] > 0 else 0.0


def _left(changes: Sequence[float]) -> float:
    """What all further changes add up to where they go on to shrink so."""
    ratio = _shrinks(changes)
    return changes[-1] * ratio / (1 - ratio) if ratio < 1 else np.inf
