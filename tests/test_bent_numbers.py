"""A search does not drop a cause for numbers that the device file refuses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import AXIS, H, fitter_of

from ctrlgen.diagnosis.selection.pruning import is_needed
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


@pytest.mark.parametrize("slow", [True, False])
def test_a_cause_stays_where_only_numbers_beyond_the_file_do_without_it(slow):
    """A filter of a reading, of which stiffness, damping and mass far off their deviations do most; nothing, of which they need do none."""
    fitter = fitter_of(after=filtered) if slow else fitter_of()
    trials = Trials(fitter, Screen(fitter, [SLOW]), lambda _: None)
    bare = trials.fit(Structure(AXIS), steps=30)
    (current,) = trials.tried(
        Structure(AXIS).with_cause(SLOW, {"share": 0.9, "tau": 3e-3, "damping": 1.0}), SLOW, steps=30
    )
    # as where the bent numbers leave as little, which is little of a large mismatch
    trials.mismatch = 1e9 * bare.held_out.plain_mean * fitter.noise.floor**2
    bare = replace(bare, fitted=current.fitted, held_out=current.held_out)
    assert bool(contradicts_datasheet(bare.fit)) == slow and not contradicts_datasheet(current.fit)
    left = replace(current, errors=replace(current.errors, rms=np.full(1, 1e-9)))
    assert not left.errors.is_noise and not trials.selection.matters(bare, left)
    assert is_needed(trials, bare, left) == slow
