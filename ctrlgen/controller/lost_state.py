"""Whether a controller's state can be one that it left: numbers, none of them far beyond its range."""

from __future__ import annotations

import numpy as np

from ctrlgen.model.model import Model

FAR = 4  # times the largest magnitude in its range: a number of a state that is farther was never computed
ENDLESS = 1e15  # SI: the magnitude taken for a state without a range; its square, of many together, is still a float

Groups = tuple[tuple[tuple[int, ...], float], ...]


def plausible_sums(m: Model, with_drive: bool = False) -> Groups:
    """(indices into x, then z, and `with_drive` then the last drive, largest sum of squares) of the numbers of a state that have the
    same range.

    A state of which one such sum is larger, or no number, is lost: |v| > `FAR` times the largest magnitude of the range, in the
    root mean square of the group. Equal ranges are taken together because a sum costs less than comparisons.
    """
    ranges = (m.x_bounds, m.z_bounds, *([m.u_bounds] if with_drive else []))
    low, high = (np.concatenate(bound) for bound in zip(*ranges, strict=True))
    ends = (m.x.numel(), m.x.numel() + m.z.numel())
    reach = np.maximum(np.abs(low), np.abs(high))
    groups: dict[tuple[int, float], list[int]] = {}  # of states, displacements and drives
    for i, size in enumerate(np.where(np.isfinite(reach) & (reach > 0), reach, ENDLESS).tolist()):
        groups.setdefault((sum(i >= end for end in ends), size), []).append(i)
    return tuple((tuple(those), len(those) * (FAR * size) ** 2) for (_, size), those in groups.items())


def is_beyond(sums: Groups, *state: np.ndarray) -> bool:
    """Whether a sum of squares is larger than `sums` says, or no number."""
    numbers = [float(number) for part in state for number in part]
    return not all(sum(numbers[i] * numbers[i] for i in those) <= most for those, most in sums)
