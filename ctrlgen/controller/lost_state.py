"""Whether a controller's state can be one that it left: numbers, none of them far beyond its range."""

from __future__ import annotations

import numpy as np

from ctrlgen.model.model import Model

FAR = 4  # times the largest magnitude in its range: a number of a state that is farther was never computed
ENDLESS = 1e15  # SI: the magnitude taken for a state without a range: none of a float's size comes near

# SI: what the C has for a bound of a state that has none, and for the largest error of a measurement; its square is still a float
UNLIMITED = 1e18


def plausible_magnitudes(m: Model, with_drive: bool = False) -> np.ndarray:
    """(n,) the largest magnitude of each number of a state that is not lost: of x, then z, and `with_drive` then the last drive, `FAR`
    times the largest magnitude of its range."""
    ranges = (m.x_bounds, m.z_bounds, *([m.u_bounds] if with_drive else []))
    low, high = (np.concatenate(bound) for bound in zip(*ranges, strict=True))
    reach = np.maximum(np.abs(low), np.abs(high))
    return FAR * np.where(np.isfinite(reach) & (reach > 0), reach, ENDLESS)


def is_beyond(most: np.ndarray, *state: np.ndarray) -> bool:
    """Whether a number of the state is larger than its magnitude in `most`, or none."""
    return not bool(np.all(np.abs(np.concatenate(state)) <= most))
