"""The stretch of one record that holds nearly all of a residual: what was not so before, or is not so after, acts there.

Of the windows that hold the share g of the sum of squares E = sum(w^2) of the whitened residual w, the shortest is told,

    min (j - i)   such that   w_i^2 + ... + w_j^2 >= g E,

where it is a small part of all samples and less than half of the motion is in it: a residual grows with the motion, and lies where that is.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePosixPath

import numpy as np
from pydantic import Field

from ctrlgen.diagnosis.evidence.ltv_linearisation import LtvModel
from ctrlgen.diagnosis.settings import LOCALISATION
from ctrlgen.reporting.numbers import number
from ctrlgen.reporting.result_file import Keys


class GatheredEntry(Keys):
    """The shortest stretch of one record that holds nearly all of the residual."""

    record: str = Field(description="The file, with its rows where it is cut out of one.")
    first: float = Field(description="Time of its first sample [s]; of settled poses their number.")
    last: float = Field(description="Time of its last sample [s]; of settled poses their number.")
    share: float = Field(description="Share of the squares of the whole residual, whitened.")
    n: int = Field(description="Samples in it.")
    of: int = Field(description="Samples of all records.")
    poses: bool = Field(description="Whether the rows are settled poses.")

    @property
    def place(self) -> str:
        """Where it is, in words: 'run2.csv from 1.5 to 2.4 s'."""
        unit = "" if self.poses else " s"
        return f"{self.record} from {number(self.first, 4)} to {number(self.last, 4)}{unit}"


def gathered_residual(models: Sequence[LtvModel]) -> GatheredEntry | None:
    """Where the residual of the records of `models` lies, if nearly all of it lies in a small part of one; else None."""
    squares = [np.where(a.usable, a.white, 0.0) ** 2 for a in models]
    each = [s.sum(axis=1) for s in squares]
    usable = [np.any(a.usable, axis=1) for a in models]
    whole, samples = sum(float(e.sum()) for e in each), sum(int(u.sum()) for u in usable)
    if whole - sum(int(a.usable.sum()) for a in models) < LOCALISATION.least_excess * np.sqrt(2 * max(samples, 1)):
        return None
    moved = _motion(models)
    k = int(np.argmax([e.sum() for e in each]))
    found = shortest_window(each[k], LOCALISATION.gathered * whole)
    if found is None:
        return None
    inside = slice(found[0], found[1] + 1)
    n = int(usable[k][inside].sum())
    of_motion = float(moved[k][inside].sum()) / max(sum(float(m.sum()) for m in moved), 1e-300)
    if not LOCALISATION.fewest_samples <= n <= LOCALISATION.gathered_in * samples or of_motion > LOCALISATION.of_motion:
        return None
    a, poses = models[k], bool(models[k].poses)
    time = np.arange(1.0, len(a.white) + 1) if poses else a.record.time
    return GatheredEntry(
        record=PurePosixPath(a.record.name).name,
        first=float(time[found[0]]),
        last=float(time[found[1]]),
        share=float(each[k][inside].sum() / whole),
        n=n,
        of=samples,
        poses=poses,
    )


def shortest_window(squares: np.ndarray, least: float) -> tuple[int, int] | None:
    """First and last index of the shortest window in which the `squares` (n,) add up to `least`; None where all do not."""
    reached = np.concatenate([[0.0], np.cumsum(squares)])
    # the first end at which the sum from each beginning on is enough
    ends = np.searchsorted(reached, reached[:-1] + least, side="left")
    begins = np.flatnonzero(ends < len(reached))
    if not len(begins):
        return None
    first = int(begins[np.argmin(ends[begins] - begins)])
    return first, int(ends[first]) - 1


def _motion(models: Sequence[LtvModel]) -> list[np.ndarray]:
    """Squares of the readings about their means over all records, over their variances, summed over the readings, (n,) by record."""
    read = [np.where(a.usable, a.record.observed, np.nan) for a in models]
    together = np.concatenate(read)
    seen = np.isfinite(together)
    mean = np.where(seen, together, 0.0).sum(axis=0) / np.maximum(seen.sum(axis=0), 1)
    size = np.where(seen, (together - mean) ** 2, 0.0).sum(axis=0) / np.maximum(seen.sum(axis=0), 1)
    return [np.where(np.isfinite(y), (y - mean) ** 2 / np.where(size > 0, size, 1.0), 0.0).sum(axis=1) for y in read]
