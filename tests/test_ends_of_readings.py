"""Readings that pile up where a sensor ends: the pile is seen, what else is left out is found beside the limit, and a stop is no limit."""

from __future__ import annotations

import numpy as np
import pytest
from axis_records import AXIS, record, runs_from_rest

import ctrlgen
from ctrlgen.diagnosis.selection.ends_of_readings import piled_ends

CUBIC = 4e13  # N/m^3
LAWS = (
    *("stiffening", "cubic_sensor", "sensor_saturation", "soft_saturation", "sensor_limit", "end_stop"),
    *("stiffness_above", "one_sided_saturation", "stiffness_beyond", "cyclic", "home_offset", "local_error"),
)


def diagnosed(force, limit: tuple[float, float]):
    """The answer for an axis under another `force`, whose sensor reads within `limit` [m]; its noise is behind that."""
    return ctrlgen.diagnose(AXIS, runs_from_rest(force, lambda y: np.clip(y, *limit)), laws=LAWS, jobs=1)


def stiffer(now, q, v, memory):
    return -CUBIC * q**3, 0.0


@pytest.mark.long
def test_what_else_is_left_out_is_found_beside_the_limit_of_the_sensor():
    """A cubic spring looks like one that levels off together with the limit, and is none of the laws that take most away alone."""
    answer = diagnosed(stiffer, (-1.0, 3.1e-5))
    found = {f.effect: f for f in answer.findings}
    assert answer.verdict == "explained" and set(found) == {"stiffening", "sensor_limit"}
    assert found["stiffening"].parameters["k3"].value == pytest.approx(CUBIC * 1e-18, rel=0.02)
    assert found["sensor_limit"].parameters["level"].value == pytest.approx(31.0, abs=0.01)


@pytest.mark.long
def test_a_stop_that_hardly_gives_is_no_limit_of_the_sensor():
    """The reading stands there too, and the stage comes away from a stop later than a sensor that has lost it finds it again."""

    def stopped(now, q, v, memory):
        return -2e6 * max(q - 3.1e-5, 0.0), 0.0

    answer = diagnosed(stopped, (-1.0, 1.0))
    assert answer.findings[0].effect == "end_stop"


@pytest.mark.parametrize(
    ("high", "low", "told"),
    [(1.0, -1.0, []), (0.9, -1.0, [0.9]), (1.0, -0.8, [-0.8]), (0.95, -0.9, [0.95, -0.9]), (0.99999, -1.0, [])],
)
def test_a_pile_is_told_from_a_motion_that_turns(high, low, told):
    """A thousandth of a per cent is less than the noise."""
    rng = np.random.default_rng(1)
    u = np.sin(2 * np.pi * 0.011 * np.arange(3000))
    part = record(u, np.clip(u, low, high) + 1e-3 * rng.standard_normal(3000), "fit")
    assert piled_ends([part], 0, 1e-3) == pytest.approx(told, abs=1e-3)


@pytest.mark.parametrize(("high", "told"), [(0.97, False), (0.93, True)])
def test_a_little_more_than_a_motion_that_turns_is_no_pile(high, told):
    """Of noise that hides it: at ends of 0.97 and 0.93 are five and ten times as many as beside them, at that of a sine two."""
    rng = np.random.default_rng(1)
    u = np.sin(2 * np.pi * 0.011 * np.arange(3000))
    part = record(u, np.minimum(u, high) + 2e-3 * rng.standard_normal(3000), "fit")
    assert bool(piled_ends([part], 0, 2e-3)) is told


@pytest.mark.parametrize(("noise", "told"), [(0.005, True), (0.05, False), (0.3, False)])
def test_a_sensor_that_reads_little_more_than_noise_has_no_ends(noise, told):
    rng = np.random.default_rng(1)
    u = 3 * np.sin(2 * np.pi * 0.011 * np.arange(3000))
    part = record(u, np.clip(u, -0.9, 0.9) + noise * rng.standard_normal(3000), "fit")
    assert bool(piled_ends([part], 0, noise)) is told


def test_a_drive_that_dwells_there_makes_no_pile():
    rng = np.random.default_rng(1)
    u = np.clip(np.sin(2 * np.pi * 0.011 * np.arange(3000)), -1.0, 0.9)
    part = record(u, u + 1e-3 * rng.standard_normal(3000), "fit")
    assert piled_ends([part], 0, 1e-3) == []
    # without noise nothing says how near is near
    assert piled_ends([part], 0, 0.0) == []
