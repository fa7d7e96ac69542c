"""How far a recorded drive is off its time stamps, within what they are good for: a number of the recording, not of the device.

A drive that is stamped one instruction late, or that a converter holds for a part of a sample, moves under the readings by a hundredth
of a sample. Under a smooth drive a stage hides that in its damping; where a force has a corner it bends the place and the size of what
is touched. With the drive of all records at t + tau, tau ~ N(0, (`STAMPS` h)^2), h the sample time,

    tau = argmin |r + J dp + c (tau - tau_0)|^2 + (tau / (STAMPS h))^2,

r the whitened residual of a fit with the drive at tau_0, J and c its derivatives by all free numbers and by tau.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ctrlgen.estimation.error_model import huber
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.held_out import refit_to_held_out
from ctrlgen.estimation.integration_error import with_steps_that_suffice
from ctrlgen.estimation.least_squares import whiten_residual
from ctrlgen.estimation.moved_drive import with_drive_at
from ctrlgen.estimation.settings import HELD_OUT_REFIT
from ctrlgen.recordings.recording import Recording

# Standard deviation of a time stamp over the sample time: what settles and jitters between the stamp of a row and its converters is stated
# in per cents of the shortest sample; judgement.
STAMPS = 0.01
FARTHEST = 3.0  # standard deviations of a stamp: what is farther off is late, or from two recorders, and has a name
TOLD = 2.0  # standard deviations of a stamp, from which on a reader should look at his recorder
CERTAIN = 5.0  # standard deviations of the estimate: any law that is missing moves with the drive; judgement
# Share of the squares that are left, in the records to fit as in those held out, that a clock must take away: it is more than what
# another fit of the same model takes by luck, and less does no harm. Judgement.
LEAST_GAIN = 0.1
MOST_UPDATES = 4  # of the clock with the numbers beside it: a corner bends what one step foretells; judgement


class DriveClock(NamedTuple):
    """tau [s] and the standard deviation `sd` of the estimate, beside all free numbers; `stamps` that of a stamp."""

    tau: float
    sd: float
    stamps: float

    def off(self, tau: float) -> float:
        """How far this is from `tau` [s], in deviations of the estimate; 0 where no stamp is so far off."""
        return abs(self.tau - tau) / self.sd if abs(self.tau) < FARTHEST * self.stamps else 0.0


def with_drive_clock(fitter: Fitter, fit: Fit) -> tuple[Fitter, Fit]:
    """The same fit with the clock of the drive, which its records to fit tell and those held out confirm; as given where they do not.

    Raises the errors of a simulation.
    """
    moved, best, least = fitter, fit, max(CERTAIN, (LEAST_GAIN * fit.chi2) ** 0.5)
    for _ in range(MOST_UPDATES):
        clock = drive_clock(moved, best)
        # its square is what the objective falls by
        if clock is None or clock.off(moved.clock) <= least:
            break
        first, least = moved is fitter, 1.0
        moved = moved.with_clock(clock.tau)
        best = moved.fit(best.restarted)
        # beside less that is left, errors count that did not before
        moved = moved.with_errors_of(best)
        best = moved.fit(with_steps_that_suffice(moved, best))
        if first and _left(moved, best) > (1 - LEAST_GAIN) * _left(fitter, fit):
            return fitter, fit
    return moved, best


def _left(fitter: Fitter, fit: Fit) -> float:
    """Squares of the held-out records, whatever numbers they tell that the records to fit leave open."""
    refit = refit_to_held_out(fitter, fit, HELD_OUT_REFIT.max_steps)
    return fitter.held_out_squares(refit.fit) + refit.penalty


def stamp_deviation(recording: Recording) -> float:
    """Standard deviation [s] of the time stamps of a recording, by its shortest sample time."""
    return STAMPS * min(r.sample_time for r in recording.records)


def drive_clock(fitter: Fitter, fit: Fit) -> DriveClock | None:
    """The clock of the drive by one Gauss-Newton step from `fitter.clock`; None of poses, or where a cause of the fit says when the drive
    or a reading comes.

    Raises the errors of a simulation.
    """
    records = fitter.fit_records
    timed = any(c.shifts for c in fit.structure.causes)
    if timed or fitter.recording.kind == "poses" or not all(np.isfinite(r.sample_time) for r in records):
        return None
    stamps = stamp_deviation(fitter.recording)
    rows = []
    for k, record in enumerate(records):
        simulator = fitter.simulator(fit.structure, record)
        start = fit.initial_states[k] if fit.initial_states else None
        y = simulator.simulate(record, fit.theta, start)
        late, early = (simulator.simulate(with_drive_at(record, s * stamps), fit.theta, start) for s in (-1, 1))
        slope = fitter.error.whiten((early - late) / (2 * stamps), record.valid)
        weight = huber(whiten_residual(fitter.error, record, y), fitter.error.corner)[1]
        rows.append(-(slope * weight).ravel())
    c = np.nan_to_num(np.concatenate([*rows, np.zeros(len(fit.residual) - sum(map(len, rows)))]))
    scale = np.linalg.norm(fit.J, axis=0)
    others = np.linalg.svd(fit.J / np.where(scale > 0, scale, 1.0), full_matrices=False)
    Q = others[0][:, others[1] > 1e-12 * others[1].max(initial=0.0)]
    c -= Q @ (Q.T @ c)
    information = float(c @ c) + 1 / stamps**2
    step = -(float(c @ fit.residual) + fitter.clock / stamps**2) / information
    return DriveClock(fitter.clock + step, information**-0.5, stamps)
