"""Fits begin on the beginning of long records, where that is driven as the rest is, and end on all samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import AXIS, NOISE, H, axis_fitter, drive, record

from ctrlgen.estimation import fit as fits
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.leading_part import leading_part
from ctrlgen.estimation.least_squares import LeastSquaresProblem
from ctrlgen.estimation.settings import LEADING_PART
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Recording

LONG = 4 * LEADING_PART.shortest
CUBIC = Hypothesis("cubic_sensor", "sensor:axis", "axis")
EVENT = Hypothesis("sensor_step", "disturbance:axis", "axis")
BENT = Structure(AXIS).with_cause(CUBIC, {"curvature": 1e6})


def recorded(u: np.ndarray, y: np.ndarray | None = None, kind: str = "series") -> Recording:
    records = tuple(record(u, u if y is None else y, role) for role in ("fit", "hold_out"))
    return Recording("t", AXIS.name, kind, ("reading.axis",), ("um",), (NOISE,), records, ())


def lengths(recording: Recording) -> list[int] | None:
    part = leading_part(recording)
    return None if part is None else [len(r.time) for r in part.records]


def test_a_part_is_as_long_as_what_drives_the_rest_takes():
    u = drive(LONG)
    assert lengths(recorded(u)) == [LONG // 4]
    grown = np.where(np.arange(LONG) < 0.3 * LONG, 0.3, 1.0)
    assert lengths(recorded(u * grown)) == [LONG // 2]
    # a drive that goes farther late, a reading that does, and one that only changes faster
    late = np.where(np.arange(LONG) < 0.6 * LONG, 0.3, 1.0)
    faster = np.sin(2 * np.pi * np.cumsum(np.where(late < 1, 2.0, 20.0)) * H)
    assert lengths(recorded(u * late)) is lengths(recorded(u, u * late)) is lengths(recorded(faster)) is None


def test_short_records_and_poses_have_no_part():
    assert lengths(recorded(drive(LONG - 4))) == [LONG // 2 - 2]
    assert lengths(recorded(drive(LONG // 2 - 2))) is lengths(recorded(drive(LONG), kind="poses")) is None


def test_a_part_is_a_beginning_with_its_marks():
    u = drive(LONG)
    whole = recorded(u)
    valid = np.ones((LONG, 1), bool)
    valid[7] = False
    fit = replace(whole.records[0], valid=valid, ambient=np.sin(u), spikes=((7, 0, 1.0),))
    part = leading_part(replace(whole, records=(fit, whole.records[1]))).records[0]
    n = LONG // 4
    assert not part.valid[7] and part.valid.sum() == n - 1 and part.spikes == ()
    assert np.array_equal(part.drive[:, 0], u[:n]) and np.array_equal(part.ambient, np.sin(u[:n]))


def bent(y: np.ndarray, u: np.ndarray) -> np.ndarray:
    """A reading that is off by a hundredth at 70 um."""
    return y + 2e6 * y**3


def descent(monkeypatch, fitter, structure: Structure, begin=leading_part):
    """A fit, begun on the part that `begin` tells, and on how many samples slopes were taken."""
    samples, real = [], LeastSquaresProblem.evaluate
    with monkeypatch.context() as patched:
        patched.setattr(fits, "leading_part", begin)
        patched.setattr(
            LeastSquaresProblem, "evaluate", lambda self, x: samples.append(len(self.records[0].time)) or real(self, x)
        )
        return fitter.fit(structure, steps=16), samples


def on_all(recording: Recording) -> None:
    """No part to begin on."""


def test_a_fit_goes_most_of_its_way_on_the_part_and_ends_where_it_would(monkeypatch):
    fitter = axis_fitter(n=LONG, change=bent)
    found, samples = descent(monkeypatch, fitter, BENT)
    wanted, without = descent(monkeypatch, fitter, BENT, on_all)
    # a step that promises less ends a descent
    assert found.objective == pytest.approx(wanted.objective, abs=0.05)
    sd = np.sqrt(np.diag(wanted.covariance))
    assert np.all(np.abs(found.theta - wanted.theta) < 0.1 * sd)
    part = LONG // 4
    assert samples.count(part) >= 3 and samples[3:].count(part) == 0 and samples.count(LONG) < len(without)
    assert len(found.residual) == len(wanted.residual)


def test_what_happens_behind_the_part_is_found_in_all_samples(monkeypatch):
    late = axis_fitter(n=LONG, change=lambda y, u: y + 20 * NOISE * (np.arange(len(u)) > 0.6 * LONG))
    step = {"offset": 5 * NOISE, "moment": 0.61 * LONG * H, "rise": 0.01}
    event = Structure(AXIS).with_cause(EVENT, step)
    found, wanted = (descent(monkeypatch, late, event, begin)[0] for begin in (leading_part, on_all))
    assert found.objective < 1.02 * wanted.objective < 0.1 * late.fit(Structure(AXIS)).objective


def test_starts_are_compared_on_the_part():
    fitter = axis_fitter(n=LONG, change=bent)
    near, far = (BENT.restarted(0, {"curvature": c}) for c in (1.8e6, 1e6))
    rough, whole = ([f(s) for s in (near, far)] for f in (fitter.rough_objective, fitter.initial_objective))
    assert rough[0] < rough[1] and whole[0] < whole[1]
    assert rough[1] == pytest.approx(whole[1] / 4, rel=0.3)
