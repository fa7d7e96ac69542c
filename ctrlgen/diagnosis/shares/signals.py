"""The signals of a record, of which a residual may be a function."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True, kw_only=True, eq=False)
class Signals:
    """The signals of one record, each (n,) in SI.

    `time` [s] on the clock of the recording, the pose's number for settled poses, whose `sample_time` is infinite; poses
    stand in the order in which they were taken. `position` by axis, `speed` by axis where it is known (else the derivative
    of the position is taken), `drive` by actuator, `reading`: what the model predicts, by channel, which tells the axes that
    a channel sees. `temperature` of the surroundings. `units`: for figures, by 'position x' or 'drive x'.
    """

    time: np.ndarray
    sample_time: float
    position: Mapping[str, np.ndarray] = field(default_factory=dict)
    speed: Mapping[str, np.ndarray] = field(default_factory=dict)
    drive: Mapping[str, np.ndarray] = field(default_factory=dict)
    reading: Mapping[str, np.ndarray] = field(default_factory=dict)
    temperature: np.ndarray | None = None
    units: Mapping[str, str] = field(default_factory=dict)

    @property
    def settled(self) -> bool:
        """Whether the samples are settled poses."""
        return not np.isfinite(self.sample_time)

    def derivative(self, values: np.ndarray) -> np.ndarray:
        """d/dt of `values` (n,); for settled poses the step from the pose before."""
        if self.settled:
            return np.diff(values, prepend=values[:1])
        return np.gradient(values, self.sample_time) if len(values) > 1 else np.zeros_like(values)

    def speed_of(self, axis: str) -> np.ndarray:
        """Speed (n,) of one axis, the step from the pose before for settled poses."""
        return self.speed[axis] if axis in self.speed else self.derivative(self.position[axis])
