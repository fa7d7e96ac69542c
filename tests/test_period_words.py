"""How often a period repeats in a turn or a millimetre, in every number that is told of one."""

from __future__ import annotations

import pytest

from ctrlgen.diagnosis.report.narrative import interval
from ctrlgen.diagnosis.report.period_words import pitch, repeats
from ctrlgen.diagnosis.selection.findings import Estimate


@pytest.mark.parametrize(
    ("period", "unit", "often"),
    [
        (5.0, "deg", "72 a turn"),
        (5.02, "deg", "71.7 a turn"),
        (87.27, "mrad", "72 a turn"),
        (360.0, "deg", "1 a turn"),
        (400.0, "deg", ""),
        (0.25, "mm", "4 a mm"),
        (250.0, "um", "4 a mm"),
        (-0.3, "mm", "3.3 a mm"),
        (316.4, "nm", "3161 a mm"),
        (1.0, "mm", "1 a mm"),
        (2.0, "mm", ""),
        (0.25, "s", ""),
        (0.25, "V", ""),
        (0.0, "mm", ""),
        (float("nan"), "mm", ""),
    ],
)
def test_a_period_repeats_so_often(period, unit, often):
    assert repeats(period, unit) == often


def test_a_pitch_is_told_in_the_unit_of_its_axis():
    assert pitch(0.25e-3, "um") == "a pitch of 250 um (4 a mm)" and pitch(2e-3, "mm") == "a pitch of 2 mm"
    assert pitch(0.25, "") == "a pitch"


def test_the_period_of_a_law_is_told_with_how_often_it_repeats():
    e = Estimate(5.0, (4.98, 5.02), "deg")
    assert interval(e, "period") == "5 deg (4.98 ... 5.02 deg), 72 a turn"
    assert interval(e, "phase") == interval(e) == "5 deg (4.98 ... 5.02 deg)"
    assert interval(Estimate(0.25, (0.24, 0.26), "s"), "period") == "250 ms (240 ... 260 ms)"


@pytest.mark.parametrize(
    ("half", "name", "told"), [(179.0, "phase", True), (180.0, "phase", False), (210.0, "angle", True)]
)
def test_a_phase_that_may_be_any_has_no_interval(half, name, told):
    """After a turn it comes again: a wider interval says nothing. An angle that is no phase goes on."""
    said, none = (interval(Estimate(2.0, (2.0 - w, 2.0 + w), "deg"), name) for w in (half, float("inf")))
    assert (said != none) == told
