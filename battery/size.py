"""How large a planted law is: the rms change of the output that refitting the nominal numbers cannot take away, over the noise."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from battery.laws import simulate
from battery.plant_axis import Array, Axis, Planted, Scene

# Refitting takes these away altogether: they are a nominal number
OWN = (
    "drive_gain",
    "sensor_gain",
    "stiffness",
    "home_offset",
)
REFITTED = ("mass", "damping", "stiffness", "force_constant")


def refitted(axis: Axis) -> tuple[str, ...]:
    """The numbers of the axis that a maker states with a tolerance."""
    return REFITTED if axis.mass else ("force_constant",)


def sensitivities(axis: Axis, run: Callable[[Axis], Array]) -> Array:
    """Columns d y/d ln p by central differences, and one of ones: (n, 5); (n, 2) without mass."""
    columns = []
    for name in refitted(axis):
        value = getattr(axis, name)
        step = 1e-4 * (value or 1.0)
        up, down = (run(replace(axis, **{name: value + s})) for s in (step, -step))
        columns.append((up - down) / 2e-4)
    return np.column_stack([*columns, np.ones(len(columns[0]))])


def left_over(change: Array, columns: Array) -> float:
    """rms of `change` (n,) after the best combination of `columns` is taken away."""
    scale = np.linalg.norm(columns, axis=0)
    keep = scale > 0
    unit = columns[:, keep] / scale[keep]
    fit, *_ = np.linalg.lstsq(unit, change, rcond=1e-9)
    return float(np.sqrt(np.mean((change - unit @ fit) ** 2)))


class Gauge(ABC):
    """Measures what a law changes, and scales laws to a size."""

    @abstractmethod
    def size(self, planted: Any) -> float:
        """rms of what `planted`, anything with a name and an amplitude, changes, per noise standard deviation."""

    def scaled(self, planted: Any, target: float, low: float, high: float) -> tuple[Any, float]:
        """`planted` with the amplitude that has size `target`; the nearest that stays within [low, high] of it counts.

        Raises ValueError where no such amplitude is found: the caller draws again.
        """
        for _ in range(12):
            size = self.size(planted)
            if max(low, 0.85 * target) <= size <= min(high, 1.15 * target):
                return planted, size
            factor = float(np.clip(target / size, 0.05, 20)) if np.isfinite(size) and size > 0 else 3.0
            if not np.isfinite(size):
                factor = 0.1
            grown = planted.amplitude * factor
            if planted.name in {"saturation", "end_stop"}:  # shares of the range
                grown = min(grown, (planted.amplitude + 0.9) / 2)
            planted = replace(planted, amplitude=grown)
        size = self.size(planted)
        if low <= size <= high:
            return planted, size
        raise ValueError(f"{planted.name}: no amplitude of size {target:.2g} found ({size:.2g})")


class Ruler(Gauge):
    """Measures laws on one record: `drive`, `start`, `ambient`, `noise` as in `simulate`."""

    def __init__(
        self, axis: Axis, scene: Scene, drive: Array, start: float, ambient: Array | None, noise: Array, linear: bool
    ) -> None:
        self.axis, self.scene = axis, scene.rough
        self._run = lambda axis, planted=(): simulate(axis, drive, planted, self.scene, start, ambient, noise, linear)
        self.plain = self._run(axis)
        self.columns = sensitivities(axis, self._run)

    def change(self, planted: list[Planted]) -> Array:
        """What the laws change in the reading, (n,) [m]."""
        return self._run(self.axis, planted) - self.plain

    def size(self, planted: Planted) -> float:
        """rms left over, per noise standard deviation; without a refit for the laws in OWN."""
        change = self.change([planted])
        rest = float(np.sqrt(np.mean(change**2))) if planted.name in OWN else left_over(change, self.columns)
        return rest / self.scene.noise
