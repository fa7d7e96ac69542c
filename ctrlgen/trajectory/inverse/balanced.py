"""What a device would have to do to follow a path exactly, were there no limits: the inverse, sample by sample.

    z_k = displacement(c_k),  x_k = state(z_k),  u_k = drive(x_k, z_k, z_k+1, x_k+1)

As many drives as followed channels leave nothing to choose: where these values keep every limit they are the trajectory, and
where they do not there is none. Effects with a memory of their own are carried along the path, a closed one until it repeats.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from ctrlgen.core.errors import Fault
from ctrlgen.model.allocation import ganged_as, why_not_ganged
from ctrlgen.model.assembly import build_model
from ctrlgen.model.inverse import Inverse, invert
from ctrlgen.model.model import Model, Signal
from ctrlgen.trajectory.inverse.violations import Before, Violation, violations

HOME_DRIVE = 1e-3  # of the full drive, at which the slopes near home are taken: a heater's power has none at zero volt
PERIODS = 20  # of a closed path, after which a memory that still changes is left to IPOPT
JUDGED = 3  # periods after which it is foreseen whether it will settle
REPEATS = 1e-9  # typical sizes by which a state may differ after a period that repeats
PROVEN = 1e-6  # typical sizes by which an exact inverse may be off the command or out of balance


@dataclass(frozen=True)
class InverseTrajectory:
    """States `x` (n, n_x), displacements `z` (n, n_axes) and drives `u` (n, n_u) [SI] that follow a command; `u_start` (n_u,) the
    drive with which an open path begins.

    `solved`: they satisfy all equations. `unsettled` [typical sizes]: by how much memories may still change the displacements
    of a closed path before it repeats; infinite where they do not settle.
    """

    x: np.ndarray
    z: np.ndarray
    u: np.ndarray
    u_start: np.ndarray
    solved: bool = False
    unsettled: float = 0.0

    @property
    def exact(self) -> bool:
        """Whether nothing else follows the command: the equations hold, and a closed path repeats."""
        return self.solved and self.unsettled == 0.0

    def before(self, closed: bool) -> np.ndarray:
        """(n, n_u) the drive before each sample of a motion: of a closed path the last one comes before the first."""
        return np.vstack([self.u[-1:] if closed else self.u_start[None], self.u[:-1]])

    def violations(self, model: Model, sample_time: float | None, closed: bool, margin: float = 0.0) -> list[Violation]:
        """The limits that it breaks, those on the rates of drives too where there is a `sample_time` [s]."""
        before = None if sample_time is None else Before(self.before(closed), sample_time)
        return violations(model, self.x, self.z, self.u, margin, before)


def count_faults(model: Model, follow: str) -> list[Fault]:
    """What keeps a model from being inverted: it takes a drive or more and one axis for each channel that is followed."""
    signal, drives, axes = model.signals[follow], model.u.numel(), len(model.axes)
    channels = len(signal.channels)
    if drives > axes and not model.redundant:
        return [Fault("device", f"{model.name} has an imposed motion and no drives; nothing leads it along a path")]
    if model.redundant and (why := why_not_ganged(model)) is not None:
        what = f"has {drives} drives for {axes} axes and {why}: which are least is not computed; let one drive act on several actuators"
        return [Fault("device", f"{model.name} {what}")]
    if drives < channels:
        ways = "; ".join(_direction(signal, way) for way in _reached(model, signal).T)
        what = f"has {drives} drives for {channels} channels of the {follow}; near home it moves only along {ways}"
        return [Fault("device", f"{model.name} {what}; follow a signal of {drives} channels, or add drives")]
    if channels != axes and (
        not model.inertial or model.redundant
    ):  # with inertia the other axes are flexible modes, which follow
        return [
            Fault(
                "follow",
                f"{model.name} has {axes} axes for {channels} channels of the {follow}; follow its displacement",
            )
        ]
    return []


def _reached(model: Model, signal: Signal) -> np.ndarray:
    """(channels, n_u) d signal / d u between equilibria near home, in the signal's typical sizes, each column of length one."""
    unknown = ca.vertcat(model.x, model.z)
    rows = ca.vertcat(model.settling, model.balance)
    at = [unknown, model.u, model.p]
    slopes = ca.Function(
        "slopes", at, [ca.jacobian(rows, unknown), ca.jacobian(rows, model.u), ca.jacobian(signal.expr, unknown)]
    )
    home = (np.concatenate([model.rest, np.zeros(len(model.axes))]), model.u_scale * HOME_DRIVE, model.p_nominal)
    K, B, C = (v.full() for v in slopes(*home))
    moved = C @ -np.linalg.lstsq(K, B, rcond=None)[0] / np.array(signal.scale)[:, None]
    return moved / np.maximum(np.linalg.norm(moved, axis=0), 1e-300)


def _direction(signal: Signal, way: np.ndarray) -> str:
    """'x + 0.5 y' in typical sizes of the channels; what is below a thousandth is left out."""
    terms = [(c, v) for c, v in zip(signal.channels, way / way[np.abs(way).argmax()], strict=True) if abs(v) > 1e-3]
    return " + ".join(c if abs(v - 1) < 1e-3 else f"{v:.3g} {c}" for c, v in terms).replace("+ -", "- ")


class PathInverse:
    """The inverse of a model along paths of its signal `follow`, one sample every `sample_time` [s] (None: equilibria)."""

    def __init__(self, model: Model, follow: str, sample_time: float | None) -> None:
        self.model, self.follow, self.sample_time = model, follow, sample_time
        self.static: Inverse = invert(model, follow, None)
        self.moving: Inverse | None = None if sample_time is None else invert(model, follow, sample_time)

    @property
    def remembers(self) -> bool:
        """Whether effects have memories, so that what a sample needs depends on those before it."""
        return self.model.x.numel() > self.model.n_states

    @cached_property
    def without_memories(self) -> PathInverse:
        """The same of the device without the effects that have memories."""
        if not self.remembers:
            return self
        device = self.model.device
        plain = device.model_copy(update={"effect": tuple(e for e in device.effect if not e.states)})
        model = ganged_as(build_model(plain), self.model).limited_as(self.model)
        return PathInverse(model, self.follow, self.sample_time)

    def trajectory(self, command: np.ndarray, closed: bool, periods: int = PERIODS) -> InverseTrajectory:
        """What `command` (n, channels) [SI] takes; not finite where the equations have no solution. A closed path is run through
        `periods` times at most."""
        if self.remembers and self.moving is not None:
            return self._carried(command, closed, periods)
        x, z, u_held = self.equilibria(command)
        if self.moving is None:
            return self._checked(command, InverseTrajectory(x, z, u_held, u_held[0]), closed)
        following = _following(len(command), closed)
        return self._checked(
            command, InverseTrajectory(x, z, self._drive(x, z, x[following], z[following]), u_held[0], True), closed
        )

    def displacements(self, command: np.ndarray, closed: bool) -> np.ndarray:
        """z (n, n_axes) along a path."""
        return self.trajectory(command, closed).z

    def at_rest(self, target: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """x (n_x,), z (n_axes,) and u (n_u,) of the equilibrium at `target` (channels,)."""
        x, z, u = self.equilibria(target[None])
        return x[0], z[0], u[0]

    def slope(self, target: np.ndarray) -> np.ndarray:
        """(n_axes, channels) d displacement / d target at rest there."""
        m, r = self.model, ca.SX.sym("target", len(target))
        z = self.static.displacement(ca.DM(m.rest), ca.DM.zeros(m.z.numel()), r)
        return ca.Function("slope", [r], [ca.jacobian(z, r)])(target).full()

    def equilibria(self, command: np.ndarray) -> list[np.ndarray]:
        """x (n, n_x), z (n, n_axes) and u (n, n_u) of the equilibria at each command (n, channels)."""
        return [v.full().T for v in self._equilibria.map(len(command))(command.T)]

    def _drive(self, x: np.ndarray, z: np.ndarray, x_then: np.ndarray, z_then: np.ndarray) -> np.ndarray:
        """The drives (n, n_u) that lead from each x, z to those one sample later."""
        assert self.moving is not None  # of motions only
        drive = self.moving.drive.map(len(x))
        return drive(x.T, z.T, z_then.T, x_then[:, : self.model.n_states].T).full().T

    def keeps_limits(
        self,
        command: np.ndarray,
        closed: bool,
        chosen: np.ndarray | None = None,
        margin: float = 0.0,
        periods: int = PERIODS,
    ) -> bool:
        """Whether `command` can be followed with a `margin`, a share of each limit; judged by the samples `chosen` and those after them,
        where these are given and nothing is remembered from sample to sample."""
        if chosen is None or self.remembers or self.moving is None or self.model.rate_limits:
            needed = self.trajectory(command, closed, periods)
            return needed.solved and not needed.violations(self.model, self.sample_time, closed, margin)
        x, z, u, _ = self._at(command, closed, chosen)
        return bool(np.all(np.isfinite(u))) and not violations(self.model, x, z, u, margin)

    def forces_at(self, command: np.ndarray, closed: bool, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Where the drives at the samples `chosen` of a motion lead, z (n, n_axes), and these, u (n, n_u); None where the drives
        depend on more than their own samples."""
        if self.remembers or self.moving is None:
            return None
        _, _, u, z_then = self._at(command, closed, chosen)
        return z_then, u

    def _at(self, command: np.ndarray, closed: bool, chosen: np.ndarray) -> tuple[np.ndarray, ...]:
        """x, z and u at the samples `chosen` of a motion without memories, and z at those after them."""
        x, z, _ = self.equilibria(command[chosen])
        x_then, z_then, _ = self.equilibria(command[_following(len(command), closed)[chosen]])
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
    def _step(self) -> ca.Function:
        """((x, z), next target) -> ((x, z) then, x, z now, u between)."""
        m, k = self.model, self.moving
        assert k is not None  # `_carried` is for motions
        now, target = (
            ca.MX.sym("now", m.x.numel() + m.z.numel()),
            ca.MX.sym("target", m.signals[self.follow].expr.numel()),
        )
        x, z = ca.vertsplit(now, [0, m.x.numel(), now.numel()])
        wanted = k.displacement(x, z, target)
        u = k.drive(x, z, wanted, k.state(x, z, wanted))
        return ca.Function("step", [now, target], [ca.vertcat(k.advance(x, z, u), wanted), now, u])

    def _carried(self, command: np.ndarray, closed: bool, periods: int) -> InverseTrajectory:
        """With the effects' memories, from rest at the first sample; of a closed path the first period that repeats, or that at
        which it is seen not to within `periods`."""
        m, n = self.model, len(command)
        x, z, u_start = self.at_rest(command[0])
        if closed:  # slow memories are soon where they stay
            x[m.n_states :] = self.at_rest(command.mean(axis=0))[0][m.n_states :]
        ahead = np.vstack([command[1:], command[:1] if closed else command[-1:]])
        along, now, scale = self._step.mapaccum(n), np.concatenate([x, z]), np.concatenate([m.x_scale, m.z_scale])
        changes: list[float] = []
        for _ in range(periods if closed else 1):
            after, before, u = (v.full().T for v in along(now, ahead.T))
            changes.append(float(np.max(np.abs(after[-1] - now) / scale)))
            now = after[-1]
            settles = changes[-1] * _shrinks(changes) ** (periods - len(changes)) <= REPEATS
            if changes[-1] <= REPEATS or (len(changes) >= JUDGED and not settles):
                break
        x, z = np.split(before, [m.x.numel()], axis=1)
        unsettled = _left(changes) if closed and changes[-1] > REPEATS else 0.0
        return self._checked(command, InverseTrajectory(x, z, u, u_start, False, unsettled), closed)

    def _checked(self, command: np.ndarray, found: InverseTrajectory, closed: bool) -> InverseTrajectory:
        """`found`, solved where it is finite and satisfies the model's own equations."""
        m, n = self.model, len(command)
        before = found.u if self.sample_time is None else found.before(closed)
        signal = m.signals[self.follow]
        p = np.tile(m.p_nominal[:, None], (1, n))
        reached, balance = (v.full().T for v in self._equations.map(n)(found.x.T, found.z.T, before.T, p))
        off = np.concatenate([(reached - command) / signal.scale, balance / m.force_scale], axis=1)
        solved = bool(np.all(np.isfinite(found.u)) and np.all(np.abs(off) < PROVEN))
        return replace(found, solved=solved)

    @cached_property
    def _equations(self) -> ca.Function:
        m = self.model
        return ca.Function("equations", [m.x, m.z, m.u, m.p], [m.signals[self.follow].expr, m.balance])


def _following(n: int, closed: bool) -> np.ndarray:
    """The sample (n,) after each: the first one after the last of a closed path, the last one again of an open one."""
    return np.append(np.arange(1, n), 0 if closed else n - 1)


def _shrinks(changes: Sequence[float]) -> float:
    """The ratio of the last two changes from period to period; 0 where there is one."""
    return changes[-1] / changes[-2] if len(changes) > 1 and changes[-2] > 0 else 0.0


def _left(changes: Sequence[float]) -> float:
    """What all further changes add up to where they go on to shrink so."""
    ratio = _shrinks(changes)
    return changes[-1] * ratio / (1 - ratio) if ratio < 1 else np.inf
