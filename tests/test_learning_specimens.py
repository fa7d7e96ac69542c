"""Learning on specimens of the independent plant whose sensors, clocks, zeros, noise and friction are wrong; see docs/evidence.md."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("exudyn", reason="no Exudyn: learning needs the independent plant; pip install ctrlgen[plant]")

from learning_bench import shortened, solved
from learning_specimens import Outcome, battery

from ctrlgen.learning.lifted import Lifted

PATH = {"sample_rate": "200 Hz", "duration": "1 s"}


@pytest.mark.long
def test_the_true_error_falls_and_runs_of_another_path_are_refused(tmp_path):
    """Sixteen specimens: each fault twice, with a sensor from a data sheet and with a calibrated one."""
    circle = Lifted(solved(shortened("circle20", tmp_path / "circle20", **PATH)))
    smaller = solved(shortened("circle20", tmp_path / "smaller", diameter="14 um", **PATH))
    outcomes = battery(range(16), circle, smaller.drive, tmp_path)
    check(outcomes)


def check(outcomes: list[Outcome]) -> None:
    """What is asked of any sample of specimens."""
    assert not [o.seed for o in outcomes if o.wrongly_refused]
    assert [o.refused for o in outcomes] == [o.fault in ("path", "reading") for o in outcomes]
    assert all(o.errors[-1] < o.errors[0] for o in outcomes)
    # calibrated without friction: 0.02 % is 2 nm of 10 um, what 25 periods of 20 nm leave of noise is 1 nm
    free = [o.errors[-1] for o in outcomes if o.calibrated and not o.friction]
    assert np.median(free) < 0.03
