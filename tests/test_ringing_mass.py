"""A stated mass that includes the part that rings contradicts nothing; any other that is off does."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from ctrlgen.diagnosis.selection.ringing_mass import ringing_masses
from ctrlgen.diagnosis.selection.verdict import contradicts_datasheet
from ctrlgen.estimation.hypothesis import Hypothesis

STIFFNESS, FREQUENCY = 5e4, 160.0
RINGS = STIFFNESS / (2 * np.pi * FREQUENCY) ** 2


def fitted(mass: float, unit: str = "kg", effect: str = "resonance", sd: float = 0.004):
    """A fit of a mass, stated as 0.5 to `sd`, beside a second one on a spring, whose numbers are known to 0.1 %."""
    ends = {"stiffness": (STIFFNESS, "N/m"), "frequency": (FREQUENCY, "Hz"), "damping": (0.03, "1")}
    free = [
        SimpleNamespace(path="mechanics.mass", name="value", unit=unit, nominal=0.5, sd=sd, cause=None, amplitude=False)
    ]
    free += [
        SimpleNamespace(
            path=f"effect[0].{name}", name=name, unit=u, nominal=0.0, sd=None, cause=0, amplitude=name == "stiffness"
        )
        for name, (_, u) in ends.items()
    ]
    theta = np.array([mass, *(value for value, _ in ends.values())])
    causes = (Hypothesis(effect, "stage:axis", "axis"),)
    return SimpleNamespace(
        theta=theta,
        covariance=np.diag((1e-3 * theta) ** 2),
        structure=SimpleNamespace(free_parameters=free, causes=causes),
        values=lambda k: {name: value for name, (value, _) in ends.items()},
    )


def test_what_rings_is_a_part_of_the_mass_that_the_file_states():
    fit = fitted(0.5 - RINGS)
    assert ringing_masses(fit) == {"mechanics.mass": pytest.approx(RINGS)}
    assert contradicts_datasheet(fit) == {}


@pytest.mark.parametrize(
    "fit",
    [
        fitted(0.5 + RINGS),  # more, not less
        fitted(0.5 - 2 * RINGS),
        fitted(0.5 - 0.5 * RINGS),
        fitted(0.5 - RINGS, unit="N*s/m"),  # no mass
        fitted(0.5 - RINGS, effect="vibration"),  # nothing that rings with the stage
    ],
)
def test_a_number_that_is_off_by_anything_else_contradicts_the_file(fit):
    assert not ringing_masses(fit) and contradicts_datasheet(fit)


def test_a_mass_where_the_file_has_it_includes_nothing():
    assert ringing_masses(fitted(0.5)) == {} == contradicts_datasheet(fitted(0.5))
