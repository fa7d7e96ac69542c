"""Which stated masses include the part of them that rings: who states the inertia of a whole, such as rotor and mirror, is right."""

from __future__ import annotations

import numpy as np

from ctrlgen.core.units import same_dimension
from ctrlgen.diagnosis.settings import VERDICT
from ctrlgen.estimation.fit import Fit
from ctrlgen.estimation.hypothesis import PARAMETER
from ctrlgen.estimation.settings import STATISTICS


def ringing_masses(fit: Fit) -> dict[str, float]:
    """The part [SI] that rings of each number of the device that the fit moved far, to less by what a cause adds to the moving mass
    (`Effect.inertia`), within its 95 % interval and the stated deviation; by path."""
    found, free = {}, fit.structure.free_parameters
    moves = {i: float(v) - u.nominal for i, (u, v) in enumerate(zip(free, fit.theta, strict=True)) if u.sd}
    far = {i: by for i, by in moves.items() if abs(by) >= VERDICT.far * (free[i].sd or 0.0)}
    for k, cause in enumerate(fit.structure.causes if far else ()):
        size = next((u for u in free if u.cause == k and u.amplitude), None)
        if cause.effect == PARAMETER or size is None or (added := cause.law.inertia(fit.values(k))) is None:
            continue
        unit = f"({size.unit})*s^2"
        for i, moved in far.items():
            if not same_dimension(free[i].unit, unit):
                continue
            by = _slopes(fit, k)
            by[i] += 1.0
            if abs(moved + added) < STATISTICS.z_95 * np.hypot(np.sqrt(by @ fit.covariance @ by), free[i].sd or 0.0):
                found[free[i].path] = added
    return found


def _slopes(fit: Fit, k: int) -> np.ndarray:
    """By how much the mass that cause k adds changes with each number of the fit."""
    law, values, slopes = fit.structure.causes[k].law, fit.values(k), np.zeros(len(fit.theta))
    for i, u in enumerate(fit.structure.free_parameters):
        step = 1e-4 * abs(float(fit.theta[i]))
        if u.cause == k and step:
            more, less = (law.inertia(values | {u.name: float(fit.theta[i]) + way}) or 0.0 for way in (step, -step))
            slopes[i] = (more - less) / (2 * step)
    return slopes
