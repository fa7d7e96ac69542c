"""A law that generalises another one is named where it says more: else the plainer law is."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from axis_records import AXIS, NOISE, fitter_of
from effect_cases import Law, rich, shapes

from ctrlgen.diagnosis.selection.model_selection import ModelSelection
from ctrlgen.diagnosis.selection.rivals import as_plainer, rivals, simplified
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.effects import Effect, Place
from ctrlgen.estimation.fit import Fit
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.plainer_law import left_beside, may_be_plainer, plainer_start
from ctrlgen.estimation.priors import prior_of
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Record

GENERAL = {kind: law for kind, law in Effect.library.items() if law.plainer}
every_general_law = pytest.mark.parametrize("law", GENERAL.values(), ids=GENERAL)
# the axis of these tests has no heater: of one that is straight, after all, test_heat_loss.py tells
on_an_axis = pytest.mark.parametrize(
    "law", [law for law in GENERAL.values() if "heat" not in law.requires], ids=lambda law: law.kind
)


def at_neutral(law: type[Effect], where, amplitude: float) -> dict[str, float]:
    """Numbers [SI] with which a law is its plainer one."""
    neutral = {p.name: where.si(law.plainer.where[p.name], p) for p in law.params if p.name in law.plainer.where}
    return {**shapes(law, where)[0], law.amplitude().name: amplitude, **neutral}


def test_laws_say_what_they_generalise():
    assert set(GENERAL) == {
        *("directional_friction", "friction_of_load", "stribeck", "asymmetric_hysteresis", "slack_friction"),
        *("asymmetric_displacement_hysteresis", "asymmetric_drive_hysteresis"),
        *("heater_resistance_of_second_order", "asymmetric_slew_rate"),
    }


@every_general_law
def test_a_plainer_law_is_of_the_same_family_and_place_and_both_name_their_numbers(law):
    plain = Effect.library[law.plainer.kind]
    assert prior_of(plain).form_of == prior_of(law).form_of and plain.place is law.place
    for given, of in ((law.plainer.where, law), (law.plainer.beside, plain)):
        bounds = {p.name: p.bounds for p in of.params if p is not of.amplitude()}
        assert all(bounds[name][0] <= value <= bounds[name][1] for name, value in given.items())


@every_general_law
def test_a_law_is_its_plainer_one_where_the_numbers_by_which_they_differ_are_neutral(law):
    """Dahl's bristles are Coulomb's at the sharpest corner, which is as small as a speed is of interest: a thousandth."""
    signals = rich(800, 1e-3)
    general, plain = Law(law, 1e-3), Law(Effect.library[law.plainer.kind], 1e-3)
    numbers = at_neutral(law, general.where, 0.3)
    both = law.as_plainer(numbers) | {
        p.name: plain.where.si(law.plainer.beside[p.name], p)
        for p in plain.effect.params
        if p.name in law.plainer.beside
    }
    a, b = (
        one.walk(signals)([values[p.name] for p in one.effect.params]).full().ravel()
        for one, values in ((general, numbers), (plain, both))
    )
    assert np.ptp(a) > 1e-3 and np.abs(a - b).max() < 1e-3 * np.ptp(a)


def fit_of(law: str, numbers: dict[str, float], sd: float, at: str = "stage:axis") -> Fit:
    structure = Structure(AXIS).with_cause(Hypothesis(law, at, "axis"), numbers)
    return Fit(structure, structure.start, (), 0.0, 1500, np.zeros(0), np.eye(len(structure.start)) / sd, 0.0)


@pytest.mark.parametrize("breakaway, sd, may", [(1.0, 0.03, True), (1.4, 0.03, False), (1.4, 0.3, True)])
def test_a_law_may_be_the_plainer_one_where_its_intervals_hold_that(breakaway, sd, may):
    rubbing = {"force": 0.01, "breakaway": breakaway, "speed": 1e-4, "reach": 2e-8}
    plain = may_be_plainer(fit_of("stribeck", rubbing, sd), 0)
    assert plain == (Hypothesis("coulomb", "stage:axis", "axis") if may else None)


def test_the_interval_is_the_one_that_is_reported(monkeypatch):
    """Where the residual has a memory, the sandwich is wider than the model's own."""
    fit = fit_of("stribeck", {"force": 0.01, "breakaway": 1.4, "speed": 1e-4, "reach": 2e-8}, 0.03)
    assert may_be_plainer(fit, 0) is None
    monkeypatch.setattr("ctrlgen.estimation.robust_covariance.widening", lambda fit: np.full(len(fit.theta), 10.0))
    assert may_be_plainer(fit, 0) is not None


def test_a_number_that_stopped_at_its_bound_is_not_measured_and_a_fit_decides():
    """One branch widens by as much as the law has, known as exactly as a bound is, the others by nothing: where the plainer law fits
    alike it is told."""
    numbers = {"share": 0.1, "reach": 1e-6, "taper": 0.5, "reversible": 0.0, "upper": 0.01, "lower": -0.6, "side": 0.0}
    fit = fit_of("asymmetric_displacement_hysteresis", numbers, 0.05)
    assert may_be_plainer(fit, 0) is None
    assert may_be_plainer(fit, 0, bounds_tell=False).effect == "displacement_hysteresis"
    nearly = fit_of("asymmetric_displacement_hysteresis", numbers | {"lower": -0.5995}, 0.05)
    assert may_be_plainer(nearly, 0, bounds_tell=False) is not None
    measured = fit_of("asymmetric_displacement_hysteresis", numbers | {"lower": -0.5}, 0.05)
    assert may_be_plainer(measured, 0, bounds_tell=False) is None


def test_all_numbers_by_which_two_laws_differ_must_be_neutral():
    leaning = {"share": 0.1, "reach": 1e-6, "taper": 0.5, "reversible": 0.0, "upper": 0.0, "lower": 0.0, "side": 0.0}
    for name in ("upper", "lower", "side"):
        fit = fit_of("asymmetric_displacement_hysteresis", leaning | {name: 0.2}, 0.05)
        assert may_be_plainer(fit, 0) is None
    assert may_be_plainer(fit_of("asymmetric_displacement_hysteresis", leaning, 0.05), 0).effect == (
        "displacement_hysteresis"
    )


@pytest.mark.parametrize("part, told", [(0.6, True), (-0.4, True), (0.1, False)])
def test_a_part_in_proportion_excludes_no_plain_law_and_is_a_gain_beside_it(part, told):
    """Of g k where the interval of k excludes that there is none."""
    lagging = {"share": 0.2, "reach": 0.5, "taper": 0.5, **dict.fromkeys(("upper", "lower", "side"), 0.0)}
    fit = fit_of("asymmetric_drive_hysteresis", lagging | {"reversible": part}, 0.1, "actuator:axis")
    plain, gain = (Hypothesis(kind, "actuator:axis", "axis") for kind in ("drive_hysteresis", "drive_gain"))
    assert may_be_plainer(fit, 0) == plain
    assert left_beside(fit, 0, plain) == ({gain: {"gain": pytest.approx(0.2 * part)}} if told else {})


@pytest.mark.parametrize(
    "alike, offered, there, found",
    [
        (True, True, False, [["drive_hysteresis"]]),
        (False, True, False, [["drive_hysteresis", "drive_gain"]]),
        (False, False, False, []),
        (False, False, True, [["drive_gain", "drive_hysteresis"]]),
    ],
)
def test_a_gain_stands_beside_the_plain_law_where_nothing_else_takes_the_part_over(
    monkeypatch, alike, offered, there, found
):
    """The device's numbers may, a gain that is there does, and without any the plain law is none."""
    cause, plain, gain = (
        Hypothesis(kind, "actuator:axis", "axis")
        for kind in ("asymmetric_drive_hysteresis", "drive_hysteresis", "drive_gain")
    )
    numbers = {"share": 0.2, "reach": 0.5, "taper": 0.5, "reversible": 0.6, "upper": 0.0, "lower": 0.0, "side": 0.0}
    structure = Structure(AXIS).with_cause(cause, numbers)
    if there:
        structure = Structure(AXIS).with_cause(gain, {"gain": 0.0}).with_cause(cause, numbers)
    J = np.eye(len(structure.start)) / 0.1
    current = SimpleNamespace(
        fit=Fit(structure, structure.start, (), 0.0, 1500, np.zeros(0), J, 0.0), causes=structure.causes
    )
    trials = SimpleNamespace(
        screen=SimpleNamespace(hypotheses=[cause, plain, *[gain] * offered]),
        selection=None,
        tried=lambda begun, cause: [SimpleNamespace(causes=begun.causes, starts=begun.starts)],
        converged=lambda t: t,
    )
    monkeypatch.setattr("ctrlgen.diagnosis.selection.rivals.explains_alike", lambda *_: alike)
    tried = as_plainer(trials, current, len(structure.causes) - 1)
    assert [[c.effect for c in t.causes] for t in tried] == found
    assert not offered or alike or tried[0].starts[1] == {"gain": pytest.approx(0.12)}


def test_what_generalises_nothing_is_what_it_is():
    assert may_be_plainer(fit_of("creep", {"gain": 0.1, "tau": 1.0, "slow": 0.1}, 1.0), 0) is None
    number = next(u.path for u in Structure(AXIS).free_parameters)
    structure = Structure(AXIS).with_cause(Hypothesis("parameter", "stage:axis", path=number), {"value": 1.0})
    fit = Fit(structure, structure.start, (), 0.0, 9, np.zeros(0), np.eye(len(structure.start)), 0.0)
    assert may_be_plainer(fit, 0) is None


@pytest.mark.long
@on_an_axis
def test_what_rubs_or_lags_alike_both_ways_is_named_by_the_plainer_law(law, monkeypatch):
    """Readings of the plainer law, fitted by the one that generalises it."""
    cause = Hypothesis(law.kind, "actuator:axis" if law.place is Place.DRIVE else "stage:axis", "axis")
    model, channel = fitter_of(n=400), cause.channel_on(AXIS)
    size = channel.si(0.05 if law.amplitude().unit == "channel" else 0.3, law.amplitude())
    values = at_neutral(law, channel, size)
    begun = Structure(AXIS).with_cause(cause, values)
    plain = Hypothesis(law.plainer.kind, cause.location, "axis")
    start = plainer_start(Fit(begun, begun.start, (), 0.0, 1, np.zeros(0), np.eye(len(begun.start)), 0.0), 0, plain)
    truth, rng = Structure(AXIS).with_cause(plain, start), np.random.default_rng(0)

    def from_rest(r: Record) -> np.ndarray:
        return truth.simulator(model.recording.channels, r.timing).simulate(r, truth.start)

    records = tuple(
        r if r.role == "rest" else replace(r, observed=from_rest(r) + NOISE * rng.standard_normal(r.observed.shape))
        for r in model.recording.records
    )
    fitter = replace(model, recording=replace(model.recording, records=records))
    trials = Trials(fitter, Screen(fitter, [cause, plain]), lambda _: None)
    general = trials.fit(begun, cause, steps=12)
    assert may_be_plainer(general.fit, 0) == plain
    named = simplified(trials, general)
    assert named.causes == (plain,)
    # a number that a fit of the same squares left at its bound is no asymmetry, however small its interval is there
    places = [k for k, u in enumerate(general.fit.structure.free_parameters) if u.name == "lower"]
    for k in places:
        theta, J = general.fit.theta.copy(), general.fit.J.copy()
        theta[k] = general.fit.structure.free_parameters[k].low
        J[:, k] *= 1e6
        stopped = replace(general, fit=replace(general.fit, theta=theta, J=J))
        assert may_be_plainer(stopped.fit, 0) is None and simplified(trials, stopped).causes == (plain,)
    monkeypatch.setattr("ctrlgen.diagnosis.selection.rivals.replacements", lambda *_: [])
    alike = [t.cause for t in rivals(trials, general, 0)[0]]
    if plain.effect in cause.prior.refines:  # one law, of which the finer form is tried where the plain one was found
        assert alike == []
        return
    assert alike == [plain]
    # nothing that the machine cannot have
    without = Trials(fitter, Screen(fitter, [cause]), lambda _: None)
    assert simplified(without, without.fit(begun, cause, steps=12)).causes == (cause,)


@pytest.mark.parametrize(
    "plain, finer, noise, worth",
    [
        (0.10, 0.095, False, False),  # 0.5 % of the mismatch, and a twentieth of what the plain law leaves
        (0.10, 0.085, False, True),  # 1.5 % of the mismatch
        (0.01, 0.007, False, True),  # 0.3 % of it, but a third of what the plain law leaves
        (0.01, 0.009, False, False),
        (0.01, 0.009, True, True),  # the law leaves noise alone
    ],
)
def test_what_a_law_has_more_than_its_plainer_one_is_worth_a_name_where_it_takes_enough(plain, finer, noise, worth):
    """Squares that two laws leave on the held-out records, of a mismatch of 1; alone, and beside a channel that neither changes."""
    whole, left = [1.0, 1.0], 0.5
    fitter = SimpleNamespace(noise=SimpleNamespace(floor=np.array([1.0, 1.0])))
    compare = ModelSelection(fitter, lambda *_: [], np.array(whole))
    compare.reference = lambda candidates: SimpleNamespace(is_noise=noise)
    two = [SimpleNamespace(held_out=SimpleNamespace(plain_mean=np.array([left, each]))) for each in (plain, finer)]
    assert compare.worth_its_form(*two) is worth
