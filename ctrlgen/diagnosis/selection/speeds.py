"""How fast the axes move in the records: what bounds of laws that act with speed count in.

A stroke and a second make no speed: a fan turns through thousands of radians that it needs a minute for, a resonator crosses its stroke
ten thousand times a second. Force over the speed that occurs is as much as a damper can be.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ctrlgen.devices import Device, ImposedPhysics
from ctrlgen.diagnosis.selection.candidate_terms import signals_along
from ctrlgen.effects import Place
from ctrlgen.estimation.described_device import described
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis, nominal_physics

# Share of the motion foretold that is read, below which the reading is taken to be dead and not the motion small: judgement
LEAST_SHARE = 1e-3
MOST_OF_MOTION = (0.02, 0.98)  # quantiles between which a reading moves, whatever its spikes


def counted_in_speeds(suspected: Sequence[Hypothesis], fitter: Fitter, device: Device) -> list[Hypothesis]:
    """The hypotheses, those of laws that act with speed with the time in which their bounds count: typical displacement over the speed of
    the slowest axis of theirs that moves."""
    acting = [h for h in suspected if h.effect != PARAMETER and any(p.of_motion for p in h.law.params)]
    if fitter.recording.kind == "poses" or not acting:
        return list(suspected)
    fitter, fit = described(fitter, device)
    speeds, physics = speeds_that_occur(fitter, fit), nominal_physics(device)

    def counted(h: Hypothesis) -> Hypothesis:
        axes = [*h.acts_on(device), *(i for i, axis in enumerate(physics.axes) if axis == h.of)]
        moving = [speeds[i] for i in axes if speeds[i] > 0] if h.law.place in (Place.FORCE, Place.DRIVE) else []
        return replace(h, time=physics.displacement_scale / min(moving)) if moving else h

    return [counted(h) if h in acting else h for h in suspected]


def speeds_that_occur(fitter: Fitter, fit: Fit) -> np.ndarray:
    """The largest speeds (n_axes,) in the records to fit [SI], zero where nothing tells them: those of a motion that is imposed; else those
    that `fit` foretells, smaller as the readings move less than it foretells, as where it lacks a brake."""
    physics, along = nominal_physics(fit.structure.device), signals_along(fitter, fit)
    speeds = np.array([max(np.abs(s[Place.FORCE, i][2]).max() for s in along) for i in range(len(physics.axes))])
    return speeds if isinstance(physics, ImposedPhysics) else speeds * _share_read(fitter, fit)


def _share_read(fitter: Fitter, fit: Fit) -> float:
    """How far the readings move over how far `fit` foretells, in the median of them; one where they move farther, as noise does."""
    shares = []
    foretold = [fitter.predict(fit, r) for r in fitter.fit_records]
    for i in range(len(fitter.recording.channels)):
        pairs = [
            (r.observed[good, i], y[good, i])
            for r, y in zip(fitter.fit_records, foretold, strict=True)
            if (good := r.valid[:, i] & np.isfinite(y[:, i])).any()
        ]
        if pairs:
            read, expected = (
                max(np.ptp(np.quantile(x, MOST_OF_MOTION)) for x in each) for each in zip(*pairs, strict=True)
            )
            shares += [read / expected] if expected > 0 else []
    return float(np.clip(np.median(shares), LEAST_SHARE, 1.0)) if shares else 1.0
