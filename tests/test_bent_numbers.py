"""A search that ends without causes does not drop them for numbers that the device file refuses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import AXIS, H, fitter_of

from ctrlgen.diagnosis.selection.bent_numbers import not_bent_away
from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.diagnosis.selection.verdict import contradicts_datasheet
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.structure import Structure

SLOW = Hypothesis("low_pass", "sensor:axis", "axis")


def filtered(y: np.ndarray, tau: float = 3e-3) -> np.ndarray:
    """A reading that a filter with two equal poles makes slow."""
    out, first, second = np.empty_like(y), 0.0, 0.0
    for k, value in enumerate(y):
        first += (1 - np.exp(-H / tau)) * (value - first)
        second += (1 - np.exp(-H / tau)) * (first - second)
        out[k] = second
    return out


def bent(model: CandidateModel, by: float) -> CandidateModel:
    """The model with its stated numbers moved by so many of their stated deviations."""
    free = model.fit.structure.free_parameters
    theta = np.array([u.nominal + by * u.sd if u.sd else v for u, v in zip(free, model.fit.theta, strict=True)])
    return replace(model, fit=replace(model.fit, theta=theta))


@pytest.mark.parametrize("slow, by, stays", [(True, 20.0, True), (True, 0.5, False), (False, 20.0, False)])
def test_an_accepted_cause_stays_where_only_numbers_beyond_the_file_do_without_it(slow, by, stays):
    """Not where the numbers are within the file, and not where it takes nothing away."""
    fitter = fitter_of(after=filtered) if slow else fitter_of()
    trials = Trials(fitter, Screen(fitter, [SLOW]), lambda _: None)
    nominal = trials.fit(Structure(AXIS), steps=20)
    (accepted,) = trials.tried(
        Structure(AXIS).with_cause(SLOW, {"share": 0.9, "tau": 3e-3, "damping": 1.0}), SLOW, steps=20
    )
    bare = bent(nominal, by)
    assert bool(contradicts_datasheet(bare.fit)) == (by > 4)
    answer = not_bent_away(trials, nominal, bare, accepted)
    assert (answer.causes == (SLOW,)) == stays and (stays or answer is nominal)
    assert not_bent_away(trials, nominal, bare, nominal) is nominal
