"""A solved path with what is uncertain along it: its margins, its expected error, and what is to be reserved of its limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ctrlgen.budget.limits import Margins, Slopes, margins, slopes_of_limits
from ctrlgen.budget.linear import Propagated, propagate
from ctrlgen.budget.uncertain_path import UncertainPath
from ctrlgen.budget.uncertainty import Uncertainties
from ctrlgen.core.errors import SolverError
from ctrlgen.model.model import Model
from ctrlgen.trajectory.solution import Solution

Reserves = dict[str, tuple[float, float]]  # limit -> what is kept of its lower and upper bound [SI]


@dataclass(frozen=True)
class JudgedPath:
    """A path with its `margins`, and its expected `error`, the root mean square along it of the combined standard uncertainty of the
    followed signal in typical sizes."""

    path: UncertainPath
    linear: Propagated
    slopes: Slopes
    margins: Margins
    error: float

    @classmethod
    def of(cls, solution: Solution, stated: Uncertainties, like: JudgedPath | None = None) -> JudgedPath:
        """`solution` under what is `stated`; `like` is one of the same device, whose bounds are used again. Raises SolverError."""
        path = UncertainPath(solution, stated) if like is None else like.path.along(solution)
        try:
            linear = propagate(path)
        except FloatingPointError as fault:
            raise SolverError(
                f"{fault}: a law of the device has no derivative there; smooth it, or leave it out"
            ) from None
        slopes = slopes_of_limits(path, linear) if like is None else like.slopes
        combined = linear.combined("pose", stated) / np.array(path.signal.scale)
        error = float(np.sqrt(np.mean(np.sum(combined**2, axis=1))))
        return cls(path, linear, slopes, margins(path, linear, slopes), error)

    def largest(self, reserve: np.ndarray) -> Reserves:
        """Of the `reserve` (2, n, channels) that of each limit where it is least safe."""
        left, reserves = self.margins.margin - reserve, Reserves()
        for limit, columns in self.path.places:
            below, above = (float(reserve[s, :, columns].flat[int(np.argmin(left[s, :, columns]))]) for s in (0, 1))
            reserves[limit.name] = (0.0 if limit.lower is None else below, 0.0 if limit.upper is None else above)
        return reserves

    def kept(self, reserve: np.ndarray, model: Model) -> Reserves:
        """The same, but no bound is moved past what the path itself needs, which holds with its own reserve at every sample, or past
        where the device rests: there is nothing uncertain of a device at rest, and its controller starts there."""
        largest, y = self.largest(reserve), self.linear.nominal["limits"]
        rest, reserves = _at_rest(model), Reserves()
        for limit, columns in self.path.places:
            values = np.concatenate([y[:, columns].ravel(), rest[limit.name]])
            below, above = largest[limit.name]
            low, high = limit.bounds
            room_below, room_above = max(float(values.min()) - low, 0.0), max(high - float(values.max()), 0.0)
            reserves[limit.name] = (min(below, room_below), min(above, room_above))
        return reserves


def _at_rest(model: Model) -> dict[str, np.ndarray]:
    """The limited quantities of each limit at rest at home."""
    home = model.rest, np.zeros(len(model.axes)), np.clip(0.0, *model.u_bounds), model.p_nominal
    values = model.evaluate_limits.call(list(home))
    return {limit.name: v.full().ravel() for limit, v in zip(model.limits, values, strict=True)}
