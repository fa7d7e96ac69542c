"""A controller of a device with inertia that says when the device may ring about the motion that it is to follow.

Its belief is the motion: `ringing` bounds how far the device is off it (`ctrlgen.controller.ringing`). While it is above `TOLD` the status
has the bit UNSURE. In the C it is codegen/limiter/ringing.c.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ctrlgen.controller.clocked import Clocked, later
from ctrlgen.controller.controller_step import ControllerStatus, ControllerStep, State, answer
from ctrlgen.controller.lost_state import UNLIMITED
from ctrlgen.controller.motion_feedforward import MotionController
from ctrlgen.controller.ringing import TOLD, Ringing
from ctrlgen.model.discretisation import SETTLING_SWEEPS


@dataclass(frozen=True)
class MotionBelief:
    """The motion's `state`, as of `Controller.step`; where it leads, `ahead` (n_y,), weighted; how far the device is off it at most."""

    state: State
    ahead: np.ndarray
    ringing: float = 0.0
    tick: int | None = None


@dataclass(frozen=True)
class MotionEstimator(Clocked[MotionBelief]):
    """The `controller` of a device with inertia whose kernels have a `ringing`."""

    controller: MotionController

    @cached_property
    def bounds(self) -> Ringing:
        """How fast the device stops ringing."""
        bounds = self.controller.kernels.ringing
        assert bounds is not None
        return bounds

    def rest(self) -> MotionBelief:
        """A device that is known to be at rest."""
        state = self.controller.rest()
        return MotionBelief(state, self._still(state))

    def forget(self, estimate: MotionBelief) -> MotionBelief:
        """A device of which nothing is known but that its drives were within their limits."""
        rest = self.rest()
        return replace(
            rest, state=(*rest.state[:2], *estimate.state[2:]), ringing=self.bounds.unknown, tick=estimate.tick
        )

    def _still(self, state: State) -> np.ndarray:
        """Where a device that stays in its state is led, weighted."""
        weights, own = self.bounds.weights, np.concatenate(state[:2])
        return np.concatenate([weights[: len(own)] * own, np.zeros(len(weights) - len(own))])

    @cached_property
    def _home(self) -> np.ndarray:
        return self._still(self.controller.rest())

    def _bounded(self, size: float, ahead: np.ndarray) -> float:
        return self.bounds.bounded(size, ahead - self._home)

    def _counted(self, size: float) -> float:
        return 0.0 if size <= self.bounds.least else size

    def step(
        self, estimate: MotionBelief, target: np.ndarray, *, settle: bool = False
    ) -> tuple[ControllerStep, MotionBelief]:
        """`Controller.step`, with the bit UNSURE while the device may ring."""
        wanted = None if settle else self.controller.wanted(estimate.state, target)
        step = self.controller.step(estimate.state, target, settle=settle)
        if ControllerStatus.LOST in step.status:
            return step, replace(estimate, state=step.state)
        behind = ahead = self._still(step.state)
        size = 0.0
        if wanted is not None:
            behind, ahead = np.split(answer(self.controller.kernels.joins, target), 2)
            size = float(self.bounds.drive @ np.abs(step.drive - wanted))
        size += float(np.sum(np.abs(behind - estimate.ahead)))
        left = self._bounded(self.bounds.decay * estimate.ringing + self._counted(size), ahead)
        after = replace(estimate, state=step.state, ahead=ahead, ringing=left, tick=later(estimate.tick, 1))
        told = self._told(after, float(self.bounds.held @ np.abs(ahead - behind)))
        return replace(step, status=step.status | told), after

    def elapsed(self, estimate: MotionBelief, ticks: int, drive: np.ndarray) -> tuple[ControllerStatus, MotionBelief]:
        """`ticks` samples passed under this `drive` (n_u,) without a call: it rings about the equilibrium. INPUT, and nothing else, for a
        drive out of its range."""
        m, (x, z, *last) = self.controller.kernels.nominal, estimate.state
        if self.controller.is_lost(*estimate.state):
            return ControllerStatus.LOST, estimate
        if not np.all((drive >= m.u_bounds[0]) & (drive <= m.u_bounds[1])):
            return ControllerStatus.INPUT, estimate
        after = replace(estimate, state=(x, z, *(drive for _ in last)), tick=later(estimate.tick, ticks))
        if ticks:
            static = self.controller.kernels.static
            for _ in range(SETTLING_SWEEPS):
                x = answer(static.advance, x, z, drive)
                z = answer(static.settle, x, z, drive)
            state = (x, z, *after.state[2:])
            if self.controller.is_lost(*state):
                after = self.forget(after)
            else:
                ahead = self._still(state)
                off = estimate.ringing + self._counted(float(np.sum(np.abs(ahead - estimate.ahead))))
                left = self._bounded(self._bounded(off, ahead) * self.bounds.decay**ticks, ahead)
                after = replace(after, state=state, ahead=ahead, ringing=left)
        return self._told(after), after

    def observe(
        self, estimate: MotionBelief, x: np.ndarray, z: np.ndarray, x_error: np.ndarray, z_error: np.ndarray
    ) -> tuple[ControllerStatus, MotionBelief]:
        """States x (n_x,) and displacements z (n_axes,) were measured, each to within an error >= 0, SI.

        INPUT, and nothing else, for what is no number or absurdly large. What is known better stays, unless that contradicts it."""
        if self.controller.is_lost(*estimate.state):
            return ControllerStatus.LOST, estimate
        measured, error = np.concatenate([x, z]), np.concatenate([x_error, z_error])
        if self.controller.is_lost(*(x, z, *estimate.state[2:])) or not np.all((error >= 0) & (error <= UNLIMITED)):
            return ControllerStatus.INPUT, estimate
        weights = self.bounds.weights
        away, unsure = np.abs(weights * measured - estimate.ahead), weights * error
        seen = float(np.sum(away + unsure))
        apart = bool(np.any(away > unsure + self.bounds.reach * (estimate.ringing + 1)))
        after = replace(estimate, ringing=seen) if apart or seen < estimate.ringing else estimate
        return self._told(after), after

    def _told(self, estimate: MotionBelief, held: float = 0.0) -> ControllerStatus:
        return ControllerStatus(0) if estimate.ringing + held <= TOLD else ControllerStatus.UNSURE
