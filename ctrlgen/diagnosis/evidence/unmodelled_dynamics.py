"""Unmodelled dynamics: the unknown input that would explain the residual, and what it depends on.

Dependence maps show the estimated input against position, velocity, time and temperature, and against position for
forward and backward motion apart.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ctrlgen.core.percent import percent
from ctrlgen.core.units import difference
from ctrlgen.diagnosis.evidence.ltv_linearisation import LtvModel
from ctrlgen.diagnosis.evidence.residual_localisation import equivalent_inputs
from ctrlgen.diagnosis.evidence.residual_location import FIGURE_WIDTH, UnmodelledForceEntry
from ctrlgen.diagnosis.evidence.unknown_input import UnknownInput, estimate_unknown_input
from ctrlgen.diagnosis.settings import MAPS
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.settings import STATISTICS
from ctrlgen.reporting.plots import COLOURS

# dependence maps that are drawn
PANELS = 6
# share of the variance: maps that explain less are not drawn
SHOWN_SHARE = 0.01


class Coordinate(StrEnum):
    """What the unknown input may depend on."""

    POSITION = "position"
    FORWARD = "position, forward"
    BACKWARD = "position, backward"
    VELOCITY = "velocity"
    TIME = "time"
    TEMPERATURE = "temperature"


# of some samples alone
ONE_SIDED = (Coordinate.FORWARD, Coordinate.BACKWARD)


@dataclass(frozen=True)
class DependenceMap:
    """Mean of the unknown input [value_unit] in bins of one coordinate [unit], with 95 % intervals.

    variance_share: share of the input's variance that the bin means explain.
    """

    coordinate: Coordinate
    unit: str
    centres: tuple[float, ...]
    mean: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    value_unit: str
    variance_share: float


@dataclass(frozen=True, eq=False)
class UnmodelledForce:
    """The unknown input of each axis: where it acts, rms [unit] and dependence maps by axis, the axes by falling input in standard
    deviations, and its estimates, one a record."""

    quantity: str
    rms: dict[str, float]
    unit: str
    maps: dict[str, tuple[DependenceMap, ...]]
    loudest: tuple[str, ...]
    estimates: tuple[UnknownInput, ...]

    def sentences(self) -> list[str]:
        """What the input depends on at the axes where it is largest: it describes the residual and names no cause."""
        return [_statement(axis, self.maps[axis]) for axis in self.loudest[: MAPS.most_axes] if self.maps[axis]]

    def record(self) -> UnmodelledForceEntry:
        """The entry of the unknown input in diagnosis.json."""
        return UnmodelledForceEntry(statements=self.sentences())

    def figures(self) -> dict[str, Figure]:
        """The figure 'unknown': the input over what explains it best; none where nothing does."""
        maps = [(axis, m) for axis, several in self.maps.items() for m in several if m.variance_share >= SHOWN_SHARE]
        maps = sorted(maps, key=lambda row: -row[1].variance_share)[:PANELS]
        if not maps:
            return {}
        rows = -(-len(maps) // 2)
        figure, axes = plt.subplots(rows, 2, figsize=(FIGURE_WIDTH, 0.4 + 2.1 * rows), squeeze=False)
        for panel, (axis, m) in zip(axes.flat, maps, strict=False):
            _draw(panel, f"{self.quantity} at {axis}", m)
        for panel in axes.flat[len(maps) :]:
            panel.set_visible(False)
        return {"unknown": figure}


def describe_unmodelled_force(fitter: Fitter, models: list[LtvModel]) -> UnmodelledForce:
    """The unknown input for the residual of a fit; `models` are its LTV models, the records to fit first.

    Raises ArithmeticError where it has no finite estimate.
    """
    to_fit = [a for a in models if a.record.role == "fit"]
    size = np.sqrt(np.mean(np.concatenate([equivalent_inputs(a)[0] for a in to_fit]) ** 2, axis=0))
    estimates = [
        estimate_unknown_input(a, fitter.noise, np.maximum(size, 1e-12 * size.max(initial=1e-300))) for a in to_fit
    ]
    if not all(np.isfinite(e.f).all() and np.isfinite(e.sd).all() for e in estimates):
        raise ArithmeticError("it grows without bound along the motion")
    axes, units = models[0].axes, models[0].units
    rms = {axis: float(difference(_rms(estimates, i), units[i])) for i, axis in enumerate(axes)}
    maps = {axis: _maps(estimates, i) for i, axis in enumerate(axes)}
    loudest = sorted(range(len(axes)), key=lambda i: -_rms(estimates, i) / max(_sd(estimates, i), 1e-300))
    return UnmodelledForce(
        models[0].place.value, rms, units[0], maps, tuple(axes[i] for i in loudest), tuple(estimates)
    )


def _rms(estimates: list[UnknownInput], i: int) -> float:
    return float(np.sqrt(np.mean(np.concatenate([e.f[:, i] for e in estimates]) ** 2)))


def _sd(estimates: list[UnknownInput], i: int) -> float:
    return float(np.mean(np.concatenate([e.sd[:, i] for e in estimates])))


def _maps(estimates: list[UnknownInput], i: int) -> tuple[DependenceMap, ...]:
    """Dependence maps of the input of axis `i`."""
    f, sd = np.concatenate([e.f[:, i] for e in estimates]), np.concatenate([e.sd[:, i] for e in estimates])

    def joined(name: str) -> np.ndarray:
        return np.concatenate([getattr(e.model, name)[: len(e.f), i] for e in estimates])

    unit, travel, settled = estimates[0].model.units[i], estimates[0].model.travel_unit, estimates[0].model.poses
    d, everywhere = joined("displacement"), np.ones(len(f), bool)
    rows = [(Coordinate.POSITION, travel, d, everywhere)]
    if not settled:
        direction = np.concatenate([e.model.direction()[: len(e.f), i] for e in estimates])
        rows += [
            (Coordinate.FORWARD, travel, d, direction > 0),
            (Coordinate.BACKWARD, travel, d, direction < 0),
            (Coordinate.VELOCITY, f"{travel}/s", joined("velocity"), everywhere),
            (Coordinate.TIME, "s", np.concatenate([e.model.record.time[: len(e.f)] for e in estimates]), everywhere),
        ]
    ambient = [a[: len(e.f)] for e in estimates if (a := e.model.record.ambient) is not None]
    if len(ambient) == len(estimates):
        T = np.concatenate(ambient)
        rows += [(Coordinate.TEMPERATURE, "K", T, everywhere)] if np.ptp(T) > 0 else []
    return tuple(_map(name, u, x[mask], f[mask], sd[mask], unit) for name, u, x, mask in rows if mask.sum() > MAPS.bins)


def _map(
    coordinate: Coordinate, unit: str, x: np.ndarray, f: np.ndarray, sd: np.ndarray, value_unit: str
) -> DependenceMap:
    edges = np.linspace(x.min(), x.max(), MAPS.bins + 1)
    which = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, MAPS.bins - 1)
    at: list[float] = []
    mean: list[float] = []
    low: list[float] = []
    high: list[float] = []
    within = 0.0
    for k in range(MAPS.bins):
        inside = which == k
        within += float(np.sum((f[inside] - f[inside].mean()) ** 2)) if inside.any() else 0.0
        if inside.sum() < min(MAPS.fewest_samples, max(len(x) // MAPS.bins, 1)):
            continue
        # neighbouring errors are correlated: averaging does not reduce them
        m, s = float(f[inside].mean()), float(sd[inside].mean())
        at.append(float(difference(x[inside].mean(), unit)))
        for values, value in ((mean, m), (low, m - STATISTICS.z_95 * s), (high, m + STATISTICS.z_95 * s)):
            values.append(float(difference(value, value_unit)))
    total = float(np.sum((f - f.mean()) ** 2))
    share = 1 - within / total if total else 0.0
    return DependenceMap(coordinate, unit, tuple(at), tuple(mean), tuple(low), tuple(high), value_unit, share)


def _statement(axis: str, maps: tuple[DependenceMap, ...]) -> str:
    """What the input of one axis depends on; its maps are those of `_maps`, of which the position comes first."""
    single = [m for m in maps if m.coordinate not in ONE_SIDED]
    best = max(single, key=lambda m: m.variance_share)
    text = f"{axis}: {best.coordinate} explains {percent(best.variance_share)} of the unknown input's variance"
    sides = {m.coordinate: m for m in maps if m.coordinate in ONE_SIDED}
    if len(sides) == 2:
        forward, backward = (sides[side] for side in ONE_SIDED)
        middle = min(len(forward.mean), len(backward.mean)) // 2
        a, b = forward.mean[middle], backward.mean[middle]
        text += f"; at mid travel {a:.3g} {forward.value_unit} forward, {b:.3g} {forward.value_unit} backward"
    return text


def _draw(panel: Axes, title: str, m: DependenceMap) -> None:
    panel.fill_between(m.centres, m.low, m.high, color=COLOURS[0], alpha=0.25, lw=0)
    panel.plot(m.centres, m.mean, "o-", ms=3, lw=1, color=COLOURS[0])
    panel.set_xlabel(f"{m.coordinate} [{m.unit}]")
    panel.set_ylabel(f"[{m.value_unit}]")
    panel.locator_params("x", nbins=5)
    panel.set_title(f"{title}, {100 * m.variance_share:.0f} % of its variance", fontsize=8.5)
