"""Whether a record's time is plausible beside how fast the device is: a unit of time that is wrong by a thousand shows so."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ctrlgen.model.model import Model
from ctrlgen.model.quasi_static import natural_modes
from ctrlgen.recordings.recording import Record
from ctrlgen.recordings.schema import RecordTable

SLOWEST = 5.0  # periods of the lowest natural frequency between two samples: nothing of its motion is seen
SHORTEST = 0.1  # of that period, of a whole record: nothing of it happens
UNITS = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0, "min": 60.0, "hour": 3600.0, "day": 86400.0}
USUAL = (1e-4, 0.25)  # of a period between two samples: as recorders of a device with inertia are set


def rate_notes(records: Sequence[Record], model: Model, table: RecordTable) -> list[str]:
    """A note where samples are so far apart, or a record so short, that nothing of the device's own motion can be in it."""
    if not records or not model.inertial or table.role == "rest":
        return []
    record = records[0]
    modes = natural_modes(model, model.rest, np.zeros(model.z.numel()), np.zeros(model.u.numel()))
    if not modes:
        return []
    frequency = min(f for f, _ in modes)
    step, length = record.sample_time, records[-1].time[-1] - record.time[0]
    if step * frequency < SLOWEST and length * frequency > SHORTEST:
        return []
    beside = f"a period of the device's lowest natural frequency takes {1e3 / frequency:.4g} ms"
    apart = f"{record.name}: samples are {step:.4g} s apart and the record is {length:.4g} s long, where {beside}"
    return [f"{apart}; {_mend(step, frequency, table)}."]


def _mend(step: float, frequency: float, table: RecordTable) -> str:
    """The unit of time with which the rate would be usual."""
    if table.time is None:
        return "is sample_rate right?"
    own = UNITS.get(table.time.unit)
    fitting = [unit for unit, size in UNITS.items() if own and USUAL[0] < step / own * size * frequency < USUAL[1]]
    near = min(fitting, key=lambda unit: abs(np.log(UNITS[unit] / own)), default=None) if own else None
    return f'if the time is in {near}, write unit = "{near}"' if near else "is the unit of its time right?"
