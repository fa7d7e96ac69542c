"""A speed at which a contact creeps hardly shows in a record that never rests, and decides what is foretold of one that does."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from axis_records import AXIS, NOISE, H, move, record
from recovery import fitter_of

from ctrlgen.diagnosis.selection.begun_again import begun_again
from ctrlgen.diagnosis.selection.candidates import restart_elsewhere
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.search import Searcher
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.priors import prior_of
from ctrlgen.estimation.structure import Structure

N, FINE = 600, 40
FORCE, REACH, BRISTLES = 0.5, 5e-8, 8e-5  # N, m, and s: damping of the bristles over their stiffness
FRICTION = Hypothesis("coulomb_above", "stage:axis", "axis")


def rubbing(u: np.ndarray) -> np.ndarray:
    """Above home LuGre's bristles, bent exactly within a step, whose damping fades with the speed; under a load they do not creep."""

    def force(time, q, v, memory):
        z, before = memory or (0.0, 0.0)
        end = np.sign(q - before) * REACH
        bent = end + (z - end) * np.exp(-abs(q - before) / REACH)
        damped = BRISTLES * (bent - z) * FINE / H * np.exp(-((v / 1e-4) ** 2))
        return -FORCE / REACH * (bent + damped) * (q > 0), (bent, q)

    return move(u, force, fine=FINE)


def test_friction_that_creeps_in_the_fit_alone_is_begun_again_without():
    rng, parts = np.random.default_rng(1), []
    t, f = H * np.arange(N), 1.7 * np.arange(1, 61)
    for role in ("fit", "hold_out"):
        u = np.cos(2 * np.pi * np.outer(t, f) + rng.uniform(0, 2 * np.pi, len(f))) @ (1 + f / 10) ** -0.5
        u *= 0.8 / np.abs(u).max()
        if role == "hold_out":
            u = u[np.arange(N) // 200 * 200]  # rests for 0.2 s
        parts.append(record(u, rubbing(u) + NOISE * rng.standard_normal(N), role))
    fitter = fitter_of(AXIS, ("reading.axis",), ("um",), (NOISE,), "series", parts)
    trials = Trials(fitter, Screen(fitter, [FRICTION]), lambda _: None)
    begun = {"force": FORCE, "reach": REACH, "smoothing": 3e-5, "edge": 0.0, "width": 2e-7}
    creeping = trials.fit(Structure(AXIS).with_cause(FRICTION, begun), FRICTION, steps=40)
    trials.use(fitter.with_errors_of(creeping.fit))
    creeping = trials.fit(creeping.fit.restarted, FRICTION, steps=40)
    still = begun_again(trials, creeping)
    # the fit prefers by a little what is wrong by far
    assert still.fit.objective > creeping.fit.objective and still.fit.values(0)["smoothing"] < 1e-7
    assert still.held_out.plain_mean[0] < 0.05 * creeping.held_out.plain_mean[0]
    assert still.fitted.plain_mean[0] == pytest.approx(creeping.fitted.plain_mean[0], rel=0.2)
    # later fits go on from there, and it is not begun there again
    assert trials.fit(still.fit.restarted, FRICTION, steps=0) is not creeping
    assert trials.fitted[frozenset(still.causes)][0] is still
    # where candidates are begun elsewhere, and where a model is fitted to its end
    before, nothing = trials.fit(Structure(AXIS)), SimpleNamespace(suspects=())
    assert restart_elsewhere(trials, creeping, before, nothing).fit.values(0)["smoothing"] < 1e-7
    searcher = Searcher(trials.fitter, trials.screen, lambda _: None)
    assert searcher.best_settled(creeping).fit.values(0)["smoothing"] < 1e-7
    fits = len(trials.log)
    assert begun_again(trials, creeping, known=(FRICTION,)) is creeping and len(trials.log) == fits
    assert begun_again(trials, still).fit.values(0)["smoothing"] < 1e-7


def test_every_law_with_a_creep_is_begun_again_at_its_lower_bound():
    laws = ("coulomb", "coulomb_above", "coulomb_below", "coulomb_after")
    for law in (Hypothesis(kind, "stage:axis", "axis").law for kind in laws):
        (smoothing,) = (p for p in law.params if prior_of(law).of(p).again_at_low)
        assert smoothing.name == "smoothing" and smoothing.bounds[0] > 0
