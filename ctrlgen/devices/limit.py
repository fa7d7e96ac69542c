"""Limits of a device: what they bound, by how much, and the range in which distances from them are counted."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from ctrlgen.core.units import show
from ctrlgen.devices.signal import Signal


@dataclass(frozen=True, eq=False)
class Limit:
    """lower <= expr <= upper for each channel, SI; None where there is no bound.

    A limit on an expression that is not a variable of the model itself must be convex in the displacement, never negative,
    and zero at home: the controller keeps it by scaling the displacement toward home. A device may state a bound in terms of its
    numbers, so that it follows one that is free; a model has the number.

    `reserve` [SI]: by how much the lower and the upper bound of the device have been tightened for what is not known exactly.
    """

    name: str
    label: str
    channels: tuple[str, ...]
    unit: str
    expr: ca.SX
    lower: float | None = None
    upper: float | None = None
    reserve: tuple[float, float] = (0.0, 0.0)

    @property
    def bounds(self) -> tuple[float, float]:
        """The lower and the upper bound [SI], infinite where there is none."""
        return -np.inf if self.lower is None else self.lower, np.inf if self.upper is None else self.upper

    @property
    def span(self) -> float:
        """The range of a limit with two bounds, the size of a single bound [SI]: distances from a limit are counted in it.

        Zero where the only bound is zero.
        """
        return float(spans(self.bounds))

    @property
    def text(self) -> str:
        """The limit as text, such as '0 W <= heater power <= 1.2 W'."""
        low = "" if self.lower is None else f"{show(self.lower, self.unit)} <= "
        return f"{low}{self.label}" + ("" if self.upper is None else f" <= {show(self.upper, self.unit)}")

    def tightened(self, below: float, above: float) -> Limit:
        """The same with its bounds moved inward by `below` and `above`, which are added to what has been reserved."""
        lower = None if self.lower is None else self.lower + below
        upper = None if self.upper is None else self.upper - above
        return replace(self, lower=lower, upper=upper, reserve=(self.reserve[0] + below, self.reserve[1] + above))

    def described(self, bound: float) -> float:
        """The device's own bound, of which `bound` is the tightened one."""
        return bound - self.reserve[0] if bound == self.lower else bound + self.reserve[1]


def rate_limit(drive: Signal, i: int, low: float, high: float, unit: str) -> Limit:
    """low <= du/dt <= high [SI] of component i of the drive: `expr` is the drive itself, whose change by time is limited."""
    name = drive.channels[i]
    return Limit(f"rate_{name}", f"rate of {name}", (name,), unit, drive.expr[i], low, high)


def spans(bounds: tuple[Any, Any]) -> np.ndarray:
    """(n,) the ranges of `bounds`, in which distances from them are counted: of a single bound its size; infinite where there is none."""
    low, high = bounds
    return np.where(np.isfinite(high - low), abs(high - low), np.minimum(np.abs(low), np.abs(high)))


def ranges(bounds: tuple[np.ndarray, np.ndarray], otherwise: np.ndarray | float) -> np.ndarray:
    """(n,) upper less lower of `bounds`; `otherwise` where one of them is infinite."""
    low, high = bounds
    return np.where(np.isfinite(high - low), high - low, otherwise)
