"""Whether every record reads about as many times what the device's model makes of its drives as the others do, and about once.

    y_i = c_i sum_j G_ij * u_j    in each record,    c_i by least squares.

A description may be off by `RIGHT`, the same way in all records. A range, a unit or a sign that was changed between two of them is off in
one, and no law of the device is.
"""

from __future__ import annotations

import numpy as np

from ctrlgen.recordings.moved import Moved
from ctrlgen.recordings.plausible_units import RIGHT
from ctrlgen.reporting.numbers import number

FOLLOWS_CLOSELY = 0.9
"""Share of a reading's variance that all drives together explain, from which its coefficient in a single record is believed."""
FEWEST = 10
"""Readings of a record from which it has a coefficient."""


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


def times(seen: Moved) -> np.ndarray:
    """How many times what the model makes of all drives each reading is in each stretch, (stretches, n_y); NaN where it does not follow
    them closely."""
    found = np.full((len(seen.stretches), len(seen.readings)), np.nan)
    for row, s in zip(found, seen.stretches, strict=True):
        made = seen.system.responses(s.u, s.step, s.linear).sum(axis=2)
        for i in range(len(row)):
            good = np.isfinite(s.y[:, i]) & np.isfinite(made[:, i])
            if good.sum() < FEWEST:
                continue
            y, x = (v[good, i] - v[good, i].mean() for v in (s.y, made))
            if y.any() and x.any():
                c = float(x @ y / (x @ x))
                row[i] = c if np.mean((y - c * x) ** 2) < (1 - FOLLOWS_CLOSELY) * np.mean(y**2) else np.nan
    return found


def _off(times: float) -> float:
    """How far a coefficient is from 1, in powers of ten; one that is turned round further than any."""
    return abs(float(np.log10(times))) if times > 0 else np.inf


def _apart(a: float, b: float) -> bool:
    """Whether two coefficients differ by more than a description may be off."""
    return a * b <= 0 or abs(float(np.log10(a / b))) > RIGHT
