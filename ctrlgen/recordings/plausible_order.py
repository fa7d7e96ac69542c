"""Whether rows and columns belong together: readings that stand a row off their drives, drives or readings in another order, and speeds in
the place of positions.

The device's linear response to its drives, about the means and but for a factor of each reading,

    y_i ~ sum_j (G_ij * u_j),

is held beside what is read with the rows moved, and with the columns of drives or readings exchanged. No law of a device moves rows or
orders columns, and what stands for it would be told as play, wear or saturation. Two exchanged drives, or one that is turned round, are
laws of the library, as they are of a machine that is wired so.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from scipy.optimize import linear_sum_assignment

from ctrlgen.core.counts import number_of
from ctrlgen.core.units import same_dimension
from ctrlgen.recordings.moved import Moved, Stretch

ROWS = (1, 2, -1, -2)
"""By how many rows readings may stand behind their drives; negative before them."""
POORLY = 0.8
"""Share of the readings' variance up to which the order as it is explains them poorly. A description may be off by a third."""
WELL = 0.95
"""Share from which other rows explain them well: play in a slow scan leaves more."""
FAIRLY = 0.85
"""Share from which other columns do, which play does not exchange: of a device whose laws are far from linear more is left over."""
BETTER = 0.3
"""Of what the columns as they are leave over, what others leave at most; share that the position explains of a speed at most."""
ALIKE = 2.0
"""Times what one order leaves, up to which another leaves as little: on a machine with a plane of symmetry they may be the same."""
FEWEST = 12
"""Rows of a record in which another order is sought."""


def row_notes(seen: Moved) -> list[str]:
    """A sentence for each record of settled poses whose readings are, all or from one row on, those of another row's drives."""
    said = []
    for s in seen.stretches:
        if np.isfinite(s.step) or len(s.u) < FEWEST:
            continue
        y, made = _about_mean(seen, s)
        # whatever the rows, they are of one size
        y, made = (v / np.maximum(np.sqrt(np.nanmean(v**2, axis=0)), 1e-300) for v in (y, made))
        as_it_is = np.nansum((y - made) ** 2, axis=1)
        whole = float(np.nansum(y**2))
        found = min(((*_split(as_it_is, _moved(y, made, k)), k) for k in ROWS), default=None)
        if found is None or not whole or 1 - as_it_is.sum() / whole > POORLY or 1 - found[0] / whole < WELL:
            continue
        _, first, k = found
        since = f"of {s.name}" if first < abs(k) + 1 else f"of {s.name} from its row {first} on"
        side = "before" if k > 0 else "after"
        said.append(
            f"the readings {since} are those of the drives {number_of(abs(k), 'row')} {side}: was a row lost or written twice, or does a "
            "column begin later than the others?"
        )
    return said


def _moved(y: np.ndarray, made: np.ndarray, k: int) -> np.ndarray:
    """The squares (n,) that each row leaves beside what the drives k rows before it make; 0 where there are none."""
    left = np.zeros(len(y))
    rows = np.arange(max(k, 0), len(y) + min(k, 0))
    left[rows] = np.nansum((y[rows] - made[rows - k]) ** 2, axis=1)
    return left


def _split(before: np.ndarray, after: np.ndarray) -> tuple[float, int]:
    """The least sum of the first so many values of one array (n,) and the others of another, and how many these are."""
    sums = np.concatenate([[0.0], np.cumsum(before)]) + np.concatenate([np.cumsum(after[::-1])[::-1], [0.0]])
    return float(sums.min()), int(np.argmin(sums))


def speed_notes(seen: Moved) -> list[str]:
    """A sentence for each reading of a series that follows how fast the model moves, and not where it is: as a speed does, or the way from
    row to row. No device comes a quarter of a period before what moves it."""
    stretches = [s for s in seen.stretches if np.isfinite(s.step) and len(s.u) >= FEWEST]
    if not stretches:
        return []
    parts = [_about_mean(seen, s) for s in stretches]
    y, made = map(np.concatenate, zip(*parts, strict=True))
    # the slope at a row, and the way to it
    rates = [
        np.concatenate([taken(part[1]) / s.step for part, s in zip(parts, stretches, strict=True)])
        for taken in (partial(np.gradient, axis=0), _way)
    ]
    position, speed = _explained(y, made), np.max([_explained(y, rate) for rate in rates], axis=0)
    return [
        f"{name} follows how fast the device's model moves, not where it is: is it a speed, or the way from row to row?"
        for (name, _), by_position, by_speed in zip(seen.readings, position, speed, strict=True)
        if by_position < BETTER and by_speed > FAIRLY
    ]


def _way(made: np.ndarray) -> np.ndarray:
    return np.diff(made, axis=0, prepend=made[:1])


def column_notes(seen: Moved) -> list[str]:
    """A sentence where the readings follow the drives once columns of drives, or of several readings, are exchanged with those of one
    dimension or turned round; of both what leaves less, or changes fewer columns. None where that is two drives or the sign of one."""
    stretches = [s for s in seen.stretches if len(s.u) >= FEWEST]
    if not stretches:
        return []
    y, made = map(np.concatenate, zip(*(_about_mean(seen, s) for s in stretches), strict=True))
    if not np.isfinite(made).all() or np.all(_explained(y, made) > POORLY):
        return []
    wired, read = np.concatenate([_crossed(seen, s) for s in stretches]), np.zeros((*y.shape, y.shape[1], y.shape[1]))
    for i in range(y.shape[1]):
        read[:, i, i, :] = made
    found: list[tuple[float, int, list[str]]] = []
    for columns, each in ((seen.readings, read), (seen.drives, wired)):
        if len(columns) < 2:
            continue
        order, signs = _assigned(y, each, [unit for _, unit in columns])
        own = np.arange(len(order))
        changed = int(np.count_nonzero((order != own) | (signs < 0)))
        mended = np.einsum("nijk,jk->ni", each, signs[:, None] * (order[:, None] == own))
        # of the readings, those that are changed; of drives all
        rows = np.flatnonzero((order != own) | (signs < 0)) if columns is seen.readings else np.arange(y.shape[1])
        was, explained = (float(np.mean(_explained(y, v)[rows])) if len(rows) else 0.0 for v in (made, mended))
        if not changed or was > POORLY or explained < FAIRLY or 1 - explained > BETTER * (1 - was):
            continue
        # as the sizes are stated: what is of one shape may be told by them
        left = float(np.mean(np.nansum((y - mended) ** 2, axis=0) / np.maximum(np.nansum(y**2, axis=0), 1e-300)))
        of_a_law = columns is seen.drives and np.count_nonzero(order != own) <= 2
        found.append((left, changed, [] if of_a_law else [_sentence(columns, order, signs, columns is seen.drives)]))
    least = min((left for left, *_ in found), default=0.0)
    near = [f for f in found if f[0] <= ALIKE * least]
    return min(near, key=lambda f: f[1])[2] if near else []


def _sentence(columns: Sequence[tuple[str, str]], order: np.ndarray, signs: np.ndarray, are_drives: bool) -> str:
    """'the column of drive.1x moves what drive.2x should move, ...' of all that are not in their own place."""
    names, parts = [name for name, _ in columns], []
    for j, (k, sign) in enumerate(zip(order.tolist(), signs.tolist(), strict=True)):
        # the column k of a drive does what j should; the column j of a reading holds what k should
        column, place = (names[k], names[j]) if are_drives else (names[j], names[k])
        what = f"the column of {column} {f'moves what {place} should move' if are_drives else f'reads what {place} should read'}"
        if j == k and sign < 0:
            parts.append(f"the column of {column} is turned round")
        elif j != k:
            parts.append(f"{what}{', turned round' if sign < 0 else ''}")
    return f"{'; '.join(parts)}: are the columns in this order, and of this sign?"


def _assigned(y: np.ndarray, parts: np.ndarray, units: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Of y (n, n_y) = sum_jk w_jk parts_jk, parts (n, n_y, m, m), by least squares: the order k of each j that the largest w_jk tell, among
    columns whose units are of one dimension, and their signs."""
    m = parts.shape[2]
    size = np.sqrt(np.nanmean(y**2, axis=0))[:, None]
    good = np.isfinite(y)
    X = (parts.reshape(*y.shape, m * m) / np.maximum(size, 1e-300))[good]
    w = np.linalg.lstsq(X, (y / np.maximum(size.T, 1e-300))[good], rcond=1e-9)[0].reshape(m, m)
    open_ = np.array([[same_dimension(one, other) for other in units] for one in units])
    order = linear_sum_assignment(-np.where(open_, np.abs(w), -1.0))[1]
    return order, np.sign(w[np.arange(m), order])


def _about_mean(seen: Moved, s: Stretch) -> tuple[np.ndarray, np.ndarray]:
    """What is read and what the model makes of the drives (n, n_y), about their means."""
    made = seen.system.responses(s.u, s.step, s.linear).sum(axis=2)
    return s.y - np.nanmean(s.y, axis=0), made - made.mean(axis=0)


def _crossed(seen: Moved, s: Stretch) -> np.ndarray:
    """What the model would make of each column k as drive j (n, n_y, n_u, n_u), about the mean."""
    n_u = s.u.shape[1]
    crossed = np.zeros((*s.y.shape, n_u, n_u))
    for shift in range(n_u):
        by_drive = seen.system.responses(np.roll(s.u, shift, axis=1), s.step, s.linear)
        for j in range(n_u):
            crossed[:, :, j, (j - shift) % n_u] = by_drive[:, :, j]
    return crossed - crossed.mean(axis=0)


def _explained(y: np.ndarray, made: np.ndarray) -> np.ndarray:
    """Share (n_y,) of the variance of y (n, n_y) that a positive multiple of `made` explains of each reading; 0 where that grows beyond all
    numbers."""
    if not np.isfinite(made).all():
        return np.zeros(y.shape[1])
    x = np.where(np.isfinite(y), made, 0.0)
    size = np.sum(x**2, axis=0)
    times = np.maximum(np.nansum(x * y, axis=0), 0.0) / np.where(size > 0, size, 1.0)
    return np.asarray(1 - np.nansum((y - times * x) ** 2, axis=0) / np.maximum(np.nansum(y**2, axis=0), 1e-300))
