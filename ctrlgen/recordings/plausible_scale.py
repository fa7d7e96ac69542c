"""Whether every record reads about as many times what the device's model makes of its drives as the others do, and about once, from the
same zero.

    y_i = b_i + c_i sum_j G_ij * u_j    in each record,    b_i and c_i by least squares.

A description may be off by `RIGHT`, the same way in all records. A range, a unit or a sign that was changed between two of them is off in
one, and no law of the device is. A zero that is another in each record, b_i, is set anew for each, as that of many sensors is.
"""

from __future__ import annotations

import numpy as np

from ctrlgen.core.units import from_si
from ctrlgen.recordings.moved import Moved
from ctrlgen.recordings.plausible_units import RIGHT
from ctrlgen.reporting.numbers import number

FOLLOWS_CLOSELY = 0.9
"""Share of a reading's variance that all drives together explain, from which its coefficient in a single record is believed."""
FEWEST = 10
"""Readings of a record from which it has a coefficient."""
ZEROS_APART = 0.3
"""Of the motion in the records, root mean square, by which their zeros differ at least to be told. Judgement."""
BEYOND_LEFT = 10.0
"""Times what is left about the coefficients, root mean square, by which they differ at least: what creeps or sticks leaves more of itself
than an offset."""


def size_notes(seen: Moved) -> list[str]:
    """A sentence for each reading that is of another size, or turned round, in one record than in another, or that is as many times too
    large, or too small, in all as no description of a device is."""
    found, said = times(seen), []
    for (name, _), column in zip(seen.readings, found.T, strict=True):
        known = [(s.name, float(c)) for s, c in zip(seen.stretches, column, strict=True) if np.isfinite(c)]
        if not known:
            continue
        size = float(np.median([c for _, c in known]))
        ends = [f(known, key=lambda k: k[1]) for f in (min, max)]
        if _apart(ends[0][1], ends[1][1]):
            # the one that is further from once is the one to look at
            (odd, off), (usual, other) = sorted(ends, key=lambda k: -_off(k[1]))
            model = "what the device's model makes of the drives"
            what = f"{name} is {number(off, 3)} times {model} in {odd}, and {number(other, 3)} times in {usual}"
            said.append(f"{what}: was a sign, a range or a unit changed between them?")
        elif size > 0 and _apart(size, 1.0):
            what = f"{name} is {number(size, 3)} times what the device's model makes of the drives"
            said.append(
                f"{what}: the sensor's scale, the amplifier's gain, or stiffness or force in the device file is not as stated"
            )
    return said


def zero_notes(seen: Moved) -> list[str]:
    """A sentence for each reading whose zero differs from record to record by more than anything that is left in them."""
    if seen.system.gain() is None:  # it stands wherever it was driven to
        return []
    found, said = lines(seen), []
    for i, (name, unit) in enumerate(seen.readings):
        known = [(s.name, row) for s, row in zip(seen.stretches, found[:, i], strict=True) if np.isfinite(row).all()]
        if len({record for record, _ in known}) < 2:
            continue
        (first, low), (last, high) = (f(known, key=lambda k: float(k[1][1])) for f in (min, max))
        moved, left = (max(float(row[place]) for _, row in known) for place in (2, 3))
        if high[1] - low[1] > max(ZEROS_APART * moved, BEYOND_LEFT * left):
            ends = " and ".join(
                f"{number(float(from_si(row[1], unit)), 3)} {unit} in {record}"
                for record, row in ((first, low), (last, high))
            )
            mend = 'if it is set anew for every record, state [[effect]] kind = "zero_per_record" at the sensor in the device file'
            said.append(f"the zero of {name} is at {ends}: {mend}")
    return said


def times(seen: Moved) -> np.ndarray:
    """How many times what the model makes of all drives each reading is in each stretch, (stretches, n_y); NaN where it does not follow
    them closely."""
    return lines(seen)[:, :, 0]


def lines(seen: Moved) -> np.ndarray:
    """(stretches, n_y, 4) of each reading in each stretch: c, b [SI], and the root mean squares [SI] of its motion about its mean and of
    what is left; NaN where it does not follow the drives closely."""
    found = np.full((len(seen.stretches), len(seen.readings), 4), np.nan)
    for row, s in zip(found, seen.stretches, strict=True):
        made = seen.system.responses(s.u, s.step, s.linear).sum(axis=2)
        for i in range(len(row)):
            good = np.isfinite(s.y[:, i]) & np.isfinite(made[:, i])
            if good.sum() < FEWEST:
                continue
            mean_y, mean_x = (float(v[good, i].mean()) for v in (s.y, made))
            y, x = s.y[good, i] - mean_y, made[good, i] - mean_x
            if y.any() and x.any():
                c = float(x @ y / (x @ x))
                moved, left = (float(np.sqrt(np.mean(v**2))) for v in (y, y - c * x))
                if left**2 < (1 - FOLLOWS_CLOSELY) * moved**2:
                    row[i] = c, mean_y - c * mean_x, moved, left
    return found


def _off(times: float) -> float:
    """How far a coefficient is from 1, in powers of ten; one that is turned round further than any."""
    return abs(float(np.log10(times))) if times > 0 else np.inf


def _apart(a: float, b: float) -> bool:
    """Whether two coefficients differ by more than a description may be off."""
    return a * b <= 0 or abs(float(np.log10(a / b))) > RIGHT
