"""What the model-free shares do to causes: none that they contradict stands first, and alone it makes the answer ambiguous."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from ctrlgen.diagnosis.report.nearly_as_large import nearly_as_large
from ctrlgen.diagnosis.selection import search
from ctrlgen.diagnosis.selection.attribution import ShareEntry
from ctrlgen.diagnosis.selection.findings import Estimate, Finding, Role, WorthEntry, leading, size_untold
from ctrlgen.diagnosis.selection.search import Searcher
from ctrlgen.diagnosis.selection.standing import Evidence, answer_of, borne_out_instead, by_heat, in_standing, possible
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.effects import Family
from ctrlgen.estimation.hypothesis import Hypothesis


def finding(effect: str, share: float = 0.5, role: Role = Role.CAUSE) -> Finding:
    cause = Hypothesis(effect, "stage:axis", "axis")
    return Finding(
        effect, cause.location, {}, (), ShareEntry(value=share, ci95=(share, share)), {}, "", cause, role=role
    )


def shares(friction: float, creep: float) -> list[tuple[Family, float]]:
    return sorted([(Family.FRICTION, friction), (Family.CREEP, creep)], key=lambda pair: -pair[1])


@pytest.mark.parametrize(
    ("friction", "creep", "stands"),
    [
        (0.7, 0.6, True),
        (0.7, 0.149, True),
        (0.7, 0.139, False),
        (0.49, 0.0, True),
        (0.51, 0.04, False),
        (0.04, 0.7, True),
    ],
)
def test_a_cause_whose_family_is_far_behind_a_clear_one_does_not_stand_first(friction, creep, stands):
    """A fifth of the largest share, or a twentieth of the residual; half of it makes a family clear."""
    first, second = in_standing([finding("creep"), finding("coulomb", 0.3)], Evidence(*2 * [shares(friction, creep)]))
    assert (first.effect == "creep") == stands
    assert {f.effect: f.contradicted for f in (first, second)}["creep"] == (not stands)


def test_what_is_seen_in_the_readings_stands_first_for_no_cause_in_doubt():
    """The rounding of a reading takes no share, and nothing speaks against it."""
    step, told = finding("quantisation"), Evidence(*2 * [shares(0.9, 0.0)])
    found = in_standing([finding("creep"), step], told, [step])
    assert [f.effect for f in found] == ["creep", "quantisation"] and found[0].contradicted
    assert answer_of(Verdict.EXPLAINED, found, exact=False) is Verdict.AMBIGUOUS
    assert in_standing([step], told, [step])[0].effect == "quantisation"
    ahead = in_standing([step, finding("coulomb")], told, [step])
    assert [f.effect for f in ahead] == ["coulomb", "quantisation"]


@pytest.mark.parametrize(("by_itself", "stands"), [(0.95, True), (0.86, True), (0.8, False)])
def test_a_family_that_predicts_as_much_alone_is_not_contradicted(by_itself, stands):
    """As the history of travel and the speed in a sine, of which only the first one selected adds anything."""
    (first, *_) = in_standing([finding("creep")], Evidence(*2 * [shares(0.95, 0.02)], {Family.CREEP: by_itself}))
    assert first.contradicted == (not stands)
    assert first.support.share == (min(by_itself, 0.95) if stands else 0.02)


@pytest.mark.parametrize(("friction", "stands"), [(0.02, True), (0.55, False)])
def test_what_is_in_proportion_speaks_against_no_law(friction, stands):
    """Settled creep is a gain to a reading, and gains were tried; another family may still contradict it."""
    bent = shares(friction, 0.0)
    (first, *_) = in_standing([finding("creep")], Evidence([(Family.GAIN, 0.96), *bent], bent))
    assert first.contradicted == (not stands)
    # nothing is bent at all
    (first, *_) = in_standing([finding("creep")], Evidence([(Family.GAIN, 0.96)], []))
    assert not first.contradicted


def test_what_is_no_cause_stays_behind_the_causes_and_is_not_judged():
    found = in_standing([finding("creep"), finding("drift", role=Role.MINOR)], Evidence(*2 * [shares(0.9, 0.0)]))
    assert [f.effect for f in found] == ["creep", "drift"] and found[1].support is None


@pytest.mark.parametrize("verdict", Verdict)
def test_alone_it_makes_the_answer_ambiguous_unless_noise_alone_is_left(verdict):
    found = in_standing([finding("creep")], Evidence(*2 * [shares(0.9, 0.0)]))
    doubted = verdict in (Verdict.PARTLY, Verdict.EXPLAINED)
    assert answer_of(verdict, found, exact=False) == (Verdict.AMBIGUOUS if doubted else verdict)
    assert answer_of(verdict, found, exact=True) == verdict
    assert (
        answer_of(verdict, in_standing([finding("coulomb")], Evidence(*2 * [shares(0.9, 0.0)])), exact=False) == verdict
    )


@pytest.mark.parametrize("verdict", Verdict)
def test_a_cause_whose_size_may_be_zero_explains_nothing(verdict):
    """Something acts, which is not said to be this."""
    untold = [replace(finding("coulomb_above"), size_untold=True), finding("creep", 0.1)]
    named = verdict in (Verdict.PARTLY, Verdict.EXPLAINED)
    for exact in (False, True):
        assert answer_of(verdict, untold, exact) is (Verdict.UNEXPLAINED if named else verdict)
        assert answer_of(verdict, untold[::-1], exact) is verdict


@pytest.mark.parametrize(
    ("sizes", "untold"),
    [
        ([(0.0, 48.0)], True),
        ([(1e-9, 48.0)], False),
        ([(-2.0, 3.0), (-9.0, 1.0)], True),
        ([(-2.0, 3.0), (1.0, 9.0)], False),
    ],
)
def test_the_size_of_a_law_is_told_where_one_of_its_terms_has_one(sizes, untold):
    """The shape of a law, whose interval may hold zero too, does not count."""
    free = [SimpleNamespace(cause=k, amplitude=True, nominal=0.0, unit="N", path=f"s{k}") for k in range(len(sizes))]
    free.append(SimpleNamespace(cause=0, amplitude=False, nominal=0.0, unit="N", path="shape"))
    estimates = {f"s{k}": Estimate(ends[1], ends, "N") for k, ends in enumerate(sizes)}
    fit = SimpleNamespace(structure=SimpleNamespace(free_parameters=free))
    search = SimpleNamespace(chosen=SimpleNamespace(fit=fit))
    assert size_untold(search, range(len(sizes)), estimates) is untold
    assert not size_untold(search, [len(sizes)], estimates)


def test_of_two_that_explain_alike_the_one_that_the_shares_bear_out_takes_the_place_of_the_other():
    def model(effect: str):
        return SimpleNamespace(cause=Hypothesis(effect, "sensor:axis", "axis"))

    cause, lag, gain = Hypothesis("thermal_lag", "actuator:axis", "axis"), model("low_pass"), model("gain")
    number = SimpleNamespace(cause=Hypothesis("parameter", "stage:axis", "axis"))
    timing = Evidence([(Family.TIMING, 0.99)], [(Family.TIMING, 0.99)])

    def instead(evidence: Evidence, *rivals):
        return borne_out_instead(SimpleNamespace(chosen=SimpleNamespace(causes=(cause,)), rivals=(rivals,)), evidence)

    assert instead(timing, number, gain, lag) is lag
    assert instead(timing, gain) is None and instead(timing) is None
    both = [(Family.TIMING, 0.99), (Family.THERMAL, 0.97)]
    assert instead(Evidence(both, both), lag) is None
    assert instead(Evidence([(Family.TIMING, 0.99)], []), lag) is None


def test_a_family_of_which_the_device_can_have_no_law_is_not_spoken_for():
    offered = [Hypothesis(effect, "sensor:axis", "axis") for effect in ("creep", "bow", "parameter")]
    assert possible(shares(0.9, 0.5), offered) == [(Family.CREEP, 0.5)]


@pytest.mark.parametrize(("laws", "share"), [(["heat_loss", "creep"], 0.7), (["creep", "parameter"], 0.02)])
def test_what_goes_by_the_place_of_a_heated_stage_may_be_of_its_heat(laws, share):
    offered = [Hypothesis(effect, "actuator:axis", "axis") for effect in laws]
    told = by_heat([(Family.ELASTIC, 0.7), (Family.THERMAL, 0.02)], offered)
    assert told[0] == (Family.ELASTIC, 0.7) and dict(told)[Family.THERMAL] == share
    assert dict(told).get(Family.DRIVE) == (share if share == 0.7 else None)
    (found,) = in_standing([finding("heat_loss")], Evidence(told, told))
    assert found.contradicted == (share < 0.7)


@pytest.mark.parametrize(
    ("of", "left", "first"),
    [
        ([0.52, 0.48], [0.5, 0.9], 1),
        ([0.52, 0.48], [0.9, 0.5], 0),
        ([0.56, 0.44], [0.5, 0.9], 0),
        ([0.3, 0.34, 0.33], [1.0, 2.0, 3.0], 2),
        ([0.1, 0.5, 0.35], [9.0, 1.0, 5.0], 1),
        ([], [], None),
    ],
)
def test_of_causes_with_nearly_the_same_share_the_one_that_is_needed_most_is_the_main_one(of, left, first):
    assert leading(of, left) == first


def test_why_the_largest_share_does_not_stand_first_is_told():
    def worth(without: float) -> dict[str, WorthEntry]:
        return {"reading.axis": WorthEntry(without=without, with_it=0.19, unit="um", share=0.5)}

    lag, loop = (
        replace(finding("delay", 0.52), worth=worth(0.589)),
        replace(finding("hysteresis", 0.48), worth=worth(0.705)),
    )
    assert nearly_as_large([lag, loop]) == []
    (told,) = nearly_as_large([loop, lag])
    assert "0.705 um is left without it, 0.589 um without the other" in told and "(48 % and 52 %)" in told
    assert nearly_as_large([]) == []


@pytest.mark.parametrize("alike, no_worse, taken", [(True, True, True), (False, True, False), (True, False, False)])
def test_a_rival_takes_the_place_where_it_explains_alike_and_foretells_no_worse(monkeypatch, alike, no_worse, taken):
    """No worse than the device as described does; else a cause would be named that the search itself withdraws."""
    rival, fewer, described = SimpleNamespace(causes=()), SimpleNamespace(), SimpleNamespace()
    screen = SimpleNamespace(seed=0, hypotheses=())
    searcher = Searcher.__new__(Searcher)
    searcher.trials = SimpleNamespace(
        converged=lambda t: t,
        selection=None,
        fitter=None,
        jobs=1,
        screen=screen,
        log=(),
        screened=lambda _: None,
        each=lambda do, items: [do(None, k) for k in items],
    )
    result = SimpleNamespace(chosen=described, nominal=described, rounds=(), withdrawn=())
    monkeypatch.setattr(search, "explains_alike", lambda *_: alike)
    monkeypatch.setattr(search, "no_worse", lambda *_: rival if no_worse else fewer)
    monkeypatch.setattr(search, "attribute", lambda *_: None)
    monkeypatch.setattr(search, "with_positive_waves", lambda t: t)
    assert searcher.with_rival(result, rival).chosen is (rival if taken else described)
