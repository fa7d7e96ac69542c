"""What the figures of a diagnosis show: the readings with the largest error, where it is largest."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from ctrlgen.diagnosis.report.plot_readings import worst_readings, worst_stretch


def residuals_of(parts: list[np.ndarray], floors: list[float | None], settled: bool = False) -> SimpleNamespace:
    """Residuals of records that read nothing else, as the figures see them."""
    names = tuple(f"r{i}" for i in range(parts[0].shape[1]))
    return SimpleNamespace(
        before=parts,
        after=parts,
        records=[SimpleNamespace(observed=part) for part in parts],
        recording=SimpleNamespace(channels=names),
        scales=[1.0] * len(names),
        settled=settled,
        floor=floors.__getitem__,
    )


def test_the_stretch_that_is_shown_is_where_the_error_is_largest():
    quiet, loud = np.full((1000, 2), 0.1), np.full((1000, 2), 0.1)
    loud[600:700, 1] = 5.0
    loud[650:660, 1] = np.nan  # marked samples are no error
    residuals = residuals_of([quiet, loud], [1.0, 1.0])
    record, stretch = worst_stretch(residuals, residuals.before, 1)
    assert record == 1
    assert stretch.start <= 600 and stretch.stop >= 700 and stretch.stop - stretch.start == 200
    poses = residuals_of([loud[590:640]], [1.0, 1.0], settled=True)
    _, few = worst_stretch(poses, poses.before, 1)
    assert few.start >= 10 and few.stop - few.start == 12


def test_readings_with_the_largest_error_over_their_noise_are_drawn():
    part = np.ones((50, 5)) * [1.0, 2.0, 3.0, 4.0, 5.0]
    assert worst_readings(residuals_of([part], [1.0] * 5)) == [2, 3, 4]
    assert worst_readings(residuals_of([part], [0.01, 1.0, 1.0, 1.0, 1.0])) == [0, 3, 4]
