"""What the replayed drives of a solution may leave of it: the tolerance that the player's tables are made to."""

from __future__ import annotations

import math

import numpy as np

from ctrlgen.core.units import same_dimension
from ctrlgen.devices import Signal

LENGTH_TOLERANCE, ANGLE_TOLERANCE = 1e-10, 1e-8  # m, rad: error of the followed signal that compression may cause
LENGTH_SHARE = 1e-4  # of a typical size: what 0.1 nm is of a micrometre. A machine of nanometres is held to less


def typical_length(signal: Signal) -> float:
    """The largest typical size [m] of the lengths of a signal; infinite where it has none."""
    sizes = [size for size, unit in zip(signal.scale, signal.units, strict=True) if same_dimension(unit, "m")]
    return max(sizes, default=math.inf)


def length_tolerance(signal: Signal) -> float:
    """[m] by how much the replayed drives may move the lengths of the followed signal."""
    return min(LENGTH_TOLERANCE, LENGTH_SHARE * typical_length(signal))


def playback_tolerance(signal: Signal) -> np.ndarray:
    """(channels,) [SI] by how much the replayed drives may move each channel of the followed signal; 0 for one that is neither a
    length nor an angle, which the player does not judge."""
    tolerances = (("m", length_tolerance(signal)), ("rad", ANGLE_TOLERANCE))
    return np.array([next((a for base, a in tolerances if same_dimension(unit, base)), 0.0) for unit in signal.units])
