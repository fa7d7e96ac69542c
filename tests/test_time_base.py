"""A mass and a damping that are both off as a wrong clock makes them are told so; any others are not."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from fitted_causes import CREEP

from ctrlgen.diagnosis.report.time_base import time_base_step
from ctrlgen.estimation.hypothesis import Hypothesis

STATED = {"mass": 0.5, "damping": 30.0, "stiffness": 2e5, "force_constant": 10.0}


def said(times: dict[str, float], suspected=("mass", "damping"), sd: float = 0.02) -> list[str]:
    """What is said of an axis whose numbers are so many times what the file states, known to `sd` of themselves, of which those
    `suspected` are causes."""
    causes = [CREEP, *(Hypothesis("parameter", "stage:axis", "axis", path=f"mechanics.{name}") for name in suspected)]
    free = [SimpleNamespace(path=f"mechanics.{name}", nominal=STATED[name]) for name in times]
    theta = np.array([STATED[name] * r for name, r in times.items()])
    fit = SimpleNamespace(
        theta=theta, covariance=np.diag((sd * theta) ** 2), structure=SimpleNamespace(free_parameters=free)
    )
    return time_base_step(SimpleNamespace(search=SimpleNamespace(chosen=SimpleNamespace(causes=causes, fit=fit))))


@pytest.mark.parametrize(
    "clock, how", [(2.0, "2 times too long"), (0.5, "2 times too short"), (1.2, "1.2 times too long")]
)
@pytest.mark.parametrize("stiffness", [None, 1.1])
def test_a_clock_moves_mass_by_its_square_and_damping_by_itself(clock, how, stiffness):
    k = stiffness or 1.0
    numbers = {"mass": k * clock**2, "damping": k * clock} | ({"stiffness": k} if stiffness else {})
    (step,) = said(numbers)
    assert step.startswith("Check the time first: mechanics.mass and mechanics.damping are off") and how in step


@pytest.mark.parametrize(
    "numbers, suspected",
    [
        ({"mass": 4.0, "damping": 1.0}, ("mass", "damping")),
        ({"mass": 4.0, "damping": 3.0}, ("mass", "damping")),
        ({"mass": 4.0, "damping": 2.0}, ("mass",)),
        ({"mass": 1.1, "damping": 1.05}, ("mass", "damping")),
        ({"mass": 4.0, "damping": -2.0}, ("mass", "damping")),
    ],
)
def test_other_numbers_are_numbers(numbers, suspected):
    assert said(numbers, suspected) == []


def test_what_the_numbers_are_known_to_decides():
    numbers = {"mass": 4.0, "damping": 2.0 * 1.1}
    assert said(numbers, sd=0.01) == [] and len(said(numbers, sd=0.1)) == 1
