"""A law in a region that no residual shows is tried all the same, and gives way to a law everywhere that leaves about as little."""

from __future__ import annotations

from dataclasses import replace
from math import tanh

import numpy as np
import pytest
from axis_records import AXIS, axis_fitter

from ctrlgen.diagnosis.selection.candidates import fit_each, fit_in_regions, significant
from ctrlgen.diagnosis.selection.model_selection import scored
from ctrlgen.diagnosis.selection.precedence import everywhere_first
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.estimation.hypothesis import Hypothesis

EDGE, FRICTION, REACH = -1e-6, 0.15, 1e-7  # m, N, m
OFFERED = [Hypothesis(law, "stage:axis", "axis") for law in ("coulomb", "coulomb_above", "coulomb_below")]


def friction(time, q, v, memory):
    """Dry friction in the upper half of the travel."""
    z, before = memory or (0.0, 0.0)
    step = q - before
    z = min(max(z + step / REACH, -1.0), 1.0)
    return -FRICTION * z * (1 + tanh((q - EDGE) / 1e-7)) / 2, (z, q)


@pytest.fixture(scope="module")
def tried():
    fitter, described = axis_fitter(friction, n=1500).described(AXIS)
    trials = Trials(fitter, Screen(fitter, OFFERED), lambda _: None)
    current = scored(fitter, described)
    screened = trials.screened(current)
    everywhere = fit_each(trials, described, significant(trials, current, screened))
    return trials, current, screened, everywhere, fit_in_regions(trials, current, screened, everywhere)


@pytest.mark.long
def test_friction_in_half_of_the_travel_is_tried_there(tried):
    trials, _, _, everywhere, regional = tried
    best = trials.selection.ranked([*everywhere, *regional])[0]
    assert [c.effect for c in best.causes] == ["coulomb_above"]
    assert best.fit.values(0)["edge"] == pytest.approx(EDGE, abs=2e-7)
    assert best.fit.values(0)["force"] == pytest.approx(FRICTION, rel=0.03)
    plain = next(t for t in everywhere if t.causes[0].effect == "coulomb")
    assert np.all(best.held_out.plain_mean < 0.1 * plain.held_out.plain_mean)


@pytest.mark.long
def test_beside_a_cause_a_region_must_show_itself(tried):
    trials, _, screened, everywhere, _ = tried
    assert fit_in_regions(trials, everywhere[0], screened, everywhere) == ()


@pytest.mark.long
def test_it_comes_before_a_law_everywhere_where_it_leaves_a_quarter(tried):
    trials, current, screened, everywhere, regional = tried
    best = trials.converged(trials.selection.ranked(regional)[0])
    plain = trials.converged(next(t for t in everywhere if t.causes[0].effect == "coulomb"))
    hidden = replace(screened, suspects=tuple(s for s in screened.suspects if not s.hypothesis.prior.in_a_region))
    assert everywhere_first(trials, current, best, (plain, best), hidden) is best
    # its form alone is in error
    near = replace(plain, fitted=replace(plain.fitted, plain=2 * best.fitted.plain))
    near = replace(near, held_out=replace(near.held_out, plain=2 * best.held_out.plain))
    trials.fitted[frozenset(near.causes)] = (near, 40)
    chosen = everywhere_first(trials, current, best, (near, best), hidden)
    assert [c.effect for c in chosen.causes] == ["coulomb"]
    # friction comes to rest in held-out records where nobody can predict it: both kinds count together
    there = replace(plain, fitted=replace(plain.fitted, plain=20 * best.fitted.plain))
    there = replace(there, held_out=replace(there.held_out, plain=2.5 * best.held_out.plain))
    trials.fitted[frozenset(there.causes)] = (there, 40)
    assert everywhere_first(trials, current, best, (there, best), hidden) is best
    trials.fitted[frozenset(near.causes)] = (near, 40)
    # a region that the residual shows stands
    assert (
        everywhere_first(
            trials,
            current,
            best,
            (near, best),
            replace(
                screened, suspects=tuple(s for s in trials.screen.in_regions(current.fit, {"stage:axis"}).suspects)
            ),
        )
        is best
    )
