"""Whether samples can be followed, by the exact inverse with everything that the device has, and in how few it can be done."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ctrlgen.core.errors import InputError, SolverError
from ctrlgen.core.units import Quantity
from ctrlgen.model.model import Model
from ctrlgen.path_timing.curve import Curve
from ctrlgen.path_timing.retimed import retimed
from ctrlgen.trajectory.inverse.balanced import PathInverse
from ctrlgen.trajectory.inverse.inertial import InertialInverse
from ctrlgen.trajectory.inverse.motion import Motion
from ctrlgen.trajectory.inverse.redundant import LeastEffortInverse, motion_inverse, path_inverse
from ctrlgen.trajectory.scenario import Scenario

GROWTH = 1.3  # of a number of intervals, by which the first that suffices is looked for
MOST_GROWTH = 200.0  # times the number that is begun with, beyond which nothing suffices


@dataclass(frozen=True)
class Followed:
    """What decides whether samples of a `curve` can be followed at a sample `rate`."""

    curve: Curve
    rate: Quantity
    inverse: PathInverse | InertialInverse | LeastEffortInverse

    @classmethod
    def of(cls, curve: Curve, model: Model, rate: Quantity) -> Followed:
        """With the exact inverse of `model`."""
        follow = curve.scenario.file.follow
        return cls(curve, rate, (motion_inverse if model.inertial else path_inverse)(model, follow, 1 / rate.si))

    @property
    def model(self) -> Model:
        """The device with all its effects."""
        return self.inverse.model

    @property
    def sample_time(self) -> float:
        """[s]"""
        return 1 / self.rate.si

    def samples(self, share: np.ndarray) -> np.ndarray:
        """(n, channels) the set-points at shares of the path, the end of a closed one left out, which is its beginning."""
        return self.curve.samples(share[:-1] if self.curve.closed else share)

    def scenario(self, share: np.ndarray, title: str, how: str = "fastest") -> Scenario:
        """Set-points at these shares as a scenario, whose name ends on `how` they are timed."""
        return retimed(self.curve.scenario, self.model, self.samples(share), self.rate, title, how)

    def keeps(self, share: np.ndarray) -> bool:
        """Whether set-points at these shares, one each sample, keep every limit."""
        samples, closed = self.samples(share), self.curve.closed
        if not self.model.inertial:
            needed = self.inverse.trajectory(samples, closed)
            return needed.exact and not needed.violations(self.model, self.sample_time, closed)
        try:
            return self._moves(self.scenario(share, "").motion(self.model))
        except InputError:  # not smooth enough
            return False

    def keeps_timed(self, scenario: Scenario) -> bool:
        """Whether a scenario with a law of time of its own keeps every limit at this rate."""
        target = scenario.target(self.model)
        if isinstance(target, Motion):
            return self._moves(target)
        needed = self.inverse.trajectory(target, self.curve.closed)
        return needed.exact and not needed.violations(self.model, self.sample_time, self.curve.closed)

    def _moves(self, motion: Motion) -> bool:
        """Whether held drives lead a device with inertia along a motion within all limits."""
        assert not isinstance(self.inverse, PathInverse)
        try:
            found = self.inverse.sampled(motion, self.curve.closed)
        except SolverError:
            return False
        needed = self.inverse.needed(found, motion, self.curve.closed)
        return not needed.violations(self.model, self.sample_time, self.curve.closed)


def fewest(follows: Callable[[int], bool], least: int) -> int | None:
    """The smallest number of intervals, `least` or more, with which a path is followed, where more are followed too; None where none is."""
    fails, held = least - 1, least
    while not follows(held):
        fails, held = held, max(held + 1, int(np.ceil(held * GROWTH)))
        if held > MOST_GROWTH * least:
            return None
    while held - fails > 1:
        middle = (held + fails) // 2
        fails, held = (fails, middle) if follows(middle) else (middle, held)
    return held
