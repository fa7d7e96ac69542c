"""Whether a record's time is plausible beside how fast the device is: a unit of time that is wrong by a thousand shows so, and a rate that
is wrong by ten where the device's own dynamics are in the readings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ctrlgen.model.model import Model
from ctrlgen.model.quasi_static import natural_modes
from ctrlgen.recordings.moved import Moved
from ctrlgen.recordings.plausible_units import coefficients
from ctrlgen.recordings.recording import Record
from ctrlgen.recordings.schema import RecordTable

SLOWEST = 5.0  # periods of the lowest natural frequency between two samples: nothing of its motion is seen
SHORTEST = 0.1  # of that period, of a whole record: nothing of it happens
UNITS = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0, "min": 60.0, "hour": 3600.0, "day": 86400.0}
LONG = ("min", "hour")
LEAST = 1e-4  # of these from one row to the next: nobody writes fewer
USUAL = (1e-4, 0.25)  # of a period between two samples: as recorders of a device with inertia are set
WRONG_RATES = {
    1e-3: "the time is in ms where s is written, or a rate in kHz where Hz is",
    1e3: "the time is in s where ms is written, or a rate in Hz where kHz is",
    0.1: "a rate is a tenth of what it was",
    10.0: "a rate is ten times what it was",
}
"""Times as long as a sample is said to be, and what was written wrong."""
FITTED = 0.1
"""Of the readings' variance that is left over where the time is right, a law that the device file leaves out included."""
BETTER = 0.25
"""Of what the stated time leaves over, with a lag too, and of what a device that follows at once does: less is no accident."""
LAGS = (1.0, 3.0, 10.0, 30.0)
"""Samples: a lag of the recorder or of the device may be missing in the device file, and is no wrong rate."""
AT_ONCE = 1e6
"""Times the stated step, at which every device has settled at each sample."""


def dynamics_notes(seen: Moved) -> list[str]:
    """A note where the readings follow the drives as the model does when every sample takes ten or a thousand times as long, or as short,
    as is said, and not as it does in the stated time."""
    step = seen.stretches[0].step
    if not np.isfinite(step) or not len(seen.system.A):
        return []
    if _left(seen, 1.0) < FITTED:
        return []
    left = {factor: _left(seen, factor) for factor in WRONG_RATES}
    factor = min(left, key=lambda f: left[f])
    others = ((1.0, 0.0), (AT_ONCE, 0.0), *((1.0, lag) for lag in LAGS))
    if left[factor] > FITTED or any(left[factor] > BETTER * _left(seen, *other) for other in others):
        return []
    what = f"the readings follow the drives as the device's model does at a sample every {step * factor:.4g} s, not every {step:.4g} s"
    return [f"{what}: {WRONG_RATES[factor]}"]


def _left(seen: Moved, factor: float, lag: float = 0.0) -> float:
    """Share of the readings' variance that the drives leave over, on average, where a sample takes `factor` times as long and the readings
    follow with a `lag` of so many samples."""
    return 1 - float(coefficients(seen.stepped(factor), lag).explained.mean())


def rate_notes(records: Sequence[Record], model: Model, table: RecordTable, dated: bool = False) -> list[str]:
    """A note where samples are so far apart, or a record so short, that nothing of the device's own motion can be in it.

    `dated`: the time is dates or a clock, which are in seconds whatever is written.
    """
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
    return [f"{apart}; {'are all digits of its time in the file?' if dated else _mend(step, frequency, table)}"]


def _mend(step: float, frequency: float, table: RecordTable) -> str:
    """The unit of time, another than the written one, with which the rate would be usual, as the end of a sentence."""
    if table.time is None:
        return "is sample_rate right?"
    own = UNITS.get(table.time.unit)
    others = {unit: size for unit, size in UNITS.items() if unit != table.time.unit}  # the written one is what is odd
    fitting = [unit for unit, size in others.items() if own and USUAL[0] < step / own * size * frequency < USUAL[1]]
    fitting = [unit for unit in fitting if unit not in LONG or (own and step / own > LEAST)]
    near = min(fitting, key=lambda unit: abs(np.log(UNITS[unit] / own)), default=None) if own else None
    return f'if the time is in {near}, write unit = "{near}".' if near else "is the unit of its time right?"
