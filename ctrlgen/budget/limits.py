"""How safe each limit is: its margin along the path under everything that is uncertain, at a chosen probability.

A limited quantity y with the bound b has the margin M = b - y (or y - b); to first order it is normal with sd u(M), and the limit
holds at a sample with the probability p where M - z_p u(M) > 0, z_p the quantile of the normal distribution.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Literal

import casadi as ca
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
    """How the stated numbers act on the limits themselves, by each of them changed by its standard deviation. Raises InputError for a
    number that acts on neither motion nor limits."""
    names = [name for line in path.uncertainties.lines for name in line.paths]
    kinds = [line.kind for line in path.uncertainties.lines for _ in line.paths]
    sds, n = path.uncertainties.sds, len(names)
    numbers = [i for i in range(n) if kinds[i] == "number" and not names[i].startswith("effect[")]
    channels = len(path.channels)
    slopes = Slopes(np.zeros((channels, n)), np.zeros((channels, n)), np.zeros((path.n, channels, n)))
    bounds, limited = _Bounds(path, names, sds), _limited(path)
    before, as_described, faults = bounds.stated([]), limited(bounds.p([])), list[Fault]()
    idle = [i for i in numbers if names[i] in path.idle]
    unstated = {*bounds.unstated([i for i in numbers if i not in idle]), *(i for i in idle if bounds.unstated([i]))}
    for i in numbers:
        after = bounds.built([i]) if i in unstated else bounds.stated([i])
        if not _same(after, before):
            with np.errstate(invalid="ignore"):  # what has no bound stays without
                slopes.lower[:, i], slopes.upper[:, i] = np.nan_to_num((after - before) / sds[i])
        if i not in idle:
            continue
        slopes.direct[:, :, i] = (limited(bounds.p([i])) - as_described) / sds[i]
        if not (slopes.lower[:, i].any() or slopes.upper[:, i].any() or slopes.direct[:, :, i].any()):
            faults.append(
                Fault(f'numbers."{names[i]}"', "acts on neither motion nor limits of this device; leave it out")
            )
    if faults:
        source = path.uncertainties.inputs.get("uncertainty")
        raise InputError(source.path if source else path.solution.scenario.path, faults)
    return slopes


def _same(bounds: np.ndarray, others: np.ndarray) -> bool:
    return np.allclose(bounds, others, rtol=SAME, atol=0.0)


class _Bounds:
    """The bounds (2, channels) of a path's limits where some columns, the numbers `names`, are changed by their `sds`."""

    def __init__(self, path: UncertainPath, names: list[str], sds: np.ndarray) -> None:
        self.path, self.names, self.sds = path, names, sds
        self._places = {name: k for k, name in enumerate((*path.free, *path.idle))}
        m = path.model
        formulas = {limit.name: formula for limit, formula in zip(m.limits, m.bounds_formulas, strict=True)}
        sides = [
            ca.SX(none if formulas[limit.name][side] is None else formulas[limit.name][side])
            for side, none in enumerate((-np.inf, np.inf))
            for limit, _ in path.channels
        ]
        self._formulas = ca.Function("bounds", [m.p], [ca.vertcat(ca.SX(0, 1), *sides)])
        self._values = {name: number.si for name, number in m.device.quantities()}

    def p(self, columns: Sequence[int]) -> np.ndarray:
        """The numbers of the path's model."""
        p = self.path.model.p_nominal.copy()
        for i in columns:
            p[self._places[self.names[i]]] += self.sds[i]
        return p

    def stated(self, columns: Sequence[int]) -> np.ndarray:
        """By the formulas that a device may state of its bounds."""
        return np.asarray(self._formulas(self.p(columns)).full().reshape(2, -1))

    @lru_cache  # noqa: B019 - lives as long as one table of slopes
    def _of(self, columns: tuple[int, ...]) -> np.ndarray:
        described = {self.names[i]: self._values.get(self.names[i], 0.0) + self.sds[i] for i in columns}
        return _bounds(self.path, build_model(changed(self.path.model.device, described)))

    def built(self, columns: Sequence[int]) -> np.ndarray:
        """By a device with those numbers, which takes its time: its bounds may follow numbers without a formula."""
        return self._of(tuple(columns))

    def unstated(self, columns: Sequence[int]) -> list[int]:
        """Those of the columns which change bounds otherwise than by a formula, by halving."""
        if not columns or _same(self.built(columns), self.stated(columns)):
            return []
        if len(columns) == 1:
            return list(columns)
        middle = len(columns) // 2
        return self.unstated(columns[:middle]) + self.unstated(columns[middle:])


def _bounds(path: UncertainPath, model: Model) -> np.ndarray:
    """The lower and upper bounds (2, channels) of a `model`; infinite where there is none."""
    by_name = {limit.name: limit for limit in model.limits}
    limits = [by_name[limit.name] for limit, _ in path.channels]
    return np.array([limit.bounds for limit in limits]).reshape(-1, 2).T


def _limited(path: UncertainPath) -> Callable[[np.ndarray], np.ndarray]:
    """p -> the limited quantities (n, channels) at the path's states, of a device with those of these numbers that act on limits alone."""
    m, n, free, trace, drive = path.model, path.n, len(path.free), path.solution.trace, path.drive[path.before :]
    y = ca.vertcat(ca.SX(0, 1), *(limit.expr for limit in path.limits))
    y = ca.substitute(y, path.q, path.q_nominal)
    along = ca.Function("limited", [m.x, m.z, m.u, path.p_idle], [ca.densify(y)], {"cse": True}).map(n)
    return lambda p: along(trace.x.T, trace.z.T, drive.T, np.tile(p[free:, None], (1, n))).full().T


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
