"""A controller that is called at times that vary: how long ago the last call was, how soon the next one will be.

Between two calls a drive is held, so that every state goes along its own exponential, never back. Where a call comes after another time
than the last one said, the state is stepped anew from there, over the time that passed: exact for lags, whatever that time is. What
was kept at both ends of a sample is kept in between; beyond its end limits may be passed, which the bit CLOCK tells. In the C it is
codegen/limiter/timed.c.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ctrlgen.controller.controller_step import ControllerStatus, ControllerStep, State, answer
from ctrlgen.controller.estimate import Belief, Estimator
from ctrlgen.controller.feedforward import Controller


@dataclass(frozen=True)
class TimedBelief:
    """What is believed now, the state in which the last sample `begun`, None where none did, and the time [s] that it was to take."""

    now: Belief
    begun: State | None = None
    h: float = 0.0


@dataclass(frozen=True, eq=False)
class TimedController:
    """A `controller` whose kernels have `times`."""

    controller: Controller

    @property
    def times(self) -> tuple[float, float]:
        """Shortest and longest time of a sample [s]."""
        times = self.controller.kernels.times
        assert times is not None
        return times

    def over(self, h: float) -> Controller:
        """The controller whose samples take `h` [s]."""
        return _over(self.controller, h)

    def rest(self) -> TimedBelief:
        """A device that is known to be at rest."""
        return TimedBelief(Belief(self.controller.rest()))

    def step_after(
        self, estimate: TimedBelief, since: float, ahead: float, target: np.ndarray, held: np.ndarray
    ) -> tuple[ControllerStep, TimedBelief]:
        """Drives `since` [s] after the last call, whose drive (n_u,) is `held`, that bring the signal to `target` in `ahead` [s].

        CLOCK: the last sample was longer than it was to be. CLOCK and INPUT, with the safe drive: a time is none or beyond its bounds;
        where that was `since`, or what is held is no drive, nothing is known of the states any more.
        """
        belief, status, wanted = estimate.now, ControllerStatus(0), target
        if self.controller.is_lost(*belief.state):
            step = self.controller._without_state()
            return step, TimedBelief(replace(belief, state=step.state))
        low, high = self.times
        m, estimated = self.controller.kernels.nominal, self.controller.kernels.contraction is not None
        if estimate.begun is not None and since != estimate.h:
            if low <= since <= high and np.all((held >= m.u_bounds[0]) & (held <= m.u_bounds[1])):
                status |= ControllerStatus.CLOCK if since > estimate.h else status
                belief = replace(belief, state=self._passed(estimate.begun, since, held))
            else:
                status, wanted = ControllerStatus.CLOCK, np.full_like(target, np.nan)
                belief = Estimator(self.controller).forget(belief) if estimated else belief
        if not low <= ahead <= high:
            status, wanted = ControllerStatus.CLOCK, np.full_like(target, np.nan)
            ahead = self.controller.kernels.sample_time or low
        step, after = self._step(belief, ahead, wanted, estimated)
        return replace(step, status=step.status | status), TimedBelief(after, belief.state, ahead)

    def _passed(self, begun: State, since: float, held: np.ndarray) -> State:
        """The state `since` [s] after a sample had `begun`, whose drive is `held`."""
        x, z, *last = begun
        static, moving = self.over(since).kernels.modes
        x = answer(moving.advance, x, z, held)
        return x, answer(static.settle, x, z, held), *(held for _ in last)

    def _step(self, belief: Belief, h: float, target: np.ndarray, estimated: bool) -> tuple[ControllerStep, Belief]:
        if estimated:
            return Estimator(self.over(h)).step(belief, target)
        step = self.over(h).step(belief.state, target)
        return step, replace(belief, state=step.state)


@lru_cache(maxsize=256)  # times of a test: each has kernels of its own, and what is decided of them
def _over(controller: Controller, h: float) -> Controller:
    return replace(controller, kernels=controller.kernels.over(h))
