"""Profiles of numbers that trade against one another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from axis_records import AXIS, H, K, axis_fitter

from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.profile_likelihood import ABOVE, profiles
from ctrlgen.estimation.settings import PROFILE
from ctrlgen.estimation.structure import Structure

CREEP = Hypothesis("creep", "stage:axis", "axis")


def creeping(t, q, v, memory, gain=4e-4, tau=2.0, fine=10):
    """The stage yields by gain of the displacement, with the time constant tau: as a force of k times that."""
    return K * gain * memory, memory + H / fine / tau * (q - memory)


def test_ends_of_a_profile_are_those_of_the_best_fit_beside_them():
    """Gain and time constant of a creep that is seen for a third of its time trade against one another, along a curve: refitted by a
    step or two, the profile of the gain ended 20 % away; and that of the time constant at its bound, where the objective is up by 1e5."""
    fitter = axis_fitter(creeping, u=1.5 * np.minimum(np.arange(600) * H / 0.05, 1.0))
    fit = fitter.fit(Structure(AXIS).with_cause(CREEP, {"gain": 1e-3, "tau": 1.0, "slow": 0.0}))
    found = {p.parameter: p for p in profiles(fitter, fit)}
    (low, high), (least, _) = found["gain"].ci95, found["tau"].ci95
    assert low < 4e-4 < high and 0.5 * found["gain"].value > low and high > 2 * found["gain"].value
    assert 0.1 < least < 0.5
    assert found["tau"].shape == ABOVE


def test_a_profile_whose_budget_ends_while_the_others_are_fitted_verifies_no_end(monkeypatch):
    """The rise is then that of others which stand where they did: far too large, and the end too near."""
    fitter = axis_fitter(creeping, u=1.5 * np.minimum(np.arange(600) * H / 0.05, 1.0))
    fit = fitter.fit(Structure(AXIS).with_cause(CREEP, {"gain": 1e-3, "tau": 1.0, "slow": 0.0}))

    optimum = fitter.problem(fit.structure).to_scaled(np.concatenate([fit.theta, *fit.initial_states]))

    def spent(problem, start, most):
        low, high = problem.bounds
        (i,) = np.flatnonzero(low == high)
        for _ in range(300 if low[i] > optimum[i] else 0):
            problem.residual(start)
        return start

    module = "ctrlgen.estimation.profile_likelihood"
    monkeypatch.setattr(f"{module}.PROFILE", replace(PROFILE, cost=0.0, fewest_points=200))
    monkeypatch.setattr(f"{module}.levenberg_marquardt", spent)
    assert not any(p.verified for p in profiles(fitter, fit))
