"""Along the drives: after which changes of a drive what is left repeats, as it does where a converter gives it in steps.

With g the readings' answer to an impulse of a drive, what is left r correlates with the answer to any function f of that drive as the
correlation b of r with g does with f itself: one spectrum of b over the drive tells all steps at once.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ctrlgen.devices import InertialPhysics
from ctrlgen.diagnosis.selection.spatial_periods import spatial_periods
from ctrlgen.diagnosis.settings import SPATIAL_PERIODS
from ctrlgen.effects import Place
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.hypothesis import nominal_physics
from ctrlgen.model.effect_terms import channels
from ctrlgen.recordings.recording import Record


def steps_of_drives(fitter: Fitter, fit: Fit, record: Record) -> dict[tuple[Place, int], dict[str, tuple[float, ...]]]:
    """Of each drive the changes [SI] after which what a fit leaves of a record repeats; none of a loop, whose drives are not recorded, nor
    of an imposed motion."""
    physics = nominal_physics(fit.structure.device)
    many = channels(physics, Place.DRIVE)
    if len(many) != record.drive.shape[1] or (isinstance(physics, InertialPhysics) and physics.feedback is not None):
        return {}
    simulator = fitter.simulator(fit.structure, record)
    start, foreseen = fitter.begun(fit, record)
    white = np.where(record.valid, record.observed - foreseen, 0.0) / fitter.noise.sd
    found = {}
    for j, channel in enumerate(many):
        kicked = record.drive.copy()
        first = len(kicked) // 4
        kicked[first, j] += SPATIAL_PERIODS.kick * channel.scale
        answer = simulator.simulate(replace(record, drive=kicked), fit.theta, start) - foreseen
        answer = answer[first:] / fitter.noise.sd
        if not np.all(np.isfinite(answer)) or not np.any(answer):
            continue
        n = 2 * len(white)
        # the correlation with the answer, of all readings
        spectra = np.fft.rfft(np.nan_to_num(white), n, axis=0) * np.conj(np.fft.rfft(answer, n, axis=0))
        pushed = np.fft.irfft(np.sum(spectra, axis=1), n)[: len(white)]
        found[Place.DRIVE, j] = {"drive_levels": spatial_periods(record.drive[:, j], pushed)}
    return found
