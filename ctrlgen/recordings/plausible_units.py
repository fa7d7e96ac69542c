"""Whether the units of drives and readings are plausible beside what the device's model makes of the drives.

Each reading is the sum of what each drive alone makes of it, times a coefficient that is 1 where model and units are right:

    y_i = sum_j c_ij (G_ij * u_j),    c by least squares.

A wrong unit of a reading multiplies its row of c, one of a drive its column. A model is off by a factor of a few at most, a unit by 25,
57, or a thousand.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from ctrlgen.recordings.alike_units import FULL, alike, size_of, unit_within
from ctrlgen.recordings.moved import Moved
from ctrlgen.reporting.numbers import number

WRONG = 1.0
"""Powers of ten by which a coefficient is off, from which a unit is suspected: no description of a device is so far off."""
RIGHT = np.log10(3.0)
"""Powers of ten within which the right unit brings it: as far off as a description may be."""
FOLLOWS = 0.5
"""Share of a reading's variance that the drives explain, from which its coefficients mean something."""
OWN = 0.05
"""Of a reading's typical size, as a drive moves it over its whole range: smaller parts are parasitic, and known no better than that."""
PART = 0.3
"""Of a reading's rms, of the part that a coefficient belongs to."""
ALIKE = 10.0
"""Variance inflation from which drives are too alike to be told apart."""
BEYOND = 3.0
"""Times its bounds that a drive reaches, from which its unit is suspected."""
LITTLE = 0.02
"""Of its range that a drive spans, below which its unit is as likely wrong as that of the reading."""


@dataclass(frozen=True)
class Coefficients:
    """`power` log10 |c_ij| (n_y, n_u), NaN where it is not known; `joint` (n_y,) that of all drives together where they cannot be told
    apart; `explained` (n_y,) share of each reading's variance."""

    power: np.ndarray
    joint: np.ndarray
    explained: np.ndarray


def coefficients(seen: Moved, lag: float = 0.0) -> Coefficients:
    """Of the readings by the drives, as far as the record determines them; readings that follow with a `lag` of so many samples."""
    n_y, n_u = len(seen.readings), len(seen.drives)
    parts = [_lagging(seen.system.responses(s.u, s.step, s.linear), lag) for s in seen.stretches]
    gain = seen.system.gain()
    own = np.ones((n_y, n_u), bool) if gain is None else np.abs(gain) * seen.sizes > OWN * seen.scales[:, None]
    power, joint, explained = np.full((n_y, n_u), np.nan), np.full(n_y, np.nan), np.zeros(n_y)
    for i in range(n_y):
        ys, Xs = [], []
        for s, part in zip(seen.stretches, parts, strict=True):
            rows = np.isfinite(s.y[:, i]) & np.isfinite(part[:, i]).all(axis=1)
            if rows.sum() > n_u + 2:
                ys.append(s.y[rows, i] - s.y[rows, i].mean())
                Xs.append(part[rows, i] - part[rows, i].mean(axis=0))
        if ys:
            power[i], joint[i], explained[i] = _row(np.concatenate(ys), np.concatenate(Xs), own[i])
    return Coefficients(power, joint, explained)


def _lagging(part: np.ndarray, lag: float) -> np.ndarray:
    """A first-order lag of `part` (n, ...), settled at its first row."""
    if not lag:
        return part
    kept = float(np.exp(-1.0 / lag))
    return np.asarray(lfilter([1 - kept], [1.0, -kept], part, axis=0, zi=kept * part[:1])[0])


def _row(y: np.ndarray, X: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, float, float]:
    """log10 of the coefficients of one reading, of its drives together, and the share of its variance that they explain."""
    power = np.full(len(own), np.nan)
    sizes, size = np.sqrt(np.mean(X**2, axis=0)), np.sqrt(np.mean(y**2))
    used = np.flatnonzero(own & (sizes > 1e-9 * sizes.max(initial=0.0)) & (sizes > 0))
    if not len(used) or size == 0:
        return power, np.nan, 0.0
    normed = X[:, used] / sizes[used]
    c, *_ = np.linalg.lstsq(normed, y, rcond=1e-9)
    explained = 1 - float(np.mean((y - normed @ c) ** 2)) / size**2
    if explained < FOLLOWS:
        return power, np.nan, explained
    inflation = np.diag(np.linalg.pinv(normed.T @ normed / len(y), rcond=1e-9))
    known = (inflation < ALIKE) & (np.abs(c) > PART * size)
    power[used[known]] = np.log10(np.abs(c[known]) / sizes[used[known]])
    total = X[:, used].sum(axis=1)
    one = float(total @ y / (total @ total)) if total.any() else 0.0
    fits = one != 0 and 1 - float(np.mean((y - one * total) ** 2)) / size**2 > FOLLOWS
    return power, float(np.log10(abs(one))) if fits and not known.any() else np.nan, explained


def unit_notes(seen: Moved) -> list[str]:
    """A sentence for the drives and for the readings whose unit cannot be right, with the one that would be."""
    said, mended = _beyond(seen)
    found = coefficients(mended)
    entries = np.column_stack([found.power, found.joint])
    for _ in range(len(seen.drives) + len(seen.readings)):
        suspects = sorted(_suspects(mended, entries), key=lambda s: (s.count, s.likely), reverse=True)
        if not suspects:
            break
        first, *others = suspects
        rivals = [s for s in others if s.count == first.count and np.array_equal(s.where, first.where)]
        said.append(f"{first.what}; {' or '.join(s.mend for s in (first, *rivals[:1]))}")
        entries = entries + np.where(first.where, first.shift, 0.0)
    return said


@dataclass(frozen=True)
class _Suspect:
    """Signals of one unit, and the one with which the `count` coefficients at `where` (n_y, n_u + 1) are right once `shift` is added."""

    where: np.ndarray
    shift: float
    count: int
    likely: float
    what: str
    mend: str


def _suspects(seen: Moved, entries: np.ndarray) -> list[_Suspect]:
    """Each reading and each drive alone, and all of one unit together, whose coefficients another unit puts right."""
    found = []
    for places in _alone_and_together([unit for _, unit in seen.readings]):
        where = np.zeros(entries.shape, bool)
        where[list(places)] = True
        found += _suspect([seen.readings[i] for i in places], entries, where, +1.0, 0.5)
    for places in _alone_and_together([unit for _, unit in seen.drives]):
        where = np.zeros(entries.shape, bool)
        where[:, list(places)] = True
        where[:, -1] = len(places) == len(seen.drives)
        use = float((seen.spans() / seen.sizes)[list(places)].max())
        for suspect in _suspect([seen.drives[j] for j in places], entries, where, -1.0, 0.0):
            then = use * 10**-suspect.shift
            if then < BEYOND:
                found.append(replace(suspect, likely=1.0 if use < LITTLE < then < FULL else 0.0))
    return found


def _alone_and_together(units: list[str]) -> list[tuple[int, ...]]:
    groups: dict[str, list[int]] = {}
    for k, unit in enumerate(units):
        groups.setdefault(unit, []).append(k)
    return [*((k,) for k in range(len(units))), *(tuple(g) for g in groups.values() if len(g) > 1)]


def _suspect(
    signals: list[tuple[str, str]], entries: np.ndarray, where: np.ndarray, sign: float, likely: float
) -> list[_Suspect]:
    """One, or none where the coefficients at `where` are not all wrong in one way. `sign` is that of a unit's size in a coefficient."""
    where = where & np.isfinite(entries)
    # only entries that are known tell, and those of every signal must
    powers, unit = sign * entries[where], signals[0][1]
    if len(powers) < len(signals) or np.abs(powers).min() < WRONG:
        return []
    others = {o: np.abs(powers + np.log10(size_of(o) / size_of(unit))).max() for o in alike(unit)}
    other = min(others, key=lambda o: others[o], default="")
    if not other or others[other] > RIGHT:
        return []
    names, times = ", ".join(name for name, _ in signals), 10 ** float(np.median(powers))
    size = f"{number(times, 2)} times as large" if times > 1 else f"{number(1 / times, 2)} times smaller"
    whose = "the device's model makes of the drives" if sign > 0 else "the readings need in the device's model"
    verb = "is" if len(signals) == 1 else "are"
    what = f"{names} {verb} {size} {'as' if times > 1 else 'than'} {whose}"
    numbers = "its numbers are" if len(signals) == 1 else "their numbers are"
    mend = f'if {numbers} in {other}, write unit = "{other}"'
    mend = mend if sign > 0 else mend.replace(numbers, f"the numbers of {names} are")
    shift = sign * float(np.log10(size_of(other) / size_of(unit)))
    return [_Suspect(where, shift, int(where.sum()), likely, what, mend)]


def _beyond(seen: Moved) -> tuple[list[str], Moved]:
    """A sentence for each drive far beyond its bounds, and the same with the unit that brings it within them, where one does."""
    (low, high), said = seen.model.u_bounds, []
    largest = np.max([np.abs(s.u).max(axis=0) for s in seen.stretches], axis=0)
    bound, factors = np.maximum(np.abs(low), np.abs(high)), np.ones(len(seen.drives))
    for j, (name, unit) in enumerate(seen.drives):
        if not np.isfinite(bound[j]) or largest[j] <= BEYOND * bound[j]:
            continue
        what = f"{name} reaches {largest[j] / size_of(unit):.4g} {unit}, and the device's limit is {bound[j] / size_of(unit):.4g} {unit}"
        if other := unit_within(largest[j], bound[j], unit):
            said.append(f'{what}; if the numbers are in {other}, write unit = "{other}"')
            factors[j] = size_of(other) / size_of(unit)
        else:
            said.append(f"{what}; is the unit right, and the limit?")
    return said, replace(seen, stretches=tuple(replace(s, u=s.u * factors) for s in seen.stretches))
