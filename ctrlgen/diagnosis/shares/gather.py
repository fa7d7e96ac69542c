"""Residuals and signals of a fit: what `model_free_shares` takes, from the model simulated along each record."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ctrlgen.core.units import difference
from ctrlgen.diagnosis.estimation.fit import Fit, Fitter
from ctrlgen.diagnosis.shares.regressors import Signals
from ctrlgen.diagnosis.shares.result import SharesTable
from ctrlgen.diagnosis.shares.shares import model_free_shares
from ctrlgen.recordings.recording import Record


def fit_shares(fitter: Fitter, fit: Fit, records: Sequence[Record] | None = None, seed: int = 0) -> SharesTable:
    """The model-free shares of what a fit leaves of `records`, by default of those to fit and those held out."""
    chosen = [*fitter.fit_records, *fitter.held_out_records] if records is None else records
    gathered = [gather(fitter, fit, record) for record in chosen]
    residuals, signals, sensitivities = (list(part) for part in zip(*gathered, strict=True))
    return model_free_shares(residuals, signals, fitter.recording.channels, sensitivities, seed)


def gather(fitter: Fitter, fit: Fit, record: Record) -> tuple[np.ndarray, Signals, np.ndarray]:
    """Of one record: observed less predicted (n, n_y) [SI], NaN where not valid; its signals; and the sensitivities
    (n, n_y, k) [SI] of the readings by the k fitted numbers.

    Positions and speeds are those of the simulated stage, before the drive of a sample acts; for settled poses after it.
    """
    simulator = fitter.simulator(fit.structure, record)
    model = simulator.model
    own = [k for k, r in enumerate(fitter.fit_records) if r is record]
    start = fit.initial_states[own[0]] if own and fit.initial_states else None
    after, _ = simulator.simulate_states(record, fit.theta, start)
    settled = not np.isfinite(record.sample_time)
    record = simulator.aligned(record, fit.theta)
    states = after if settled else np.vstack([simulator.starting_state(record, fit.theta, start), after[:-1]])
    z, n_v = states[:, simulator.n_x :], model.v.numel()
    speed = states[:, simulator.n_x - n_v : simulator.n_x]
    predicted = fitter.predict(fit, record)
    displacement, drive = model.signals["displacement"], model.signals["drive"]
    units = {f"position {a}": unit for a, unit in zip(displacement.channels, displacement.units, strict=True)}
    units |= {f"speed {a}": f"{unit}/s" for a, unit in zip(displacement.channels, displacement.units, strict=True)}
    units |= {f"drive {u}": unit for u, unit in zip(drive.channels, drive.units, strict=True)}
    signals = Signals(
        time=record.time,
        sample_time=record.sample_time,
        position=dict(zip(model.axes, z.T, strict=True)),
        speed=dict(zip(model.axes, speed.T, strict=True)) if n_v else {},
        drive=dict(zip(drive.channels, record.drive.T, strict=True)),
        reading=dict(zip(fitter.recording.channels, predicted.T, strict=True)),
        temperature=record.ambient,
        units=units,
    )
    by_numbers = simulator.sensitivities(record, fit.theta, start)[1][:, :, : len(fit.theta)]
    return np.where(record.valid, record.observed - predicted, np.nan), signals, by_numbers


def shown(values: np.ndarray, unit: str) -> np.ndarray:
    """Differences `values` [SI] in `unit`, unchanged where it is ''."""
    return np.asarray(difference(values, unit)) if unit else values
