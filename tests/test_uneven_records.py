"""What is left of one record and not of another is no noise, however little else tells of the noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from axis_records import AXIS, NOISE, drive, move, record

from ctrlgen import diagnose
from ctrlgen.diagnosis.report.answer import sentence
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.recordings.recording import Recording

N, LAWS = 1000, ["sensor_step"]


def recorded(jumps: dict[int, float], sd=(NOISE, NOISE)) -> Recording:
    """A record to fit whose reading jumps [m] from rows on, and one to hold out that was set to zero anew; nothing tells the noise."""
    rng, drives = np.random.default_rng(1), (drive(N), drive(N, slow=1.1, fast=0.5))
    readings = [move(u) + s * rng.standard_normal(N) for u, s in zip(drives, sd, strict=True)]
    for row, jump in jumps.items():
        readings[0][row:] += jump
    parts = [record(u, y, r) for u, y, r in zip(drives, readings, ("fit", "hold_out"), strict=True)]
    parts[1] = replace(parts[1], time=parts[1].time + 1.0)
    return Recording("t", AXIS.name, "series", ("reading.axis",), ("um",), (None,), tuple(parts), ())


def test_counts_lost_in_one_record_alone_are_not_consistent():
    found = diagnose(AXIS, recorded({215: 2e-7, 495: -3e-7, 750: 5e-7}), laws=LAWS)
    assert found.verdict is Verdict.UNEXPLAINED
    assert "What is left of axis in fit is " in sentence(found) and "times what is left in hold_out" in sentence(found)


def test_noise_that_is_twice_as_large_in_one_record_may_be_noise():
    found = diagnose(AXIS, recorded({}, sd=(2 * NOISE, NOISE)), laws=LAWS)
    assert found.verdict is Verdict.CONSISTENT and not found.residual_tests.uneven
