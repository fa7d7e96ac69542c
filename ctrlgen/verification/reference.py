"""The answers that generated C must reproduce: the controller evaluated by CasADi, over three kinds of targets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import Any, TypeVar

import casadi as ca
import numpy as np

from ctrlgen.controller.controller_step import State, answer
from ctrlgen.controller.feedforward import Controller
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.controller.timed import TimedController
from ctrlgen.firmware.online.limit_tables import FLOAT_SLACK
from ctrlgen.firmware.online.stated_pivot import FARTHEST, StatedPivot
from ctrlgen.model.simulation import trace
from ctrlgen.trajectory.solution import Solution
from ctrlgen.trajectory.unstated_modes import followed_under

T = TypeVar("T")
RANDOM_TARGETS = 1000
ARRIVED = 1e-6  # of a target: Newton's next step would leave rounding
INSIDE = 1e-3  # of a composite limit, to which reachable targets keep: at it float roundings decide the report
MOST_CALLS = 16  # of a random target that drives with rate limits come to in several calls


class ReferenceAnswers:
    """The reference answers, computed once for all builds."""

    def __init__(self, solution: Solution) -> None:
        self.solution, self.model, self.scenario = solution, solution.model, solution.scenario
        self._found: dict[tuple[str, bytes], Any] = {}
        self.controller = controller_of(
            self.model,
            self.scenario.file.follow,
            self.scenario.sample_time,
            self.scenario.file.leads_modes,
            self.scenario.sample_times,
        )
        self.random, at_limits = self._random_targets(INSIDE), self._random_targets(0.0)
        if self.controller.rate is not None:  # fewer, each until the drives have come there, or nearly
            calls = min(self.controller.rate.samples(*self.model.u_bounds), MOST_CALLS)
            self.random, at_limits = (r[::MOST_CALLS].repeat(calls, axis=0) for r in (self.random, at_limits))
        self.settled = self._answers(self.random, None)
        self.command, self.path = solution.command, solution.command
        if self.scenario.sample_time is None:
            self.followed = self._answers(self.command, None)
            return
        # From IPOPT's first sample on: each target is the next sample; a closed path ends where it began, an open one is held.
        self.start = (solution.trace.x[0], solution.trace.z[0], *self._last_drive(solution))
        last = solution.command[:1] if self.scenario.closed else solution.command[-1:]
        self.path = np.vstack([solution.command, last])
        self.command = self.scenario.bind(self.model).targets if self.model.inertial else self.path[1:]
        self.followed = self._answers(self.command, self.start)
        self.hostile = self._hostile_targets(at_limits)
        self.chased = self._answers(self.hostile, self.controller.rest())

    @cached_property
    def timed(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Calls at times that vary (n, 2 + channels), since, ahead, target, from a device at rest: the hostile targets and the path between
        them, some sooner or later than they were said to be, some beyond the bounds; and their answers. None where no time varies."""
        if self.controller.kernels.times is None:
            return None
        rng, mine = np.random.default_rng(23), TimedController(self.controller)
        low, high = mine.times
        usual = np.array([low, 0.75 * low + 0.25 * high, self.sample_time, high])  # few: each has kernels of its own
        targets = np.empty((2 * min(len(self.hostile), len(self.command)), self.command.shape[1]))
        targets[::2], targets[1::2] = self.hostile[: len(targets) // 2], self.command[: len(targets) // 2]
        ahead = rng.choice(usual, len(targets))
        since = np.where(rng.random(len(targets)) < 0.7, np.roll(ahead, 1), rng.choice(usual, len(targets)))
        since[40::40], ahead[25::40] = 0.5 * low, np.nan
        belief, held, rows = mine.rest(), np.zeros(self.model.u.numel()), []
        for at, until, target in zip(since, ahead, targets, strict=True):
            step, belief = mine.step_after(belief, at, until, target, held)
            held = step.drive
            rows.append(np.concatenate([[step.status], step.drive, step.displacement, step.actuator_state]))
        return np.column_stack([since, ahead, targets]), np.array(rows)

    @cached_property
    def turned(self) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """Pivots (n, 3), the poses (n, channels) that they have, and whether each is accepted (n,): the last few are no numbers, or just
        beyond what is. None where the target of the controller has no pivot."""
        if not self.pivot.acts:
            return None
        limits = np.concatenate([np.full(3, FARTHEST), self.pivot.limits])
        poses, pivots = self.pivot.cases(RANDOM_TARGETS // 4, np.random.default_rng(22))
        beyond = np.tile(np.concatenate([pivots[0], poses[0]]), (3 * len(limits), 1))
        for k, limit in enumerate(limits):
            beyond[3 * k : 3 * k + 3, k] = np.nan, limit * (1 + 1e-6), -np.inf
        every = np.vstack([np.hstack([pivots, poses]), beyond])
        return every[:, :3], every[:, 3:], np.arange(len(every)) < len(poses)

    @cached_property
    def pivot(self) -> StatedPivot:
        """What the controller takes for the pose of a pivot."""
        return StatedPivot(self.controller.kernels)

    def once(self, what: str, given: np.ndarray, found: Callable[[np.ndarray], T]) -> T:
        """`found(given)`, computed once for the same bits: those of two compilers are mostly the same."""
        key = what, given.tobytes()
        if key not in self._found:
            self._found[key] = found(given)
        kept: T = self._found[key]
        return kept

    @property
    def columns(self) -> dict[str, slice]:
        """Of an answer (status, drive, displacement, actuator state): the columns of each signal; no state where there is none."""
        m, drives = self.model, self.model.u.numel()
        at = {"drive": slice(1, 1 + drives), "displacement": slice(1 + drives, 1 + drives + len(m.axes))}
        return at | ({"state": slice(at["displacement"].stop, 1 + self.width)} if m.n_states else {})

    @property
    def width(self) -> int:
        """Numbers of an answer behind its status."""
        return self.model.u.numel() + len(self.model.axes) + self.model.n_states

    @property
    def sample_time(self) -> float:
        """Seconds between samples. Raises ValueError for a static scenario, which has none."""
        if self.scenario.sample_time is None:
            raise ValueError(f"{self.scenario.name} is static: its samples are not in time")
        return self.scenario.sample_time

    @cached_property
    def played_path(self) -> np.ndarray:
        """(samples, channels) [SI] along which the solved drives lead: the command, or near it where they lead modes of bodies."""
        if not self.scenario.file.leads_modes:
            return self.path
        return followed_under(self.scenario, self.model, self.solution.drive, *self.start[:2])

    @cached_property
    def held_error(self) -> float:
        """What online drives may leave in the followed signal [SI] because each is held for a sample: twice what those of CasADi leave,
        with inertia; 0 without."""
        if not self.model.inertial:
            return 0.0
        drives = self.followed[:, self.columns["drive"]]
        moved = followed_under(self.scenario, self.model, drives, *self.start[:2])
        return 2 * float(np.abs(moved - self.path).max())

    @property
    def cancelling(self) -> float:
        """The largest sum [m] of the terms whose difference is the displacement of a random target."""
        kernel, rest = self.controller.kernels.static.displacement, self.model.rest
        target = ca.MX.sym("target", self.positions.shape[1])
        slope = ca.jacobian(kernel(rest, 0 * self.model.z_scale, target), target)
        size = np.abs(ca.Function("slope", [target], [slope])(0).full())
        return float(np.max(np.abs(self.positions) @ size.T))

    @cached_property
    def condition(self) -> float:
        """The largest share of itself by which displacement, actuator state or drive change along the command per share of what they
        follow from, 1 or more: so far an answer is off that a limit scales by another one."""
        share, shares = 1e-9, [1.0]
        for role, change in self.moved(share).items():
            if role in self.columns and (size := np.abs(self.followed[:, self.columns[role]]).max(initial=0.0)):
                shares.append(change / share / size)
        return float(max(shares))

    def moved(self, share: float) -> dict[str, float]:
        """[SI] by how much displacement, actuator state and drive change along the command where all that they follow from is off by
        this share (`Controller.rounding`)."""
        return self.once("moved", np.array(share), lambda share: self._moved(float(share)))

    def _moved(self, share: float) -> dict[str, float]:
        worst = dict.fromkeys(("displacement", "state", "drive"), 0.0)
        settle = self.scenario.sample_time is None
        rest = self.model.rest[self.model.n_states :]
        drive, displacement = self.columns["drive"], self.columns["displacement"]
        state = slice(displacement.stop, None)
        followed = zip(self.followed[:-1:37], self.followed[1::37], self.command[1::37], strict=False)
        for before, row, target in followed:
            now = (np.concatenate([before[state], rest]), before[displacement], before[drive])
            off = self.controller.rounding(now, target, (row[displacement], row[state]), settle, share)
            for role in worst:
                worst[role] = max(worst[role], float(np.max(getattr(off, role), initial=0.0)))
        return worst

    def _random_targets(self, inside: float) -> np.ndarray:
        """Half reachable (random displacements through the model, `inside` composite limits by this share), half anywhere around."""
        m, rng = self.model, np.random.default_rng(20)
        low, high = m.z_bounds
        z = rng.uniform(low, high, size=(RANDOM_TARGETS // 2, len(m.axes)))
        cold = np.tile(m.rest[:, None], (1, len(z)))
        ratio = self.controller.kernels.composite_ratio.map(len(z))(cold, 0 * z.T, z.T).full().ravel()
        z = z / np.maximum(ratio * (1 + inside), 1.0)[:, None]
        x, u = np.tile(m.rest, (len(z), 1)), np.zeros((len(z), m.u.numel()))
        signal = self.scenario.file.follow
        reachable = trace(m, np.zeros(len(z)), x, z, u).signals[signal]
        anywhere = rng.normal(size=(RANDOM_TARGETS // 2, reachable.shape[1])) * 50 * np.array(m.signals[signal].scale)
        positions = np.vstack([reachable, anywhere])
        still = np.zeros((len(positions), len(self.controller.kernels.target.channels) - positions.shape[1]))
        return np.hstack([positions, still])

    @cached_property
    def settled_in_float(self) -> np.ndarray:
        """`settled` with the slack that limits have in float, in which more excess is clipped without report."""
        return self._answers(self.random, None, replace(self.controller, slack=FLOAT_SLACK))

    @cached_property
    def arrived(self) -> np.ndarray:
        """(n,) whether the displacement that the inverse gives for a random target, before any limit, is one of it.

        The inverse takes a fixed number of Newton steps, which reach what the device can; a target far out of reach may have no
        displacement at all, and roundings decide where the steps are when they end.
        """
        m, k = self.model, self.controller.kernels.static
        followed = ca.Function("followed", [m.x, m.z, m.u, m.p], [m.signals[self.scenario.file.follow].expr])
        size = np.maximum(np.abs(self.positions), m.signals[self.scenario.file.follow].scale)
        found, state = [], self.controller.rest()
        for target, position in zip(self.random, self.positions, strict=True):
            x, z = state[:2]
            wanted = answer(k.displacement, x, z, target)
            held = answer(k.state, x, z, wanted)
            drive = self.controller.drive(k, state, wanted, held)
            reached = followed(np.concatenate([held, answer(k.memory, x, z, wanted)]), wanted, drive, m.p_nominal)
            found.append(np.abs(reached.full().ravel() - position))
            state = self.controller.step(state, target, settle=True).state
        return np.asarray(np.all(np.array(found) <= ARRIVED * size, axis=1))

    @property
    def positions(self) -> np.ndarray:
        """The random targets without derivatives, (n, channels)."""
        return self.random[:, : len(self.model.signals[self.scenario.file.follow].channels)]

    def _hostile_targets(self, at_limits: np.ndarray) -> np.ndarray:
        """A sequence of jumps between reachable and absurd targets, with some that are not numbers."""
        rng = np.random.default_rng(21)
        targets = rng.permutation(at_limits)[: RANDOM_TARGETS // 8].repeat(2, axis=0)
        first = self.positions.shape[1]
        targets[:, first:] = rng.normal(size=targets[:, first:].shape) * self.controller.kernels.target.scale[first:]
        targets[::7] *= 10 ** rng.uniform(0, 3, (len(targets[::7]), 1))
        targets[50], targets[51, 0], targets[52] = np.nan, np.inf, -1e300
        return targets

    def _last_drive(self, solution: Solution) -> list[np.ndarray]:
        """The drive before the first sample, where the controller remembers it: the last of a closed path, else what holds the start."""
        if self.controller.rate is None:
            return []
        if self.scenario.closed:
            return [solution.drive[-1]]
        untimed = controller_of(self.model, self.scenario.file.follow, None, self.scenario.file.leads_modes)
        start = np.zeros(len(untimed.kernels.target.channels))
        start[: solution.command.shape[1]] = solution.command[0]
        return [untimed.step(untimed.rest(), start, settle=True).drive]

    def _answers(self, targets: np.ndarray, start: State | None, controller: Controller | None = None) -> np.ndarray:
        """(n, 1 + drives + axes + states): status, drive, displacement, actuator state; steps from `start`, or settles at each target."""
        controller = controller or self.controller
        rows, state = [], start or controller.rest()
        for target in targets:
            step = controller.step(state, target, settle=start is None)
            state = step.state
            rows.append(np.concatenate([[step.status], step.drive, step.displacement, step.actuator_state]))
        return np.array(rows)
