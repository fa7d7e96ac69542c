"""What the steps of the integrator miss in the readings, by steps of half the length, and how many steps make that small.

A force with a corner, such as that of a stop, is right to second order in the length of a step: with half of it a quarter of the error
is left, so that the readings of both differ by three quarters of it (E. Hairer, S. Norsett, G. Wanner, Solving Ordinary
Differential Equations I (1993), II.4).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.structure import Structure

ORDER = 2  # of the error in the length of a step, where a force has a corner
# Error of the steps over what else is left, noise at least, that the accepted model may have: it adds a hundredth to the squares.
LARGEST = 0.1
MOST_FINER = 8  # times the integrator's own steps that it may take for that: a sixty-fourth of the error; judgement
MOST_IN_SEARCH = (
    2  # while causes are sought, of which each trial then takes twice as long: a quarter of the error; judgement
)


def integration_error(fitter: Fitter, fit: Fit) -> float:
    """The error of the readings by the steps of the integrator: its root mean square over what else is left of a channel in a record,
    noise at least; the largest of all channels and records. 0 where there are no steps.

    Raises the errors of a simulation.
    """
    largest, halved = 0.0, replace(fit.structure, finer=2 * fit.structure.finer)
    for record in (*fitter.fit_records, *fitter.held_out_records):
        if not fitter.simulator(fit.structure, record).model.inertial:
            continue
        start, y = fitter.begun(fit, record)
        apart = fitter.simulator(halved, record).simulate(record, fit.theta, start) - y
        for missed, left, seen, noise in zip(
            apart.T, (record.observed - y).T, record.valid.T, fitter.noise.floor, strict=True
        ):
            if seen.any():
                beside = max(float(np.std(left[seen])), float(noise))
                largest = max(largest, float(np.sqrt(np.mean(missed[seen] ** 2))) / beside)
    return largest / (1 - 0.5**ORDER)


def with_steps_that_suffice(fitter: Fitter, fit: Fit, most: int = MOST_FINER) -> Structure:
    """The fitted structure, restarted, with as many steps as make their error a small share of what else is left, `most` times the
    integrator's own at most."""
    error = integration_error(fitter, fit)
    finer = fit.structure.finer
    while error > LARGEST and finer < most:
        finer, error = 2 * finer, error / 2**ORDER
    return replace(fit.restarted, finer=finer)
