"""Friction alike both ways of a stage whose sensor, or amplifier, does not read zero is no friction that differs by direction."""

from __future__ import annotations

import pytest
from axis_records import AXIS, KF, K, runs_from_rest

import ctrlgen

REACH, FRICTION = 3e-6, 0.3  # m, N
LAWS = ("coulomb", "directional_friction", "home_offset", "drive_offset", "zero_per_record", "stribeck", "stiffening")


def rubbing(skew: float):
    """Dahl's friction, larger forward by `skew` of it once the contact has slid."""

    def force(now, q, v, memory):
        z, w, before = memory or (0.0, 0.0, 0.0)
        step = q - before
        z += (step - abs(step) * z) / REACH
        w += abs(step) * (1 - w) / REACH
        return -FRICTION * (z + skew * w), (z, w, q)

    return force


def diagnosed(force, zero: float):
    return ctrlgen.diagnose(AXIS, runs_from_rest(force, lambda y: y + zero), laws=LAWS, jobs=1)


@pytest.mark.long
@pytest.mark.parametrize("zero", [4e-7, -1.2e-6])
def test_a_sensor_that_does_not_read_zero_makes_no_friction_differ_by_direction(zero):
    answer = diagnosed(rubbing(0.0), zero)
    named = {f.effect: f for f in answer.findings}
    assert "coulomb" in named and "directional_friction" not in named
    assert named["coulomb"].parameters["force"].value == pytest.approx(FRICTION, rel=0.02)
    offset = next(f for f in answer.findings if f.effect in ("home_offset", "drive_offset"))
    told = {offset.effect, *(a.effect for a in offset.alternatives)}
    assert "home_offset" in told
    size = offset.parameters["offset"].value * (1e-6 if offset.effect == "home_offset" else KF / K)
    assert size == pytest.approx(zero, rel=0.05)


@pytest.mark.long
def test_friction_that_differs_by_direction_is_told_or_told_from_an_offset_by_nothing():
    answer = diagnosed(rubbing(0.3), 0.0)
    named = {f.effect for f in answer.findings} | {a.effect for f in answer.findings for a in f.alternatives}
    assert "directional_friction" in named and named & {"coulomb", "directional_friction", "drive_offset"}
