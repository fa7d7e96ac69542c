"""Unmodelled dynamics: the unknown input that would explain the residual, and what it depends on.

Dependence maps show the estimated input against position, velocity, time and temperature, and against position for
forward and backward motion apart.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ctrlgen.core.units import difference
from ctrlgen.diagnosis.evidence.ltv_linearisation import LtvModel
from ctrlgen.diagnosis.evidence.residual_localisation import equivalent_inputs
from ctrlgen.diagnosis.evidence.unknown_input import UnknownInput, estimate_unknown_input
from ctrlgen.diagnosis.settings import MAPS
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.settings import STATISTICS


@dataclass(frozen=True)
class DependenceMap:
    """Mean of the unknown input [value_unit] in bins of one coordinate [unit], with 95 % intervals.

    variance_share: share of the input's variance that the bin means explain.
    """

    coordinate: str
    unit: str
    centres: tuple[float, ...]
    mean: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    value_unit: str
    variance_share: float


@dataclass(frozen=True, eq=False)
class UnmodelledForce:
    """The unknown input of each axis: kind, rms [unit], dependence maps, statements, estimates by record."""

    quantity: str
    rms: dict[str, float]
    unit: str
    maps: dict[str, tuple[DependenceMap, ...]]
    statements: tuple[str, ...]
    estimates: tuple[UnknownInput, ...]


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
    loudest = sorted(range(len(axes)), key=lambda i: -_rms(estimates, i) / max(_sd(estimates, i), 1e-300))[
        : MAPS.most_axes
    ]
    statements = [_statement(axis, maps[axis]) for axis in (axes[i] for i in loudest)]
    return UnmodelledForce(
        models[0].place.value, rms, units[0], maps, tuple(s for s in statements if s), tuple(estimates)
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
    rows = [("position", travel, d, everywhere)]
    if not settled:
        direction = np.concatenate([e.model.direction()[: len(e.f), i] for e in estimates])
        rows += [
            ("position, forward", travel, d, direction > 0), ("position, backward", travel, d, direction < 0),
            ("velocity", f"{travel}/s", joined("velocity"), everywhere),
            ("time", "s", np.concatenate([e.model.record.time[: len(e.f)] for e in estimates]), everywhere),
        ]  # fmt: skip
    ambient = [a[: len(e.f)] for e in estimates if (a := e.model.record.ambient) is not None]
    if len(ambient) == len(estimates):
        T = np.concatenate(ambient)
        rows += [("temperature", "K", T, everywhere)] if np.ptp(T) > 0 else []
    return tuple(_map(name, u, x[mask], f[mask], sd[mask], unit) for name, u, x, mask in rows if mask.sum() > MAPS.bins)


def _map(name: str, unit: str, x: np.ndarray, f: np.ndarray, sd: np.ndarray, value_unit: str) -> DependenceMap:
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
        m, s = (
            float(f[inside].mean()),
            float(sd[inside].mean()),
        )  # neighbouring errors are correlated: averaging does not reduce them
        at.append(float(difference(x[inside].mean(), unit)))
        for values, value in ((mean, m), (low, m - STATISTICS.z_95 * s), (high, m + STATISTICS.z_95 * s)):
            values.append(float(difference(value, value_unit)))
    total = float(np.sum((f - f.mean()) ** 2))
    share = 1 - within / total if total else 0.0
    return DependenceMap(name, unit, tuple(at), tuple(mean), tuple(low), tuple(high), value_unit, share)


def _statement(axis: str, maps: tuple[DependenceMap, ...]) -> str:
    single = [m for m in maps if "," not in m.coordinate]
    if not single:
        return ""
    best = max(single, key=lambda m: m.variance_share)
    text = f"{axis}: {best.coordinate} explains {best.variance_share:.0%} of the unknown input's variance"
    sides = {m.coordinate: m for m in maps if "," in m.coordinate}
    if len(sides) == 2:
        forward, backward = sides["position, forward"], sides["position, backward"]
        middle = min(len(forward.mean), len(backward.mean)) // 2
        a, b = forward.mean[middle], backward.mean[middle]
        text += f"; at mid travel {a:.3g} {forward.value_unit} forward, {b:.3g} {forward.value_unit} backward"
    return text
