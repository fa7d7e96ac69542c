"""How safe each limit is: its margin along the path under everything that is uncertain, at a chosen probability.

A limited quantity y with the bound b has the margin M = b - y (or y - b); to first order it is normal with sd u(M), and the limit
holds at a sample with the probability p where M - z_p u(M) > 0, z_p the quantile of the normal distribution.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import scipy

from ctrlgen.budget.linear import Propagated
from ctrlgen.budget.monte_carlo import Drawn
from ctrlgen.budget.uncertain_path import UncertainPath
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.devices import Limit
from ctrlgen.devices.changed_numbers import changed
from ctrlgen.model.assembly import build_model
from ctrlgen.model.model import Model

LEAST_TAIL = 5  # draws beyond a quantile, below which it is not estimated
FAR = 6.0  # standard uncertainties from a limit: no draw of a million breaks it
SAME = 1e-12  # relative change of a bound that is rounding


@dataclass(frozen=True)
class Safety:
    """One bound of a limit where it is least safe, SI: `channel`, `sample`, the `bound` on its `side`, the margin as described, its
    standard uncertainty `sd`, and what is left of the margin at the chosen probability: `kept`, negative where it is not kept.

    `probability` is that with which the bound is kept there; `drawn` what the draws leave of the margin, None where they are too few.
    """

    limit: Limit
    channel: str
    side: Literal["lower", "upper"]
    sample: int
    bound: float
    margin: float
    sd: float
    kept: float
    probability: float
    drawn: float | None = None


@dataclass(frozen=True)
class Slopes:
    """Derivatives by each of the m columns: of the bounds `lower`, `upper` (channels, m), and of the limited quantities by numbers
    that act on no motion, `direct` (n, channels, m)."""

    lower: np.ndarray
    upper: np.ndarray
    direct: np.ndarray


def slopes_of_limits(path: UncertainPath, linear: Propagated) -> Slopes:
    """How the stated numbers act on the limits themselves, by devices with one of them changed by its standard deviation. Raises
    InputError for a number that acts on neither motion nor limits."""
    names = [name for line in path.uncertainties.lines for name in line.paths]
    kinds = [line.kind for line in path.uncertainties.lines for _ in line.paths]
    sds, n = path.uncertainties.sds, len(names)
    numbers = [i for i in range(n) if kinds[i] == "number" and not names[i].startswith("effect[")]
    values = {path_: number.si for path_, number in path.model.device.quantities()}
    channels = len(path.channels)
    slopes = Slopes(np.zeros((channels, n)), np.zeros((channels, n)), np.zeros((path.n, channels, n)))
    before = _bounds(path, path.model)
    trace = path.solution.trace

    def model_with(columns: Sequence[int]) -> Model:
        return build_model(changed(path.model.device, {names[i]: values.get(names[i], 0.0) + sds[i] for i in columns}))

    def same(bounds: np.ndarray, others: np.ndarray) -> bool:
        return np.allclose(bounds, others, rtol=SAME, atol=0.0)

    def moved(columns: Sequence[int], after: np.ndarray) -> list[int]:
        """Those of the columns, with which the bounds are those `after`, that change one: by halving, for a model takes its time."""
        if not columns or same(after, before):
            return []
        if len(columns) == 1:
            return list(columns)
        first, second = columns[: len(columns) // 2], columns[len(columns) // 2 :]
        bounds = _bounds(path, model_with(first))
        if same(bounds, after):
            return moved(first, after)
        return moved(first, bounds) + moved(
            second, after if same(bounds, before) else _bounds(path, model_with(second))
        )

    idle, faults = [i for i in numbers if names[i] in path.idle], list[Fault]()
    moving = [i for i in numbers if i not in idle]
    for i in {*moved(moving, _bounds(path, model_with(moving))), *idle}:
        other = model_with([i])
        after = _bounds(path, other)
        with np.errstate(invalid="ignore"):  # what has no bound stays without
            slopes.lower[:, i], slopes.upper[:, i] = np.nan_to_num((after - before) / sds[i])
        if i in idle and channels:
            values_of = [_limited(path, model, trace.x, trace.z) for model in (path.solution.model, other)]
            slopes.direct[:, :, i] = (values_of[1] - values_of[0]) / sds[i]
        if i in idle and not (slopes.lower[:, i].any() or slopes.upper[:, i].any() or slopes.direct[:, :, i].any()):
            faults.append(
                Fault(f'numbers."{names[i]}"', "acts on neither motion nor limits of this device; leave it out")
            )
    if faults:
        source = path.uncertainties.inputs.get("uncertainty")
        raise InputError(source.path if source else path.solution.scenario.path, faults)
    return slopes


def _bounds(path: UncertainPath, model: Model) -> np.ndarray:
    """The lower and upper bounds (2, channels); infinite where there is none."""
    by_name = {limit.name: limit for limit in model.limits}
    limits = [by_name[limit.name] for limit, _ in path.channels]
    return np.array([limit.bounds for limit in limits]).reshape(-1, 2).T


def _limited(path: UncertainPath, model: Model, x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """The limited quantities (n, channels) of a `model` at the path's states."""
    values = model.limited_values(x, z, path.drive[path.before :])
    named = {limit.name: its for limit, its in zip(model.limits, values, strict=True)}
    return np.hstack([named[limit.name] for limit in path.limits])


@dataclass(frozen=True)
class Margins:
    """Of the lower and the upper bound of each limited quantity: the margin (2, n, channels), infinite without a bound, its sd, and the
    `bounds` (2, channels). Of the sd `lasting` (2, n, channels) is what lasts along the path, `scattered` (n, channels) what is
    independent from sample to sample."""

    margin: np.ndarray
    lasting: np.ndarray
    scattered: np.ndarray
    bounds: np.ndarray

    @property
    def sd(self) -> np.ndarray:
        """Standard uncertainty (2, n, channels) [SI]: what lasts and what scatters together."""
        return np.hypot(self.lasting, self.scattered)

    def least(self, z: float) -> np.ndarray:
        """What is left of the margins (2, n, channels) at the quantile z."""
        return self.margin - z * self.sd


def margins(path: UncertainPath, linear: Propagated, slopes: Slopes) -> Margins:
    """The margins to both bounds of each limit with their standard uncertainties, to first order."""
    y, bounds = linear.nominal["limits"], _bounds(path, path.model)
    margin = np.stack([y - bounds[0], bounds[1] - y])
    by_numbers = linear.sensitivity["limits"] + slopes.direct
    scattered = sum((sd**2 for sd in linear.scatter["limits"].values()), np.zeros(y.shape))
    sds = []
    for bound in (slopes.lower, slopes.upper):
        G = by_numbers - bound
        sds.append(np.sqrt(np.maximum(np.sum((G @ path.uncertainties.covariance) * G, axis=2), 0.0)))
    return Margins(margin, np.stack(sds), np.sqrt(scattered), bounds)


@dataclass(frozen=True)
class DrawnLimits:
    """The limits of draws along the path."""

    margins: Margins
    slopes: Slopes

    @cached_property
    def _near(self) -> np.ndarray:
        return np.asarray(self.margins.margin < FAR * self.margins.sd)

    def near(self, sample: int) -> np.ndarray:
        """(2, channels) which bounds some draws may break at a sample."""
        return self._near[:, sample]

    def of(self, columns: np.ndarray) -> LimitsOfDraws:
        """The limits of draws with the deviations `columns` (draws, m)."""
        lower, upper = self.margins.bounds
        return LimitsOfDraws(
            self, columns, lower + columns @ self.slopes.lower.T, upper + columns @ self.slopes.upper.T
        )


@dataclass(frozen=True)
class LimitsOfDraws:
    """The limits of some draws, with the deviations `columns` (draws, m) and so with bounds `lower` and `upper` (draws, channels)."""

    limits: DrawnLimits
    columns: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    def broken(self, sample: int, values: np.ndarray) -> np.ndarray:
        """(draws,) which draws, with the limited quantities (draws, channels), break a bound that some may break at a sample."""
        direct, near = self.limits.slopes.direct[sample], self.limits.near(sample)
        y = values + self.columns @ direct.T if direct.any() else values
        return np.asarray((((y < self.lower) & near[0]) | ((y > self.upper) & near[1])).any(axis=1))


def safeties(
    path: UncertainPath,
    path_margins: Margins,
    slopes: Slopes,
    drawn: Drawn | None,
    critical: np.ndarray,
    probability: float,
) -> tuple[Safety, ...]:
    """Each bound of each limit where it is least safe; `critical` (2, channels) are the samples of the draws."""
    z = float(scipy.special.ndtri(probability))
    least, rows = path_margins.least(z), []
    places = [limit.name for limit, _ in path.channels]
    for limit in path.limits:
        columns = [i for i, name in enumerate(places) if name == limit.name]
        for side in (0, 1):
            i = min(columns, key=lambda i: least[side, critical[side, i], i])
            if not np.isfinite(path_margins.bounds[side, i]):
                continue
            k = int(critical[side, i])
            margin, sd = float(path_margins.margin[side, k, i]), float(path_margins.sd[side, k, i])
            bound = float(path_margins.bounds[side, i])
            rows.append(
                Safety(
                    limit,
                    channel=limit.channels[i - columns[0]],
                    side="lower" if side == 0 else "upper",
                    sample=k,
                    bound=bound,
                    margin=margin,
                    sd=sd,
                    kept=margin - z * sd,
                    probability=float(scipy.special.ndtr(margin / sd)) if sd else float(margin >= 0),
                    drawn=_drawn_margin(drawn, slopes, side, k, i, bound, probability),
                )
            )
    return tuple(rows)


def _drawn_margin(
    drawn: Drawn | None, slopes: Slopes, side: int, k: int, i: int, bound: float, probability: float
) -> float | None:
    """The margin that is exceeded with the `probability` in the draws."""
    if drawn is None or len(drawn.columns) * (1 - probability) < LEAST_TAIL:
        return None
    y = drawn.limits[:, side, i] + drawn.columns @ slopes.direct[k, i]
    b = bound + drawn.columns @ (slopes.lower if side == 0 else slopes.upper)[i]
    return float(np.quantile(y - b if side == 0 else b - y, 1 - probability))


def critical_samples(path_margins: Margins, probability: float) -> np.ndarray:
    """(2, channels) the sample at which each limited quantity is nearest to its lower and to its upper bound, at the `probability`."""
    return np.asarray(np.argmin(path_margins.least(float(scipy.special.ndtri(probability))), axis=1))
