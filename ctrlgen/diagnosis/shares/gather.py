"""The shares of what a fit leaves: residuals and signals from the model simulated along each record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ctrlgen.diagnosis.shares.channel import share_of
from ctrlgen.diagnosis.shares.model_free_shares import TooFewSamples, model_free_shares
from ctrlgen.diagnosis.shares.shares_table import Share, SharesTable
from ctrlgen.diagnosis.shares.signals import Signals
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.settings import FIT
from ctrlgen.recordings.recording import Record


@dataclass(frozen=True, eq=False)
class ResidualShares:
    """The shares of what the device as described leaves (`before`), and of what the accepted model leaves (`after`)."""

    before: SharesTable
    after: SharesTable

    def reached(self, channel: str) -> Share:
        """The share of the first residual's energy that the accepted causes take away, on the same samples and blocks:
        1 - sum e_after^2/sum e_before^2, which the ceiling `total` of `before` is to be compared with."""
        old, new = (table.of(channel).residual for table in (self.before, self.after))
        seen = np.isfinite(old) & np.isfinite(new)
        blocks = self.before.blocks
        energy, left = (blocks.sums(np.where(seen, e, 0.0) ** 2) for e in (old, new))
        return share_of(energy - left, energy)


def residual_shares(fitter: Fitter, described: Fit, accepted: Fit, seed: int = 0) -> ResidualShares | None:
    """The shares before and after, over the records to fit and those held out that both models can be simulated along; None
    where these are too short."""
    changed = bool(accepted.structure.causes)
    fits = (described, accepted) if changed else (described,)
    records = [
        r for r in (*fitter.fit_records, *fitter.held_out_records) if all(_stays_finite(fitter, f, r) for f in fits)
    ]
    try:
        tables = [fit_shares(fitter, fit, records, seed) for fit in fits]
    except TooFewSamples:
        return None
    return ResidualShares(tables[0], tables[-1])


def _stays_finite(fitter: Fitter, fit: Fit, record: Record) -> bool:
    """Whether a model can be simulated along a record: one with another structure may diverge where it was not fitted."""
    states, y = fitter.simulator(fit.structure, record).simulate_states(record, fit.theta)
    return all(bool(np.all(np.abs(v) < FIT.reading_limit)) for v in (states, y, fitter.predict(fit, record)))


def fit_shares(fitter: Fitter, fit: Fit, records: Sequence[Record], seed: int = 0) -> SharesTable:
    """The model-free shares of what a fit leaves of `records`. Raises TooFewSamples."""
    if not records:
        raise TooFewSamples("no record")
    gathered = [gather(fitter, fit, record) for record in records]
    residuals, signals, sensitivities = (list(part) for part in zip(*gathered, strict=True))
    return model_free_shares(residuals, signals, fitter.recording.channels, sensitivities, seed)


def gather(fitter: Fitter, fit: Fit, record: Record) -> tuple[np.ndarray, Signals, np.ndarray]:
    """Of one record: observed less predicted (n, n_y) [SI], NaN where not valid; its signals; and the sensitivities
    (n, n_y, k) [SI] of the readings by the k fitted numbers.

    Positions and speeds are those of the simulated stage, before the drive of a sample acts; for poses after it.
    """
    simulator = fitter.simulator(fit.structure, record)
    model = simulator.model
    places = [k for k, r in enumerate(fitter.fit_records) if r is record]
    start = fit.initial_states[places[0]] if places and fit.initial_states else None
    after, _ = simulator.simulate_states(record, fit.theta, start)
    poses = record.poses
    driven = simulator.aligned(record, fit.theta)
    states = after if poses else np.vstack([simulator.starting_state(driven, fit.theta, start), after[:-1]])
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
        drive=dict(zip(drive.channels, driven.drive.T, strict=True)),
        reading=dict(zip(fitter.recording.channels, predicted.T, strict=True)),
        temperature=record.ambient,
        units=units,
    )
    by_numbers = simulator.sensitivities(record, fit.theta, start)[1][:, :, : len(fit.theta)]
    return np.where(record.valid, record.observed - predicted, np.nan), signals, by_numbers
