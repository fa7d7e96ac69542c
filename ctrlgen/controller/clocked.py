"""Calls at the ticks of a clock, of a controller whose belief of its device may be wrong: `limiter_step_at` of the C (step_at.c)."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import Generic, Protocol, TypeVar

import numpy as np

from ctrlgen.controller.controller_step import ControllerStatus, ControllerStep

BACKWARD = 2**31  # ticks: a clock that went on by more went back


class Ticking(Protocol):
    """What is believed of a device, with the `tick` of the clock at the last call that told one."""

    @property
    def tick(self) -> int | None:
        """The tick; None before the first."""


def later(tick: int | None, ticks: int) -> int | None:
    """The tick of a clock of 32 bits, if it runs, so many `ticks` on."""
    return None if tick is None else (tick + ticks) % 2**32


B = TypeVar("B", bound=Ticking)


@dataclass(frozen=True)
class Clocked(Generic[B]):
    """A controller with beliefs B, which can be told of calls that were late, or twice."""

    @abstractmethod
    def forget(self, estimate: B) -> B:
        """A device of which nothing is known."""

    @abstractmethod
    def elapsed(self, estimate: B, ticks: int, drive: np.ndarray) -> tuple[ControllerStatus, B]:
        """`ticks` samples passed under this `drive` (n_u,) without a call: the clock is so much later, and none is made up for again."""

    @abstractmethod
    def step(self, estimate: B, target: np.ndarray, *, settle: bool = False) -> tuple[ControllerStep, B]:
        """A sample: the clock is one later, but where the state is lost."""

    def step_at(self, estimate: B, tick: int, target: np.ndarray, held: np.ndarray) -> tuple[ControllerStep | None, B]:
        """A step at `tick` of a clock that counts samples, 32 bits wide; `held` (n_u,) is the drive of the last call.

        Calls that were missed are made up for (`elapsed`), with the bit CLOCK. None where no sample has passed: drives and state stay, and
        so does the bit UNSURE. A clock that went back, and a held drive out of range, leave the state unknown."""
        status = ControllerStatus(0)
        if estimate.tick is not None:
            since = (tick - estimate.tick) % 2**32
            if since == 0:
                refused, _ = self.elapsed(estimate, 0, held)
                return None, self.forget(estimate) if refused & ControllerStatus.INPUT else estimate
            if since > 1:
                status, caught_up = ControllerStatus.CLOCK, estimate
                if since < BACKWARD:
                    refused, caught_up = self.elapsed(estimate, since - 1, held)
                if since >= BACKWARD or refused & ControllerStatus.INPUT:
                    caught_up = self.forget(estimate)
                estimate = caught_up
        step, estimate = self.step(replace(estimate, tick=later(tick, -1)), target)  # type: ignore[type-var]
        return replace(step, status=step.status | status), estimate
