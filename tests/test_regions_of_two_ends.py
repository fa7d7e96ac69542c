"""A law that was found above or below a place is tried on a stretch in its place, where more than noise is left with it."""

from __future__ import annotations

import numpy as np
import pytest
from axis_records import AXIS, NOISE, H, move, record
from recovery import fitter_of

from ctrlgen.diagnosis.selection.finer_forms import finer_forms
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.structure import Structure

LOW, HIGH, WIDTH = 5e-6, 25e-6, 1e-6  # m, of a travel of 60 um to either side
N = 1500


def on(q: float) -> float:
    return 0.5 * (np.tanh(2 * (q - LOW) / WIDTH) - np.tanh(2 * (q - HIGH) / WIDTH))


def damped(now, q, v, memory):
    return -60.0 * v * on(q), memory


def rubbed(now, q, v, memory):
    """Dahl's bristles of 0.5 um, of 0.4 N."""
    z, before = memory or (0.0, q)
    step = q - before
    z += (step - abs(step) * z) / 5e-7
    return -0.4 * z * on(q), (z, q)


def beside(kind: str, force, offered: tuple[str, ...], edge: float):
    """The model with a law that has one end, and those that are tried in its place."""
    parts, rng, t = [], np.random.default_rng(1), H * np.arange(N)
    for k, role in enumerate(("fit", "hold_out")):
        u = 0.7 * np.sin(2 * np.pi * (3 + k) * t) + 0.4 * np.sin(2 * np.pi * (7.3 - k) * t + 1)
        parts.append(record(u, move(u, force, fine=20) + NOISE * rng.standard_normal(N), role))
    fitter = fitter_of(AXIS, ("reading.axis",), ("um",), (NOISE,), "series", parts)
    plain = Hypothesis(kind, "stage:axis", "axis")
    trials = Trials(fitter, Screen(fitter, [Hypothesis(o, "stage:axis", "axis") for o in offered]), lambda _: None)
    trials.screened(trials.fit(Structure(AXIS)))
    begun = {"edge": edge, "width": 2e-6, "damping": 40.0, "force": 0.3, "reach": 5e-7, "smoothing": 1e-5}
    begun = {name: value for name, value in begun.items() if name in {p.name for p in plain.law.params}}
    found = trials.fit(Structure(AXIS).with_cause(plain, begun), plain, steps=40)
    trials.use(fitter.with_errors_of(found.fit))
    found = trials.fit(found.fit.restarted, plain, steps=40)
    return trials, found, finer_forms(trials, found)


@pytest.mark.long
@pytest.mark.parametrize("kind, edge", [("viscous_above", LOW), ("viscous_below", HIGH)])
def test_damping_that_ends_on_both_sides_is_found(kind, edge):
    trials, plain, (found,) = beside(kind, damped, (kind, "viscous_on_stretch"), edge)
    numbers = found.fit.values(0)
    assert [c.effect for c in found.causes] == ["viscous_on_stretch"] and trials.selection.improves_enough(plain, found)
    assert numbers["position"] == pytest.approx((LOW + HIGH) / 2, abs=2e-7)
    assert numbers["length"] == pytest.approx(HIGH - LOW, abs=2e-7) and numbers["damping"] == pytest.approx(
        60.0, rel=0.02
    )


@pytest.mark.long
@pytest.mark.parametrize("kind, edge", [("coulomb_above", LOW), ("coulomb_below", HIGH)])
def test_friction_that_ends_on_both_sides_is_found(kind, edge):
    trials, plain, tried = beside(kind, rubbed, (kind, "coulomb_on_stretch"), edge)
    (found,) = (t for t in tried if t.causes[0].effect == "coulomb_on_stretch")
    numbers = found.fit.values(0)
    assert trials.selection.improves_enough(plain, found)
    assert numbers["position"] == pytest.approx((LOW + HIGH) / 2, abs=1e-6)
    assert numbers["length"] == pytest.approx(HIGH - LOW, abs=1e-6) and numbers["force"] == pytest.approx(0.4, rel=0.05)


def test_a_law_that_is_not_offered_is_not_tried():
    assert beside("viscous_above", damped, ("viscous_above",), LOW)[2] == ()
