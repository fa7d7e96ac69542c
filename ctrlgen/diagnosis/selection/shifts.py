"""By how much a reading comes late, or a drive early, to begin with: shifts of what a fit predicts, without simulating it again."""

from __future__ import annotations

import numpy as np

from ctrlgen.devices import Device
from ctrlgen.diagnosis.settings import SEARCH
from ctrlgen.effects import Effect, Place, means
from ctrlgen.estimation.error_model import huber
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.free_parameters import suspected_range
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis, nominal_physics, numbers
from ctrlgen.estimation.least_squares import limited
from ctrlgen.model.effect_terms import channels
from ctrlgen.recordings.recording import Record


def shifts_tried(h: float, low: float, high: float) -> np.ndarray:
    """Every sample of h [s], farther apart the longer they are, up to `SEARCH.longest_shift` either way; one at least."""
    shifts = [1]
    while (further := shifts[-1] + max(1, shifts[-1] // SEARCH.shift_share)) <= SEARCH.longest_shift:
        shifts.append(further)
    tried = h * np.array([*(-s for s in reversed(shifts)), *shifts], float)
    within = tried[(tried >= low) & (tried <= high)]
    return within if len(within) else np.array([min(max(h, low), high)])


def best_shift(
    fitter: Fitter, fit: Fit, cause: Hypothesis, h: float, already: float = 0.0
) -> tuple[dict[str, float], float]:
    """Where a fit of `cause` begins, at the shift of `shifts_tried` that leaves least of the residual of `fit` on the records to fit, and
    by how much it promises to lower the objective: what it takes away with all numbers as they are or, of a shift too short for that,
    with them refitted,

        (s_perp'r)^2/|s_perp|^2,  s_perp = s - J (J'J)^-1 J's,

    s the whitened slope of the readings by the shift.

    Exact for what `fit` predicts where nothing but the signal's own time is shifted; a start, not an estimate. `fit` has shifted what
    the cause does by `already` [s].
    """
    device = fit.structure.device
    name, (low, now, high), early = _range(cause, device, already)
    shifts = shifts_tried(h, low - now, high - now)
    moved = {
        f"reading.{c.name}" for c in channels(nominal_physics(device), Place.SENSOR) if means(cause.at, c.name, c.unit)
    }
    rows = [i for i, channel in enumerate(fitter.recording.channels) if channel in moved]
    late = np.concatenate([[0.0], -shifts if early else shifts])
    left, slopes = np.zeros(len(late)), []
    for k, record in enumerate(fitter.fit_records):
        start = fit.initial_states[k] if fit.initial_states else None
        y = fitter.simulator(fit.structure, record).simulate(record, fit.theta, start)
        left += _left(fitter, record, y, list(rows), late)
        slopes.append(_slope(fitter, record, y, list(rows)))
    best = 1 + int(np.argmin(left[1:]))
    return {name: now + float(shifts[best - 1])}, max(
        float(left[0] - left[best]), _promised(fit, np.concatenate(slopes))
    )


def _range(cause: Hypothesis, device: Device, already: float) -> tuple[str, tuple[float, float, float], bool]:
    """The name of the number of a cause that shifts in time, its lowest value, that before and the highest [s], and whether it is by how
    much readings come early."""
    if cause.effect != PARAMETER:
        p = cause.law.amplitude()
        low, high = cause.bounds(p, cause.channel_on(device))
        return p.name, (low, already, high), cause.law.shifts_drive
    law, number = next((owner, number) for path, owner, number in numbers(device) if path == cause.path)
    low, high = suspected_range(cause, number, abs(number.si))
    return "value", (low, number.si, high), isinstance(law, Effect) and law.shifts_drive


def _slope(fitter: Fitter, record: Record, y: np.ndarray, rows: list[int]) -> np.ndarray:
    """The whitened slope (n n_y,) of the readings by how late those of `rows` come [s]."""
    slope = np.zeros_like(y)
    slope[:, rows] = -np.gradient(y[:, rows], record.time, axis=0)
    return fitter.error.whiten(np.where(record.valid, slope, 0.0), record.valid).ravel()


def _promised(fit: Fit, slope: np.ndarray) -> float:
    """By how much one more number with the whitened `slope` (n,) would lower the objective of a fit, all others refitted."""
    scale = np.linalg.norm(fit.J, axis=0)
    scale[scale == 0] = 1.0
    J = fit.J / scale
    along = np.linalg.lstsq(J.T @ J, J[: len(slope)].T @ slope, rcond=None)[0]
    distinct = -J @ along
    distinct[: len(slope)] += slope
    size = float(distinct @ distinct)
    return float(distinct @ fit.residual) ** 2 / size if size > 0 else 0.0


def _left(fitter: Fitter, record: Record, y: np.ndarray, rows: list[int], late: np.ndarray) -> np.ndarray:
    """The loss (m,) on one record with the readings `rows` of y (n, n_y) `late` (m,) [s]; what was before the record, or after it,
    counts like the mean of the rest."""
    n, t = len(y), record.time
    residual = np.zeros((n, len(rows), len(late)))
    known = np.zeros((n, len(late)), bool)
    for j, tau in enumerate(late):
        at = t - tau
        known[:, j] = (at >= t[0]) & (at <= t[-1])
        for place, row in enumerate(rows):
            residual[:, place, j] = record.observed[:, row] - np.interp(at, t, y[:, row])
    errors, valid = fitter.error, record.valid[:, rows]
    residual = np.where(valid[:, :, None], residual, 0.0)
    white = np.zeros_like(residual)
    for place, row in enumerate(rows):
        filtered = errors.whiten_channel(residual[:, place], row)
        white[n - len(filtered) :, place] = limited(filtered)
    white[~errors.usable(record.valid)[:, rows]] = 0.0
    loss = np.array([huber(white[:, :, j], errors.corner[rows])[0] ** 2 for j in range(len(late))])
    inside = known.T[:, :, None]
    share = np.maximum(known.mean(axis=0), 1 / n)
    return np.sum(np.where(inside, loss, 0.0), axis=(1, 2)) / share
