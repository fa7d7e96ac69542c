"""What the replayed drives of a solution may leave of it: the tolerance that the player's tables are made to."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ctrlgen.core.units import same_dimension

LENGTH_TOLERANCE, ANGLE_TOLERANCE = 1e-10, 1e-8  # m, rad: error of the followed signal that compression may cause


def playback_tolerance(units: Sequence[str]) -> np.ndarray:
    """(channels,) [SI] by how much the replayed drives may move each channel of the followed signal; 0 for one that is neither a
    length nor an angle, which the player does not judge."""
    tolerances = (("m", LENGTH_TOLERANCE), ("rad", ANGLE_TOLERANCE))
    return np.array([next((a for base, a in tolerances if same_dimension(unit, base)), 0.0) for unit in units])
