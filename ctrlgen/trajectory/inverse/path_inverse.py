"""What every inverse of a path answers: states, displacements and drives that follow it exactly, were there no limits."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from ctrlgen.model.model import Model
from ctrlgen.trajectory.inverse.clock import Clock, Sampled
from ctrlgen.trajectory.inverse.motion import Motion
from ctrlgen.trajectory.inverse.violations import Before, Violation, violations

PERIODS = 20  # of a closed path, after which a memory that still changes is left to IPOPT


@dataclass(frozen=True)
class InverseTrajectory:
    """States `x` (n, n_x), displacements `z` (n, n_axes) and drives `u` (n, n_u) [SI] that follow a motion; `u_start` (n_u,) is the
    drive with which an open one begins.

    `solved`: they satisfy all equations. `unsettled` [typical sizes]: by how much memories may still change the displacements
    of a closed path before it repeats; infinite where they do not settle. `iterations` of Newton's method.
    """

    x: np.ndarray
    z: np.ndarray
    u: np.ndarray
    u_start: np.ndarray
    clock: Clock
    closed: bool
    solved: bool = False
    unsettled: float = 0.0
    iterations: int = 0

    @property
    def exact(self) -> bool:
        """Whether nothing else follows the motion: the equations hold, and a closed path repeats."""
        return self.solved and self.unsettled == 0.0

    @property
    def drive_before(self) -> np.ndarray:
        """(n, n_u) the drive under which each sample stands: its own where it is settled, else that held until then."""
        if not isinstance(self.clock, Sampled):
            return self.u
        return np.vstack([self.u[-1:] if self.closed else self.u_start[None], self.u[:-1]])

    @property
    def before(self) -> Before | None:
        """The drives from which the rates of the next ones are; None where no time passes."""
        return Before(self.drive_before, self.clock.sample_time) if isinstance(self.clock, Sampled) else None

    def violations(self, model: Model, margin: float = 0.0) -> list[Violation]:
        """The limits that it breaks, those on the rates of drives too where time passes."""
        return violations(model, self.x, self.z, self.u, margin, self.before)


class PathInverse(ABC):
    """The inverse of a `model` along paths of its signal `follow`, whose samples are where the `clock` says."""

    def __init__(self, model: Model, follow: str, clock: Clock) -> None:
        self.model, self.follow, self.clock = model, follow, clock

    @property
    @abstractmethod
    def without_memories(self) -> PathInverse:
        """The same of the device without the effects that have memories, for searches."""

    @abstractmethod
    def trajectory(self, motion: Motion, periods: int = PERIODS) -> InverseTrajectory:
        """What `motion` takes; not finite where the equations have no solution. A closed path with memories is run through `periods`
        times at most."""

    def held(self, motion: Motion) -> InverseTrajectory:
        """What `motion` takes where each drive is held from sample to sample. Raises SolverError where no such drives are found."""
        return self.trajectory(motion)

    def displacements(self, motion: Motion) -> np.ndarray:
        """z (n, n_axes) along a motion, whatever the drives."""
        return self.trajectory(motion).z

    @abstractmethod
    def at_rest(self, target: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """x (n_x,), z (n_axes,) and u (n_u,) of the equilibrium at `target` (channels,); not finite where there is none."""

    @abstractmethod
    def slope(self, target: np.ndarray) -> np.ndarray:
        """(n_axes, channels) d displacement / d target at rest there."""

    def keeps_limits(
        self, motion: Motion, chosen: np.ndarray | None = None, margin: float = 0.0, periods: int = PERIODS
    ) -> bool:
        """Whether `motion` can be followed with a `margin`, a share of each limit; judged by the samples `chosen` and those after them
        where these are given and tell it."""
        needed = self.trajectory(motion, periods)
        return needed.solved and not needed.violations(self.model, margin)

    def equilibria_at(self, motion: Motion) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """x (n, n_x), z (n, n_axes) and u (n, n_u) of equilibria at the samples; None where what a sample takes depends on others."""
        return None

    def leads_to(self, motion: Motion, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Where the drives at the samples `chosen` lead, z (n, n_axes), and these, u (n, n_u); None where the drives depend on more than
        their own samples."""
        return None
