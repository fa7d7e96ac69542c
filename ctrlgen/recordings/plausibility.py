"""What is not plausible about a recording beside its device: units, rates, readings that come before their drives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import Fault
from ctrlgen.model.model import Model
from ctrlgen.recordings.alike_units import alike, size_of
from ctrlgen.recordings.implausible_note import Implausible
from ctrlgen.recordings.moved import Moved, moved
from ctrlgen.recordings.plausible_order import column_notes, row_notes, speed_notes
from ctrlgen.recordings.plausible_rate import dynamics_notes
from ctrlgen.recordings.plausible_reach import reach_notes
from ctrlgen.recordings.plausible_scale import size_notes, zero_notes
from ctrlgen.recordings.plausible_travel import travel_notes
from ctrlgen.recordings.plausible_units import WRONG, unit_notes
from ctrlgen.recordings.recording import Recording

LAGS = 50  # rows within which a reading is sought before and after its drive
EARLY = 0.3  # of the correlation at best: as much better an earlier reading must fit
LEAST = 0.3  # correlation from which an order is told: of the noise of a slow motion nothing is
SLOPE = 0.7  # correlation of a speed with the slope of its position, from which their sizes are compared
RATES = (
    ("position", "velocity"),
    ("velocity", "acceleration"),
)  # of an imposed motion: each the slope of the one before


def with_plausibility(recording: Recording, model: Model) -> Recording:
    """The recording with a note for each thing of it that cannot be of the device as it is stated."""
    seen = moved(recording, model)
    # a unit, a sign or an order that is wrong takes samples as far
    said = ([] if seen is None else implausible(seen)) or reach_notes(recording, model)
    if said:
        return replace(recording, notes=(*recording.notes, *map(Implausible, said)))
    return replace(recording, notes=(*recording.notes, *(travel_notes(recording, seen) if seen else ())))


def suspected(notes: Sequence[str]) -> list[Fault]:
    """The notes of what is not plausible, as faults beside those for which a recording is refused."""
    return [Fault("plausible", note) for note in notes if isinstance(note, Implausible)]


def implausible(seen: Moved) -> list[str]:
    """A sentence, with the likely mend, for each unit, size, zero, order and rate that cannot be right, and each reading before its
    drive."""
    with np.errstate(all="ignore"):  # a unit that is wrong by a million may overflow
        # a unit that is wrong makes the size wrong too
        sizes = unit_notes(seen) or size_notes(seen) or zero_notes(seen)
        # in another order the sizes mean nothing
        order = column_notes(seen) or row_notes(seen) or speed_notes(seen)
        return [*(order or sizes), *motion_notes(seen), *dynamics_notes(seen), *order_notes(seen)]


def order_notes(seen: Moved) -> list[str]:
    """Of a single drive: the readings that come before it, and before what the model makes of it. A swing that follows by a quarter of a
    period, as a position follows a drive of the speed, is with the other sign a quarter early, and a drive in a loop follows its reading.
    """
    first = seen.stretches[0]
    if len(seen.drives) != 1 or not np.isfinite(first.step):
        return []
    rows = {name: early(first.u[:, 0], first.y[:, i]) for i, (name, _) in enumerate(seen.readings)}
    if any(rows.values()):
        own = seen.system.responses(first.u, first.step, first.linear)[:, :, 0]
        rows = {
            name: by
            for i, (name, by) in enumerate(rows.items())
            if by and (not np.isfinite(own[:, i]).all() or early(own[:, i], first.y[:, i]))
        }
    return [
        f"{name} comes before its drive by {number_of(by, 'row')}: are the columns those of one clock? `later` shifts one"
        for name, by in rows.items()
        if by
    ]


def early(drive: np.ndarray, reading: np.ndarray) -> int | None:
    """Rows by which a reading comes before its drive: None where it does not. By the correlation of their differences."""
    u, y = np.diff(np.nan_to_num(drive)), np.diff(np.nan_to_num(reading))
    n = len(u)
    if n < 10 * LAGS or not u.any() or not y.any():
        return None
    size = np.sqrt(np.sum(u**2) * np.sum(y**2))
    after = [abs(float(u[: n - k] @ y[k:])) / size for k in range(LAGS)]
    before = [abs(float(u[k:] @ y[: n - k])) / size for k in range(LAGS)]
    best = int(np.argmax(before))
    return best if best > 0 and before[best] > LEAST and before[best] - max(after) > EARLY * before[best] else None


def motion_notes(seen: Moved) -> list[str]:
    """Of an imposed motion: the speed that is no slope of its position by a factor of a unit, and the acceleration likewise."""
    names, s = [name for name, _ in seen.drives], seen.stretches[0]
    said = []
    for of, slope in RATES:
        for i, name in enumerate(names):
            rate = name[: -len(of)] + slope
            if not name.endswith(of) or rate not in names or not np.isfinite(s.step):
                continue
            k = names.index(rate)
            taken, given = np.gradient(s.u[:, i], s.step), s.u[:, k]
            if not taken.any() or not given.any() or abs(np.corrcoef(taken, given)[0, 1]) < SLOPE:
                continue
            power = float(np.log10(np.sqrt(np.mean(given**2) / np.mean(taken**2))))
            if abs(power) > WRONG:
                said.append(_motion_sentence(seen, i, k, power))
    return said


def _motion_sentence(seen: Moved, i: int, k: int, power: float) -> str:
    (name, unit), (rate, its_unit) = seen.drives[i], seen.drives[k]
    mends = [
        f'if the numbers of {whose} are in {other}, write unit = "{other}"'
        for whose, own, off in ((rate, its_unit, power), (name, unit, -power))
        for other in alike(own)
        if abs(off + np.log10(size_of(other) / size_of(own))) < np.log10(2.0)  # both are measured: no model is between
    ]
    what = f"{rate} is {10**power:.3g} times the slope of {name}"
    return f"{what}; {' or '.join((*mends, 'is the time right?'))}"
