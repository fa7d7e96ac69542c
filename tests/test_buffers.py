"""A rubber stop is found as a buffer that takes energy away, and a spring that is touched stays a stop."""

from __future__ import annotations

import numpy as np
import pytest
from axis_records import AXIS, runs_from_rest

import ctrlgen

LAWS = (
    *("end_stop", "damped_stop", "stiffness_above", "stiffness_below", "stiffness_beyond", "viscous_above"),
    *("viscous_below", "coulomb_above", "coulomb_below", "coulomb", "stiffening", "quadratic_damping", "resonance"),
)


def touched(spring: float, damper: float, edge: float):
    """A spring [N/m] and a dashpot [N*s/m] side by side, from `edge` [m] on, which push and never pull."""

    def force(now, q, v, memory):
        side = np.sign(edge)
        deep = side * (q - edge)
        return (-side * max(spring * deep + damper * side * v, 0.0) if deep > 0 else 0.0), 0.0

    return force


def diagnosed(force):
    return ctrlgen.diagnose(AXIS, runs_from_rest(force), laws=LAWS, jobs=1)


@pytest.mark.long
@pytest.mark.parametrize("edge", [2.2e-5, -1.8e-5])
def test_rubber_is_a_buffer_with_a_loss(edge):
    """Of a spring and a dashpot, which is not its own form: the place is told to a tenth, the stiffness to a third."""
    answer = diagnosed(touched(1.5e5, 500.0, edge))
    main = answer.findings[0]
    assert main.effect == "damped_stop" and main.share.value > 0.9
    assert main.parameters["gap"].value == pytest.approx(1e6 * edge, rel=0.1)
    assert main.parameters["stiffness"].value == pytest.approx(0.15, rel=0.35)


@pytest.mark.long
def test_a_spring_that_is_touched_is_a_stop():
    answer = diagnosed(touched(1.5e5, 0.0, 2.2e-5))
    assert [f.effect for f in answer.findings] == ["end_stop"] and answer.verdict == "explained"
