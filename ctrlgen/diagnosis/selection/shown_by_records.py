"""What the records show of what a fit leaves, where laws begin: lines, moments, and what repeats along sensors, axes and drives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ctrlgen.core.units import same_dimension
from ctrlgen.diagnosis.selection.drive_levels import steps_of_drives
from ctrlgen.diagnosis.selection.spatial_periods import (
    jump_positions,
    merged_periods,
    resolved_way,
    slowest_periods,
    spatial_periods,
)
from ctrlgen.diagnosis.settings import SCREEN
from ctrlgen.effects import Place
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.hypothesis import PARAMETER, nominal_physics
from ctrlgen.estimation.law_prior import ACROSS
from ctrlgen.model.effect_terms import channels
from ctrlgen.numerics.spectral_peaks import highest_peaks, periodogram
from ctrlgen.recordings.recording import Record, Recording


def moments_of(recording: Recording) -> tuple[tuple[float, ...], float]:
    """The middles of equal parts of the time that the records to fit take, and the length of a part, on their clock."""
    series, records = recording.kind == "series", [r for r in recording.records if r.role == "fit"]
    ends = [(r.time[0], r.time[-1]) if series else (0.0, float(len(r.time))) for r in records] or [(0.0, 1.0)]
    begin, end = min(a for a, _ in ends), max(b for _, b in ends)
    part = (end - begin) / SCREEN.event_times
    return tuple(begin + (k + 0.5) * part for k in range(SCREEN.event_times)), part


def spectral_peaks(fitter: Fitter, fit: Fit) -> tuple[float, ...]:
    """The frequencies [Hz] of the highest peaks in the spectrum of what is left of the longest record, refined between bins."""
    records = fitter.fit_records
    if fitter.recording.kind == "poses" or not records:
        return ()
    k = int(np.argmax([r.valid.size for r in records]))
    begin = sum(r.valid.size for r in records[:k])
    residual = fit.residual[begin : begin + records[k].valid.size].reshape(records[k].valid.shape)
    power = np.sum(periodogram(residual, np.hanning(len(residual)), SCREEN.spectrum_padding), axis=1)
    best = highest_peaks(power, SCREEN.most_lines, distance=4 * SCREEN.spectrum_padding)
    return tuple(float(f) for f in np.sort(best) / (SCREEN.spectrum_padding * len(residual) * records[k].sample_time))


def shown_along_path(
    fitter: Fitter, fit: Fit, *, steps: bool, across: bool
) -> dict[tuple[Place, int], dict[str, tuple[float, ...]]]:
    """Of each sensor, the paths after which what is left of the longest record repeats, where it surely does, and the
    places at which it jumps most; of each force the ways of its axis; and where asked for, the `steps` of each drive, and of each
    sensor the paths of the others, `across` it."""
    records = fitter.fit_records
    if fitter.recording.kind == "poses" or not records:
        return {}
    record = max(records, key=lambda r: r.valid.size)
    foreseen, behind = (fitter.predict(each, record) for each in (fit, _without_sensor_causes(fit)))
    residual = record.observed - foreseen
    sensors = channels(nominal_physics(fit.structure.device), Place.SENSOR)
    names, sizes = [c.name for c in sensors], {c.name: c.scale for c in sensors}
    read = [(i, c.removeprefix("reading.")) for i, c in enumerate(fitter.recording.channels)]
    paths, units = (record.observed, foreseen, behind), fitter.recording.units

    def periods(i: int, good: np.ndarray) -> tuple[float, ...]:
        # what is read may be evenly sampled, and bent
        shortest = max(resolved_way(y[good, i]) for y in paths)
        return merged_periods(spatial_periods(y[good, i], residual[good, i], shortest) for y in paths)

    def beside(i: int, good: np.ndarray) -> dict[str, tuple[float, ...]]:
        others = [(j, name) for j, name in read if across and j != i and same_dimension(units[j], units[i])]
        seen = {name: good & record.valid[:, j] for j, name in others}
        return {
            f"{ACROSS} {name}": periods_across(record.observed[seen[name], j], residual[seen[name], i])
            for j, name in others
            if seen[name].any()
        }

    by_sensor = {
        (Place.SENSOR, names.index(name)): beside(i, good)
        | {
            "spatial_periods": (
                *periods(i, good),
                *slowest_periods(foreseen[good, i], residual[good, i], sizes[name]),
            ),
            "jump_positions": jump_positions(record.observed[good, i], residual[good, i]),
        }
        for i, name in read
        if name in names and np.any(good := record.valid[:, i] & np.isfinite(residual[:, i]))
    }
    drives = steps_of_drives(fitter, fit, record) if steps else {}
    return by_sensor | _along_axes(fitter, fit, record, residual) | drives


def periods_across(path: np.ndarray, left: np.ndarray) -> tuple[float, ...]:
    """The ways after which what is `left` of one reading (n,) repeats along that of another axis, `path` (n,): where it surely does, and
    the longest that suits it."""
    return (*spatial_periods(path, left, resolved_way(path)), *slowest_periods(path, left, np.inf))


def _along_axes(
    fitter: Fitter, fit: Fit, record: Record, residual: np.ndarray
) -> dict[tuple[Place, int], dict[str, tuple[float, ...]]]:
    """Of the force on each axis, the ways of the axis after which the residual of its own reading repeats, or of any where none
    has its name."""
    simulator = fitter.simulator(fit.structure, record)
    ways = simulator.simulate_states(record, fit.theta)[0][:, simulator.n_x :]
    names = [c.removeprefix("reading.") for c in fitter.recording.channels]
    found = {}
    for j, axis in enumerate(nominal_physics(fit.structure.device).axes):
        own = [i for i, name in enumerate(names) if name == axis] or range(len(names))
        shortest, good = resolved_way(ways[:, j]), record.valid & np.isfinite(residual)
        repeats = merged_periods(
            spatial_periods(ways[good[:, i], j], residual[good[:, i], i], shortest) for i in own if good[:, i].any()
        )
        found[Place.FORCE, j] = {"spatial_periods": repeats}
    return found


def _without_sensor_causes(fit: Fit) -> Fit:
    """The fit with every cause at a sensor off: fringes count what is there, not what they have made of it."""
    theta = fit.theta.copy()
    for k, u in enumerate(fit.structure.free_parameters):
        if not u.amplitude:
            continue
        cause = fit.structure.cause_of(u)
        if cause.effect != PARAMETER and cause.law.place is Place.SENSOR:
            theta[k] = u.nominal
    return replace(fit, theta=theta)
