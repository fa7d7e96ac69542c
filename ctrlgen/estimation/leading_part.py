"""The beginning of the records to fit that is driven as the rest of them is: fits begin there, and end on all samples.

From the beginning, because a device remembers: in the middle of a record nobody knows what creep or hysteresis have stored. A part
counts as driven alike if each drive, reading and ambient temperature, and each of their changes from sample to sample, goes through
nearly the same range in it as in the whole record. What such a part leaves open of the n free numbers is of the order of n in the
objective, so that few steps are left on all samples; what does not show there, such as an event, is found in those.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache

import numpy as np

from ctrlgen.estimation.settings import LEADING_PART
from ctrlgen.recordings.recording import Record, Recording


@lru_cache(maxsize=LEADING_PART.kept)
def leading_part(recording: Recording) -> Recording | None:
    """The records to fit, each cut to the beginning that is driven as the rest is; None where that is hardly shorter, and for poses."""
    if recording.kind == "poses":
        return None
    whole = [r for r in recording.records if r.role == "fit"]
    cut = [_cut(r) for r in whole]
    n, most = (sum(len(r.time) for r in records) for records in (cut, whole))
    return replace(recording, records=tuple(cut)) if n <= LEADING_PART.longest * most else None


def _cut(record: Record) -> Record:
    """The shortest part of a record that holds its excitation."""
    n = len(record.time)
    lengths = (int(np.ceil(share * n)) for share in LEADING_PART.shares)
    length = next((m for m in lengths if m >= LEADING_PART.shortest and _is_driven_alike(record, m)), n)
    if length == n:
        return record
    ambient = None if record.ambient is None else record.ambient[:length]
    rows = {name: getattr(record, name)[:length] for name in ("time", "drive", "observed", "valid")}
    return replace(record, **rows, ambient=ambient, spikes=(), held=())


def _is_driven_alike(record: Record, n: int) -> bool:
    return all(_same_range(x[:n], x) for signal in _signals(record) for x in (signal, np.diff(signal)))


def _signals(record: Record) -> Iterator[np.ndarray]:
    """Each drive, reading and temperature (n,), NaN where a reading is missing."""
    yield from record.drive.T
    yield from np.where(record.valid, record.observed, np.nan).T
    if record.ambient is not None:
        yield record.ambient


def _same_range(part: np.ndarray, whole: np.ndarray) -> bool:
    """Whether the middle of the values of a part, but for its tails, reaches nearly as far as that of the whole."""
    seen = [x[np.isfinite(x)] for x in (part, whole)]
    if not len(seen[1]):
        return True
    if not len(seen[0]):
        return False
    tails = (LEADING_PART.tail, 1 - LEADING_PART.tail)
    (low, high), (least, most) = (np.quantile(x, tails) for x in seen)
    slack = LEADING_PART.missing * (most - least)
    return bool(low <= least + slack and high >= most - slack)
