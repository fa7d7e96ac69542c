"""Where along a motion most of a residual is: edges on either side, none where it is alike everywhere."""

from __future__ import annotations

import numpy as np
import pytest

from ctrlgen.diagnosis.selection.regions import region_edges
from ctrlgen.diagnosis.settings import REGIONS

PLACES = np.random.default_rng(4).uniform(-1.0, 1.0, 6400)
CELL = 2.0 / REGIONS.cells


def squares(inside: np.ndarray, ratio: float) -> np.ndarray:
    """Of normal noise whose variance is `ratio` times as large inside."""
    noise = np.random.default_rng(5).standard_normal(len(PLACES)) ** 2
    return noise * np.where(inside, ratio, 1.0)


@pytest.mark.parametrize("edge", [-0.7, 0.0, 0.6])
@pytest.mark.parametrize("side", [1, -1])
def test_an_edge_is_found_to_a_cell_on_its_side_alone(edge, side):
    given = squares(side * (PLACES - edge) > 0, 20.0)
    first, *_ = region_edges(PLACES, given, side)
    assert first == pytest.approx(edge, abs=1.5 * CELL)
    assert region_edges(PLACES, given, -side) == ()


@pytest.mark.parametrize("ratio, seen", [(1.0, False), (1.3, False), (2.0, True)])
def test_a_region_holds_half_as_much_again_at_least(ratio, seen):
    assert REGIONS.least_ratio == 1.5
    assert bool(region_edges(PLACES, squares(PLACES > 0.2, ratio), 1)) == seen


def test_a_few_outliers_are_no_region():
    given = squares(PLACES > 2.0, 1.0)
    given[np.argsort(PLACES)[-5:]] = 1e6
    assert region_edges(PLACES, given, 1) == ()


def test_a_drive_that_stands_or_a_short_record_has_no_edges():
    assert region_edges(np.zeros(6400), squares(PLACES > 0, 20.0), 1) == ()
    few = REGIONS.cells * REGIONS.fewest_in_cell - 1
    assert region_edges(PLACES[:few], squares(PLACES > 0, 20.0)[:few], 1) == ()
