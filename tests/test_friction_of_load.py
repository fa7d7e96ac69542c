"""Friction that grows with the load is told with what it is without one, and friction that does not stays plain."""

from __future__ import annotations

import pytest
from axis_records import AXIS, K, runs_from_rest

import ctrlgen

REACH = 2e-6  # m
LAWS = (
    *("coulomb", "friction_of_load", "directional_friction", "coulomb_above", "coulomb_below", "coulomb_on_stretch"),
    *("viscous_above", "stribeck", "bouc_wen", "quadratic_damping", "stiffening", "drive_offset"),
)


def rubbing(least: float, of_load: float):
    """Friction of `least` [N] and a share of the spring's force, of bristles that yield over 2 um."""

    def force(now, q, v, memory):
        z, before = memory or (0.0, 0.0)
        step = q - before
        z += (step - abs(step) * z) / REACH
        return -(least + of_load * abs(K * q)) * z, (z, q)

    return force


def diagnosed(force):
    return ctrlgen.diagnose(AXIS, runs_from_rest(force), laws=LAWS, jobs=1)


@pytest.mark.long
@pytest.mark.parametrize(("least", "of_load"), [(0.2, 0.06), (0.1, 0.03)])
def test_friction_that_grows_with_the_load_is_told_with_both_its_sizes(least, of_load):
    answer = diagnosed(rubbing(least, of_load))
    (main,) = [f for f in answer.findings if f.role == "cause"]
    assert main.effect == "friction_of_load"
    assert main.parameters["force"].value == pytest.approx(least, rel=0.05)
    assert main.parameters["force"].value / main.parameters["load"].value == pytest.approx(of_load, rel=0.05)


@pytest.mark.long
def test_friction_that_is_the_same_under_every_load_does_not_grow_with_it():
    """That it differs by direction by less than a thousandth, is a form of it too."""
    answer = diagnosed(rubbing(0.3, 0.0))
    (main,) = [f for f in answer.findings if f.role == "cause"]
    assert main.effect in {"coulomb", "directional_friction"} and answer.verdict == "explained"
    assert main.parameters["force"].value == pytest.approx(0.3, rel=0.01)
