"""Records that began before their first row: the first reading is where the first drive holds the device, and not at home.

A device that was switched on with the first row is at home there, whatever its drive; one that was already running is near where that
drive holds it. What lags, creep or loops that have a rate remember of the time before is then not known (`Record.resumed`).

Where the drive holds it: its slope at half the drive times the drive, which is exact for a reading of the drive's square, as of a heater
by its voltage.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ctrlgen.model.model import Model
from ctrlgen.recordings.moved import moved
from ctrlgen.recordings.recording import Recording

SEEN = 0.05  # of what a reading moves: how far from home it must be held for the first one to tell; judgement
NEARER = 0.5  # of the way from home to where it is held, from which on the first reading is nearer to that


def begun_elsewhere(recording: Recording, model: Model) -> Recording:
    """The recording with the records `resumed` that did not begin at home."""
    seen = moved(recording, model) if recording.kind == "series" else None
    if seen is None:
        return recording
    places = [recording.channels.index(name) for name, _ in seen.readings]
    records = []
    for record in recording.records:
        y = np.where(record.valid, record.observed, np.nan)[:, places]
        first = record.drive[0]
        looked_at = not (record.resumed or record.poses) and bool(np.isfinite(first).all() and first.any())
        gain = seen.system_about(first / 2).gain() if looked_at else None
        elsewhere = gain is not None and _was_held(gain @ first, y)
        records.append(replace(record, resumed=True) if elsewhere else record)
    return replace(recording, records=tuple(records))


def _was_held(held: np.ndarray, y: np.ndarray) -> bool:
    """Whether the first readings of y (n, n_y) lie nearer to where the first drive has `held` them (n_y,) than to home, weighed by how far
    each moves."""
    read = np.isfinite(y).any(axis=0) & np.isfinite(held)
    if not read.any():
        return False
    first = np.array([c[np.isfinite(c)][0] for c in y[:, read].T])
    moves = np.nanmax(y[:, read], axis=0) - np.nanmin(y[:, read], axis=0)
    told = (np.abs(held[read]) > SEEN * moves) & (moves > 0)
    if not told.any():
        return False
    there, where = held[read][told] / moves[told], first[told] / moves[told]
    return bool(there @ where > NEARER * (there @ there))
