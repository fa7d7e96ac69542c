"""A curve that levels off is told from a limit that is run into, and from a cubic: each by what the other leaves."""

from __future__ import annotations

import numpy as np
import pytest
from axis_records import AXIS, H, axis_fitter, move
from misfits import recovered

from ctrlgen.diagnosis.selection.model_selection import ModelSelection
from ctrlgen.diagnosis.selection.objections import another_law
from ctrlgen.estimation.hypothesis import Hypothesis

N = 900
T = np.arange(N) * H
DRIVE = 1.5 * np.sin(2 * np.pi * 9 * T) + 0.4 * np.sin(2 * np.pi * 31 * T)
HARD, SOFT = (Hypothesis(kind, "actuator:axis", "axis") for kind in ("saturation", "soft_saturation"))
CUBIC, LEVELS = (Hypothesis(kind, "sensor:axis", "axis") for kind in ("cubic_sensor", "sensor_saturation"))


def fits(read, *causes):
    """The fitter of one record of a `read` (drive -> reading), and what each cause comes to on it."""
    fitter = axis_fitter(u=DRIVE, change=lambda y, u: read(u))
    return fitter, [recovered(fitter, AXIS, cause)[1] for cause in causes]


def left(candidate) -> float:
    """Squares of what it leaves of the record to fit, a sample, in those of noise."""
    return float(np.sum(candidate.fitted.plain) / np.sum(candidate.fitted.n_plain))


@pytest.mark.long
@pytest.mark.parametrize("curve", [lambda u: 1.4 * np.tanh(u / 1.4), lambda u: u / (1 + np.abs(u) / 4)])
def test_a_drive_that_levels_off_is_no_limit_that_is_run_into(curve):
    _, (hard, soft) = fits(lambda u: move(curve(u)), HARD, SOFT)
    assert left(hard) > 20 * left(soft)
    assert another_law(soft.fit, 0) is None


@pytest.mark.long
def test_a_limit_that_is_run_into_ends_the_curve_at_its_sharpest_where_it_is_that_limit():
    _, (hard, soft) = fits(lambda u: move(np.clip(u, -1.2, 1.2)), HARD, SOFT)
    assert left(hard) < 0.1 * left(soft)
    assert "`saturation`" in another_law(soft.fit, 0)


@pytest.mark.long
@pytest.mark.parametrize(
    "way, first", [(lambda y: y - 5e6 * y**3, CUBIC), (lambda y: 9e-5 * np.tanh(y / 9e-5), LEVELS)]
)
def test_a_cubic_reading_and_one_that_levels_off_keep_their_names(way, first):
    fitter, (cubic, levels) = fits(lambda u: way(move(u)), CUBIC, LEVELS)
    compare = ModelSelection(fitter, lambda *_, **__: [])
    assert compare.ranked([cubic, levels])[0].causes == (first,)
