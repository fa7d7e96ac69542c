"""A controller that says when its belief of the device's states may be wrong: after a reset, a late call, while the device settles.

`Controller.step` predicts the states; here a count of samples goes with them, until the belief is known again whatever it was
(`ctrlgen.controller.contraction`). While it is above zero the status has the bit UNSURE. In the C it is codegen/limiter/estimate.c.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ctrlgen.controller.clocked import Clocked, later
from ctrlgen.controller.contraction import FOREVER, Contraction
from ctrlgen.controller.controller_step import ControllerStatus, ControllerStep, State, answer
from ctrlgen.controller.feedforward import Controller
from ctrlgen.controller.lost_state import UNLIMITED
from ctrlgen.model.discretisation import SETTLING_SWEEPS

EXACT = 64  # samples of a late call that are followed one by one; later the device is taken for settled, and counted
DOUBLED = 32  # times that a measurement's error is halved at most: what is left then is below any float


@dataclass(frozen=True)
class Belief:
    """What is believed of a device: `state` as of `Controller.step`, and after how many samples it is `unsure` no more, or FOREVER.
    `tick` of the clock at the last call that told one."""

    state: State
    unsure: int = 0
    tick: int | None = None


@dataclass(frozen=True)
class Estimator(Clocked[Belief]):
    """The `controller` of a device whose kernels have a `contraction`."""

    controller: Controller

    @cached_property
    def bounds(self) -> Contraction:
        """How fast a wrong belief dies out."""
        bounds = self.controller.kernels.contraction
        assert bounds is not None
        return bounds

    def rest(self) -> Belief:
        """A device that is known to be at rest."""
        return Belief(self.controller.rest())

    def forget(self, estimate: Belief) -> Belief:
        """A device of which nothing is known: its states at the end, of what drives can lead to, that is farthest from rest."""
        home = (estimate.state[0], np.zeros_like(estimate.state[1]), *estimate.state[2:])
        return replace(estimate, state=self._balanced(self.bounds.start, home), unsure=self.bounds.unknown)

    def _balanced(self, x: np.ndarray, before: State) -> State:
        z, u = before[1], self.controller.kernels.safe_drive
        for _ in range(SETTLING_SWEEPS):
            z = answer(self.controller.kernels.static.settle, x, z, u)
        return x, z, *before[2:]

    def step(self, estimate: Belief, target: np.ndarray, *, settle: bool = False) -> tuple[ControllerStep, Belief]:
        """`Controller.step`, with the bit UNSURE while the belief may be wrong. To settle takes `settling` samples from when it moved."""
        step = self.controller.step(estimate.state, target, settle=settle)
        if ControllerStatus.LOST in step.status:
            return step, replace(estimate, state=step.state)
        unsure = estimate.unsure
        if settle and np.any(np.abs(step.state[0] - estimate.state[0]) > self.bounds.known):
            unsure = max(unsure, self.bounds.settling)
        if unsure:
            step = replace(step, status=step.status | ControllerStatus.UNSURE)
        return step, replace(estimate, state=step.state, unsure=_later(unsure, 1), tick=later(estimate.tick, 1))

    def elapsed(self, estimate: Belief, ticks: int, drive: np.ndarray) -> tuple[ControllerStatus, Belief]:
        """`ticks` samples passed under this `drive` (n_u,) without a call; status INPUT, and nothing else, for a drive out of its range.
        Exact for `EXACT` of them; in the others the device comes to the equilibrium, from wherever it was."""
        m, state = self.controller.kernels.nominal, estimate.state
        if self.controller.is_lost(*state):
            return ControllerStatus.LOST, estimate
        if not np.all((drive >= m.u_bounds[0]) & (drive <= m.u_bounds[1])):
            return ControllerStatus.INPUT, estimate
        (x, z, *last), unsure = state, estimate.unsure
        static, moving = self.controller.kernels.modes
        for _ in range(min(ticks, EXACT)):
            x = answer(moving.advance, x, z, drive)
            z = answer(static.settle, x, z, drive)
        if ticks > EXACT:
            for _ in range(SETTLING_SWEEPS):
                x = answer(static.advance, x, z, drive)
                z = answer(static.settle, x, z, drive)
            unsure = max(unsure, self.bounds.settling)
        unsure = _later(unsure, ticks)
        status = ControllerStatus.UNSURE if unsure else ControllerStatus(0)
        tick = later(estimate.tick, ticks)
        return status, replace(estimate, state=(x, z, *(drive for _ in last)), unsure=unsure, tick=tick)

    def observe(self, estimate: Belief, measured: np.ndarray, error: float) -> tuple[ControllerStatus, Belief]:
        """The actuators' states were `measured` (n_states,) to within `error` >= 0, SI: believed is the end that is farther from rest.

        INPUT, and nothing else, for what is no number or out of what drives can lead to. A belief that is known better stays; one that
        contradicts the measurement is given up, for both may be wrong then."""
        if self.controller.is_lost(*estimate.state):
            return ControllerStatus.LOST, estimate
        n, b, x = len(measured), self.bounds, estimate.state[0]
        within = (measured >= b.low[:n] - error) & (measured <= b.high[:n] + error)
        if not (0 <= error <= UNLIMITED and np.all(within)):
            return ControllerStatus.INPUT, estimate
        unsure, told = estimate.unsure, self._samples(error)
        apart = np.any(np.abs(measured - x[:n]) > error + b.known[:n])
        if not unsure and apart:
            unsure, estimate = b.unknown, replace(estimate, state=self._measured(measured, error, estimate.state))
        elif unsure > told:
            unsure = told if len(x) == n else unsure
            estimate = replace(estimate, state=self._measured(measured, error, estimate.state))
        status = ControllerStatus.UNSURE if unsure else ControllerStatus(0)
        return status, replace(estimate, unsure=unsure)

    def _measured(self, measured: np.ndarray, error: float, before: State) -> State:
        n, b = len(measured), self.bounds
        believed = np.clip(measured + b.side[:n] * error, b.low[:n], b.high[:n])  # the true ones are between these too
        return self._balanced(np.concatenate([believed, before[0][n:]]), before)

    def _samples(self, error: float) -> int:
        """After how many samples a belief at one end of a measurement with this `error` is known."""
        b, n = self.bounds, self.controller.kernels.nominal.n_states
        left, samples = b.in_known(n) * error, 0
        for _ in range(DOUBLED):
            if left > 1 and samples < b.unknown:
                left, samples = left / 2, samples + b.halving
        return min(samples, b.unknown)


def _later(unsure: int, ticks: int) -> int:
    return unsure if unsure == FOREVER else max(unsure - ticks, 0)
