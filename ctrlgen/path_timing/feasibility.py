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
from ctrlgen.trajectory.inverse.choice import choose_inverse
from ctrlgen.trajectory.inverse.clock import Sampled
from ctrlgen.trajectory.inverse.motion import Motion
from ctrlgen.trajectory.inverse.path_inverse import PathInverse
from ctrlgen.trajectory.scenario import Scenario

GROWTH = 1.3  # of a number of intervals, by which the first that suffices is looked for
MOST_GROWTH = 200.0  # times the number that is begun with, beyond which nothing suffices


@dataclass(frozen=True)
class Followed:
    """What decides whether samples of a `curve` can be followed at a sample `rate`."""

    curve: Curve
    rate: Quantity
    inverse: PathInverse

    @classmethod
    def of(cls, curve: Curve, model: Model, rate: Quantity) -> Followed:
        """The samples of a curve, followed by the exact inverse of `model`."""
        return cls(curve, rate, choose_inverse(model, curve.scenario.file.follow, Sampled(1 / rate.si)))

    @property
    def model(self) -> Model:
        """The device with all its effects."""
        return self.inverse.model

    @property
    def sample_time(self) -> float:
        """Time between set-points [s]."""
        return 1 / self.rate.si

    @property
    def may_be_even(self) -> bool:
        """Whether speed may be even along the path: an open one with inertia begins and ends at rest."""
        return self.curve.closed or not self.model.inertial

    def samples(self, share: np.ndarray) -> np.ndarray:
        """(n, channels) the set-points at shares of the path, the end of a closed one left out, which is its beginning."""
        return self.curve.samples(share[:-1] if self.curve.closed else share)

    def scenario(self, share: np.ndarray, title: str, how: str = "fastest") -> Scenario:
        """Set-points at these shares as a scenario, whose name ends on `how` they are timed."""
        return retimed(self.curve.scenario, self.model, self.samples(share), self.rate, title, how)

    def keeps(self, share: np.ndarray) -> bool:
        """Whether set-points at these shares, one each sample, keep every limit."""
        try:
            return self._keeps(self.scenario(share, "").bind(self.model).motion)
        except InputError:  # not smooth enough
            return False

    def keeps_timed(self, scenario: Scenario) -> bool:
        """Whether a scenario with a law of time of its own keeps every limit at this rate. Raises InputError where it has no motion."""
        return self._keeps(scenario.bind(self.model).motion)

    def _keeps(self, motion: Motion) -> bool:
        """Whether held drives lead along a motion within all limits."""
        try:
            needed = self.inverse.held(motion)
        except SolverError:
            return False
        return needed.exact and not needed.violations(self.model)


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
