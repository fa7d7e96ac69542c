"""A force constant that falls along the travel is told from a stiffening flexure where drive and place part, and is its rival elsewhere."""

from __future__ import annotations

import numpy as np
import pytest
from axis_records import AXIS, KF, H, K, axis_fitter
from misfits import recovered

from ctrlgen.estimation.hypothesis import Hypothesis

pytestmark = pytest.mark.long
N, FALL, CENTRE = 700, 0.08 / 5e-5**2, 5e-6
K3 = K * FALL  # as much at the same place in balance
COIL, FLEXURE = (Hypothesis(kind, "stage:axis", "axis") for kind in ("force_factor", "stiffening"))
T = np.arange(N) * H
FAST = 1.1 * np.sin(2 * np.pi * 9 * T) + 0.6 * np.sin(2 * np.pi * 83 * T)
SLOW = 1.1 * np.sin(2 * np.pi * 3 * T)


def coil(u, centre=CENTRE):
    def force(t, q, v, memory):
        place = q + v * H / 20 - centre  # in the middle of a step
        return -KF * u[min(int(t / H + 1e-6), N - 1)] * FALL * place**2, memory

    return force


def flexure(u):
    return lambda t, q, v, memory: (-K3 * (q + v * H / 20) ** 3, memory)


def left(force, u, cause) -> float:
    """Squares of what the cause leaves of the record to fit, a sample, in those of noise."""
    _, candidate = recovered(axis_fitter(force, u=u), AXIS, cause)
    return float(np.sum(candidate.fitted.plain) / np.sum(candidate.fitted.n_plain))


@pytest.mark.parametrize(("acts", "right", "wrong"), [(coil, COIL, FLEXURE), (flexure, FLEXURE, COIL)])
def test_where_drive_and_place_part_each_is_told_from_the_other(acts, right, wrong):
    """But for what the planted force misses, which is held for a tenth of a sample."""
    force = acts(FAST)
    assert left(force, FAST, right) < 2.0 and left(force, FAST, wrong) > 100.0


def test_in_slow_motion_a_stiffness_takes_the_place_of_a_force_that_falls():
    """In balance k d = k_f (1 - b d^2) u is (k + k b d^2) d = k_f u to first order: the other law leaves a tenth of the deviation that is
    left where drive and place part, at most."""
    slow, fast = (left(coil(u, 0.0), u, FLEXURE) for u in (SLOW, FAST))
    assert slow < 0.01 * fast
