"""The place of a path that may be moved: that with the smallest expected error among those where the limits hold."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy

from ctrlgen.budget.chance_constraint import ChanceConstraint
from ctrlgen.budget.judged_path import JudgedPath
from ctrlgen.budget.limits import Margins
from ctrlgen.budget.uncertainty import Uncertainties
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.units import difference, show
from ctrlgen.devices import Signal
from ctrlgen.model.model import Model
from ctrlgen.trajectory.nominal import unlimited
from ctrlgen.trajectory.scenario import Scenario
from ctrlgen.trajectory.scenario_file import Robust

CUSHION = 0.01  # standard uncertainties that a moved path keeps more: its place is rounded
STEP = 1e-3  # typical sizes by which a path is moved for a difference
FARTHEST = 100.0  # typical sizes by which a path is moved where no displacement has limits
MOST_STEPS = 20  # of the search
ROUNDS = 4  # of it, each with a back-off for more limits at a time
DIGITS = 4  # of the place of a moved path


@dataclass(frozen=True)
class MovablePath:
    """A `scenario` that may be moved along the channels that `robust` names, with a device of which something `stated` is uncertain."""

    scenario: Scenario
    model: Model
    robust: Robust
    stated: Uncertainties
    progress: Callable[[str], None]

    @property
    def signal(self) -> Signal:
        """The signal that the scenario follows."""
        return self.model.signals[self.scenario.file.follow]

    @property
    def channels(self) -> list[int]:
        """The places in the signal of the channels along which it may be moved. Raises InputError for one that is not there."""
        if unknown := [channel for channel in self.robust.home if channel not in self.signal.channels]:
            what = (
                f"{unknown[0]!r} is no channel of the {self.signal.name}; those are {', '.join(self.signal.channels)}"
            )
            raise InputError(self.scenario.path, [Fault("robust.home", what)])
        return [self.signal.channels.index(c) for c in self.robust.home]

    def best(self) -> dict[str, float]:
        """The place, by channel [SI]; where the limits hold nowhere, that where least is missing."""
        channels = self.channels
        scale = np.array(self.signal.scale)[channels]
        known: dict[tuple[float, ...], tuple[Margins, float]] = {}

        def judged_at(place: np.ndarray, like: JudgedPath | None = None) -> JudgedPath:
            home = self._named(place * scale)
            self.progress("expected error, moved by " + shown_home(self.signal, home))
            return JudgedPath.of(unlimited(replace(self.scenario, home=home), self.model), self.stated, like)

        start = judged_at(np.zeros(len(channels)))

        def at(place: np.ndarray) -> tuple[Margins, float]:
            key = tuple(float(v) for v in place)
            if key not in known:
                judged = judged_at(place, start)
                known[key] = judged.margins, judged.error / start.error
            return known[key]

        low, high = self._ends(start, scale)

        def error(p: np.ndarray) -> np.ndarray:
            return np.array([at(p)[1]])

        size = start.margins.sd.max(axis=1)
        place, counted = np.zeros(len(channels)), np.isfinite(start.margins.bounds) & (size > 0)
        size = size[counted]
        z = float(-scipy.special.ndtri(1 - self.robust.chance))
        for _ in range(ROUNDS):

            def left(p: np.ndarray, z: float = z) -> np.ndarray:  # nearly linear, which their probability is not
                least = ChanceConstraint(at(p)[0], self.robust.chance).left(z).min(axis=1)
                return np.asarray(least[counted] / size - CUSHION)

            kept = {"type": "ineq", "fun": left, "jac": lambda p, left=left: _slope(left, p, low, high)}
            answer = scipy.optimize.minimize(
                lambda p: float(error(p)[0]),
                place,
                jac=lambda p: _slope(error, p, low, high)[0],
                method="SLSQP",
                bounds=list(zip(low, high, strict=True)),
                options={"ftol": 1e-4, "maxiter": MOST_STEPS},
                constraints=kept,
            )
            place = np.clip(answer.x, low, high)
            chance = ChanceConstraint(at(place)[0], self.robust.chance)
            if chance.holds or chance.quantile <= z:
                break
            z = chance.quantile
        units = [self.signal.units[i] for i in channels]
        return self._named(np.array([_rounded(v, unit) for v, unit in zip(place * scale, units, strict=True)]))

    def _ends(self, start: JudgedPath, scale: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How far each channel can be moved by itself before a displacement leaves its range, to first order [typical sizes]; zero is
        between both."""
        problem, z = self.scenario.bind(self.model), start.path.solution.trace.z
        bounds = self.model.z_bounds
        slope = problem.inverse.slope(problem.motion.middle)[:, self.channels] * scale
        low, high = np.full(len(scale), -FARTHEST), np.full(len(scale), FARTHEST)
        room = (bounds[0] - z.max(axis=0), bounds[1] - z.min(axis=0))  # one end of the path still inside
        for i, column in enumerate(slope.T):
            with np.errstate(divide="ignore", invalid="ignore"):
                ends = np.sort(np.nan_to_num(np.array(room) / column, nan=np.inf), axis=0)
            low[i] = max(low[i], np.max(np.where(column != 0, ends[0], -np.inf)))
            high[i] = min(high[i], np.min(np.where(column != 0, ends[1], np.inf)))
        return np.minimum(low, 0.0), np.maximum(high, 0.0)

    def _named(self, moved: np.ndarray) -> dict[str, float]:
        return {channel: float(v) for channel, v in zip(self.robust.home, moved, strict=True)}


def shown_home(signal: Signal, home: Mapping[str, float]) -> str:
    """The place of a path in words: 'delta_z = +3.2 um'."""
    units = dict(zip(signal.channels, signal.units, strict=True))
    return ", ".join(f"{c} = {'+' if v > 0 else ''}{show(v, units[c])}" for c, v in home.items())


def _slope(f: Callable[[np.ndarray], np.ndarray], place: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """The differences (m, n) of f (m,), toward the inside."""
    here, columns = f(place), []
    for i in range(len(place)):
        step = np.zeros(len(place))
        step[i] = STEP if place[i] + STEP <= high[i] else -STEP
        columns.append((f(place + step) - here) / step[i])
    return np.column_stack(columns)


def _rounded(value: float, unit: str) -> float:
    """The `value` with as many digits as are shown in its `unit`."""
    one = 1 / difference(1.0, unit)
    return float(f"{value / one:.{DIGITS}g}") * one
