"""The numbers that a verdict rests on, at the two sides of each; searches and fits are numbers here."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from fitted_causes import CREEP, DRIFT, GAIN, REVERSED, fitted
from misfits import errors_of, left, noise_of
from scipy import stats

from ctrlgen.diagnosis.selection.attribution import Attribution, ShareEntry
from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.findings import findings, held_out_errors
from ctrlgen.diagnosis.selection.verdict import (
    Verdict,
    contradicts_datasheet,
    main_rivals,
    poorly_determined,
    terms_of_findings,
    too_little_to_name,
    unconfirmed,
    untold_noise_drowns,
    verdict,
    within_tolerance,
)
from ctrlgen.estimation.free_parameters import FreeParameter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.noise import NoiseSource
from ctrlgen.estimation.residual_tests import ResidualTests

N, JUST = 1000, 1e-6


def number(path: str, nominal=1.0, sd=None, cause=None, unit="1") -> FreeParameter:
    return FreeParameter(path, unit, nominal, -np.inf, np.inf, 1e-3, sd, cause, cause is not None)


def trial(gone=0.0, held=0.0, cause=None, **more) -> CandidateModel:
    """A candidate that leaves `gone` squares beyond the noise, `held` beyond it held out."""
    found = left(gone, N)
    return CandidateModel(fitted(**more), errors_of(found), found, left(held, N), cause=cause)


def search(nominal, chosen, bare=(), rivals=(), of=None) -> SimpleNamespace:
    return SimpleNamespace(
        nominal=nominal,
        chosen=chosen,
        without_cause=bare,
        rivals=rivals,
        fitter=of or fitter(),
        withdrawn=(),
        final_screen=SimpleNamespace(moves=None),
    )


def fitter(known: bool = True, tolerance=(None,), **squares) -> SimpleNamespace:
    recording = SimpleNamespace(tolerance=tolerance, channels=("reading.axis",), units=("um",))
    held = [SimpleNamespace(valid=np.ones((N, 1), bool))]
    noise = replace(noise_of(known=known), sd=np.array([2e-9]))
    return SimpleNamespace(noise=noise, held_out_records=held, recording=recording, **squares)


def shares_of(*values: float | None, rest: float | None = 0.0) -> Attribution:
    said = tuple(None if v is None else ShareEntry(value=v, ci95=(v, v)) for v in values)
    return Attribution(said, None if rest is None else ShareEntry(value=rest, ci95=(rest, rest)), True)


def outcome(refitted, **by_motion: float) -> ResidualTests:
    return ResidualTests((1.0,), {}, True, refitted, by_motion={f"reading.{c}": p for c, p in by_motion.items()})


CHANCE = 4 * np.sqrt(2 * N)  # squares by which N of them differ by chance


@pytest.mark.parametrize("side, is_loose", [(-JUST, False), (JUST, True)])
def test_numbers_are_loose_that_foresee_worse_than_none_beyond_four_deviations(side, is_loose):
    squares = {"chosen": 5e4 + CHANCE + side, "nominal": 5e4}
    chosen, nominal = trial(), trial()
    f = fitter(held_out_squares=lambda fit: squares["chosen" if fit is chosen.fit else "nominal"])
    assert poorly_determined(search(nominal, chosen, of=f)) == is_loose


@pytest.mark.parametrize("confirmed, shown", [(2 - JUST, False), (2 + JUST, True)])
def test_a_cause_is_confirmed_by_two_squares_held_out(confirmed, shown):
    chosen = trial(-200.0, -200.0, causes=(GAIN,))
    found = search(None, chosen, (trial(-100.0, -200.0 + confirmed),))
    assert unconfirmed(found) == (() if shown else (GAIN,))


@pytest.mark.parametrize("hidden, shown", [(49.0, False), (51.0, True)])
def test_a_cause_that_the_device_would_have_to_pay_for_needs_no_confirmation(hidden, shown):
    """Half of what it takes away is a penalty on the device's own numbers."""
    found = search(None, trial(-200.0, causes=(GAIN,)), (trial(-100.0 - hidden, penalty=hidden),))
    assert unconfirmed(found) == (() if shown else (GAIN,))


def off(*deviations: float) -> SimpleNamespace:
    unknowns = tuple(number(f"p{k}", nominal=2.0, sd=0.1) for k in range(len(deviations)))
    return fitted(
        theta=[2.0 + 0.1 * z for z in deviations] + [7.0], free_parameters=(*unknowns, number("gain", cause=0))
    )


def test_numbers_are_excluded_that_chance_puts_so_far_off_once_in_a_million():
    for count in (1, 4):
        z = float(np.sqrt(stats.chi2.isf(1e-6, count) / count))
        assert contradicts_datasheet(off(*[z * (1 - 1e-6)] * count)) == {}
        assert contradicts_datasheet(off(*[z * (1 + 1e-6)] * count)) == pytest.approx(
            {f"p{k}": z for k in range(count)}, rel=1e-5
        )


def test_of_excluded_numbers_those_beyond_two_deviations_are_named():
    assert contradicts_datasheet(off(-9.0, 2.01, 1.99)) == pytest.approx({"p0": -9.0, "p1": 2.01})
    many = contradicts_datasheet(off(*[1.5] * 60))  # none alone is far off
    assert len(many) == 60 and set(np.round(list(many.values()), 9)) == {1.5}


def judged(
    passed=True,
    known=True,
    rivals=((),),
    causes=(GAIN,),
    share=0.9,
    rest=None,
    confirmed=50.0,
    worse=0.0,
    seen=False,
    apart=0.0,
    tolerance=None,
    left_over=0.0,
) -> str:
    """The word for one cause with a `share` of the mismatch, of which `left_over` squares are left held out."""
    unknowns, theta = (number("p0", 2.0, 0.1),), (2.0 + 0.1 * apart,)
    nominal = trial(1e6, 1e6)
    chosen = trial(-100.0, left_over - 100.0, causes=causes, free_parameters=unknowns, theta=theta)
    f = fitter(known, (tolerance,), held_out_squares=lambda fit: worse if fit is chosen.fit else 0.0)
    bare = (trial(0.0, left_over - 100.0 + confirmed),) * len(causes)
    found = search(nominal, chosen, bare, rivals[: len(causes)], of=f)
    shares = shares_of(*[share] * len(causes), rest=(1 - share) if rest is None else rest)
    return verdict(found, ResidualTests((1.0,), {}, passed, fitted()), shares, seen)


def test_a_verdict_says_what_is_known():
    assert judged() == Verdict.EXPLAINED and judged(causes=()) == Verdict.CONSISTENT
    assert judged(causes=(), seen=True) == Verdict.EXPLAINED  # read off the readings themselves
    assert judged(rivals=((GAIN,),)) == Verdict.AMBIGUOUS
    assert (
        judged(known=False) == Verdict.PARTLY
        and judged(confirmed=0.0) == Verdict.PARTLY
        and judged(worse=CHANCE + 1) == Verdict.PARTLY
    )
    assert (
        judged(passed=False, causes=()) == Verdict.UNEXPLAINED
        and judged(passed=False, causes=(), known=False) == Verdict.CONSISTENT
    )
    assert judged(passed=False, share=0.1, known=False) == Verdict.PARTLY


@pytest.mark.parametrize("share, says", [(0.75 + JUST, Verdict.PARTLY), (0.75 - JUST, Verdict.UNEXPLAINED)])
def test_what_takes_away_three_quarters_of_the_mismatch_is_part_of_the_answer(share, says):
    assert judged(passed=False, share=share, left_over=1e5) == says and judged(share=share) == Verdict.EXPLAINED


@pytest.mark.parametrize(
    "before, after, little",
    [
        # a hundredth of the mismatch, whatever the noise is
        (1e4, 100.0 - JUST, True),
        (1e4, 100.0 + JUST, False),
        # no larger than the noise, and a tenth of the mismatch
        (20.0, 1.0 - JUST, True),
        (20.0, 1.0 + JUST, False),
        (5.0, 0.5 - JUST, True),
        (5.0, 0.5 + JUST, False),
        # what the residual tests let pass: 1.1 times the noise
        (0.3, 0.21 - JUST, True),
        (0.3, 0.21 + JUST, False),
    ],
)
def test_what_is_left_is_little_beside_the_mismatch_or_the_noise(before, after, little):
    """Squares beyond the noise, over those of the noise; of the records to fit and of those held out."""
    quiet, passed = 0.0, ResidualTests((1.0,), {}, False, fitted())
    for fit, held in ((after, quiet), (quiet, after)):
        found = search(trial(before * N, before * N), trial(fit * N, held * N, causes=(GAIN,)), of=fitter())
        assert too_little_to_name(found, passed) == little
        assert not too_little_to_name(found, replace(passed, restless=("reading.axis",)))
    # the error that the answer tells, not the one of numbers moved on the held-out records
    told = trial(quiet, quiet, causes=(GAIN,))
    moved = replace(told, unmoved=left(after * N, N))
    assert too_little_to_name(search(trial(before * N, before * N), moved, of=fitter()), passed) == little
    unknown = search(trial(before * N, before * N), trial(0.0, 0.0, causes=(GAIN,)), of=fitter(known=False))
    assert not too_little_to_name(unknown, passed)
    guessed = fitter()
    guessed.noise = replace(guessed.noise, sources=(NoiseSource.FASTEST_PART,))
    assert not too_little_to_name(
        search(trial(before * N, before * N), trial(0.0, 0.0, causes=(GAIN,)), of=guessed), passed
    )
    assert not too_little_to_name(search(trial(before * N, before * N), trial(), of=fitter()), passed)


def test_little_that_is_left_is_no_reason_against_an_explanation():
    assert judged(passed=False, left_over=9e3) == Verdict.EXPLAINED and judged(passed=False, left_over=2e4) == "partly"
    assert judged(passed=False, left_over=9e3, apart=6.0) == Verdict.PARTLY  # at the price of a number that is excluded
    assert judged(passed=False, left_over=0.0, causes=()) == Verdict.UNEXPLAINED


def following(left_rms: float, read_rms: float, source: NoiseSource) -> SimpleNamespace:
    """A search whose model leaves so much of what is read of a channel of noise 1."""
    rng = np.random.default_rng(1)
    y = rng.standard_normal((N, 1))
    record = SimpleNamespace(observed=5.0 + read_rms * (y - y.mean()) / y.std(), valid=np.ones((N, 1), bool))
    noise = replace(noise_of(), sources=(source,))
    of = SimpleNamespace(noise=noise, held_out_records=[record])
    return search(trial(), trial(0.0, (left_rms**2 - 1) * N), of=of)


@pytest.mark.parametrize(
    "left_rms, read_rms, source, drowns",
    [
        (10 + JUST, 20.0, NoiseSource.FASTEST_PART, True),
        (10 - JUST, 20.0, NoiseSource.FASTEST_PART, False),
        (30.0 + JUST, 100.0, NoiseSource.FASTEST_PART, True),
        (30.0 - JUST, 100.0, NoiseSource.FASTEST_PART, False),
        (90.0, 100.0, NoiseSource.REST, False),
    ],
)
def test_a_noise_that_nobody_told_is_not_nearly_all_that_is_read(left_rms, read_rms, source, drowns):
    assert untold_noise_drowns(following(left_rms, read_rms, source)) == drowns


def test_what_such_a_noise_would_explain_is_not_explained(monkeypatch):
    monkeypatch.setattr("ctrlgen.diagnosis.selection.verdict.untold_noise_drowns", lambda found: True)
    assert judged(share=0.4, left_over=1e5) == Verdict.UNEXPLAINED and judged(causes=()) == Verdict.UNEXPLAINED
    assert judged(share=0.9, left_over=1e5) == Verdict.PARTLY


def test_numbers_that_contradict_the_data_sheet_are_no_explanation():
    """What is left is noise, but at six stated deviations; beside a cause of most of the mismatch they spoil the answer in part."""
    assert judged(apart=6.0, causes=()) == Verdict.UNEXPLAINED and judged(apart=6.0, share=0.1) == Verdict.UNEXPLAINED
    assert judged(apart=6.0) == Verdict.PARTLY


@pytest.mark.parametrize("tolerance, enough", [(20.1e-9, True), (19.9e-9, False)])
def test_what_is_within_the_stated_tolerance_is_enough(tolerance, enough):
    """A hundred times the noise of 2 nm in squares is left: 20 nm."""
    squares = 100 * N - N + 100  # less the hundred of `judged`
    said = judged(passed=False, tolerance=tolerance, left_over=squares, confirmed=1e4)
    assert said == (Verdict.EXPLAINED if enough else Verdict.PARTLY)
    bare = {"causes": (), "passed": False, "left_over": squares}
    assert judged(tolerance=tolerance, **bare) == (Verdict.CONSISTENT if enough else Verdict.UNEXPLAINED)
    assert judged(tolerance=None, **bare) == Verdict.UNEXPLAINED


def test_a_channel_at_its_noise_is_within_any_tolerance():
    for held, within in ((CHANCE - JUST, True), (CHANCE + JUST, False)):
        found = search(None, trial(held=held), of=fitter(tolerance=(1e-12,)))
        assert within_tolerance(found) == within


@pytest.mark.parametrize("small, ambiguous", [(0.16 + JUST, True), (0.16 - JUST, False)])
def test_a_rival_of_a_small_cause_does_not_make_the_answer_ambiguous(small, ambiguous):
    """A quarter of the largest share, 0.64."""
    found = search(None, trial(causes=(GAIN, CREEP)), rivals=((), (trial(cause=DRIFT),)))
    assert main_rivals(found, shares_of(0.64, small)) == ambiguous
    assert main_rivals(found, shares_of(None, None, rest=None))  # where nothing tells which is the main one


@pytest.mark.parametrize("first", [0, 1])
def test_a_rival_of_a_small_harmonic_is_none_of_the_law(first, monkeypatch):
    """Of two terms the one without which most is left decides, and its alternatives are those of the finding."""
    pitch = Hypothesis("cyclic", "sensor:axis", "axis")
    left_without = [trial(held=3.0 * N), trial(held=3.0 * N)]
    left_without[first] = trial(held=8.0 * N)
    for k in (0, 1):
        rivals = tuple((trial(cause=DRIFT),) if j == k else () for j in (0, 1))
        chosen = trial(causes=(pitch, replace(pitch, count=1)))
        found = search(trial(held=15.0 * N), chosen, tuple(left_without), rivals)
        assert main_rivals(found, shares_of(0.9, 0.9)) == (k == first)
        assert terms_of_findings(found) == [[first, 1 - first]]
        for name, told in (
            ("nominal_physics", None),
            ("moves_one_way", False),
            ("title", ""),
            ("estimated_values", {}),
        ):
            monkeypatch.setattr(f"ctrlgen.diagnosis.selection.findings.{name}", lambda *_, told=told: told)
        (row,) = findings(found, shares_of(0.9, 0.9, rest=0.1))
        assert row.alternatives == ((DRIFT,) if k == first else ())


@pytest.mark.parametrize("gone, ambiguous", [(0.0, True), (1e5, False)])
def test_laws_of_one_family_at_one_place_are_one_answer_where_more_than_noise_is_left(gone, ambiguous):
    one, other, elsewhere = (
        Hypothesis(effect, f"stage:{at}", at) for effect, at in (("coulomb", "a"), ("stribeck", "a"), ("stribeck", "b"))
    )
    chosen = trial(gone, causes=(one,))
    assert main_rivals(search(None, chosen, rivals=((trial(cause=other),),)), shares_of(0.9)) == ambiguous
    assert main_rivals(search(None, chosen, rivals=((trial(cause=elsewhere),),)), shares_of(0.9))


def test_a_whole_number_is_said_as_what_it_was_expected_to_be_and_the_weightier_cause_first(monkeypatch):
    """Reversed 0.9 to 1.1 times: one."""
    monkeypatch.setattr(
        "ctrlgen.diagnosis.selection.findings.robust_deviations", lambda fit: np.full(len(fit.theta), 0.01)
    )
    monkeypatch.setattr("ctrlgen.diagnosis.selection.findings.nominal_physics", lambda device: None)
    monkeypatch.setattr("ctrlgen.diagnosis.selection.findings.title", lambda *_: "")
    monkeypatch.setattr("ctrlgen.diagnosis.selection.findings.moves_one_way", lambda *_: False)
    chosen = trial(causes=(GAIN, REVERSED), free_parameters=(number("effect[0].gain", cause=0),), theta=(1.1,))
    bare = (trial(held=3.0 * N), trial(held=8.0 * N))
    found = search(trial(held=15.0 * N), chosen, bare, ((trial(cause=CREEP), trial()), ()))
    first, second = findings(found, shares_of(0.2, 0.7, rest=0.1))
    assert (first.effect, second.effect) == ("reversed", "drive_gain")
    assert first.parameters["share"].value == pytest.approx(1.0)
    assert first.parameters["share"].ci95 == pytest.approx((1.0, 1.0))
    assert (first.share.value, second.share.value) == (0.7, 0.2)
    worth = second.worth["reading.axis"]
    assert (worth.without, worth.with_it, worth.unit) == pytest.approx((4e-3, 2e-3, "um"))  # sqrt(1 + 3) and 1 of 2 nm
    assert first.worth["reading.axis"].without == pytest.approx(6e-3)
    assert second.alternatives == (CREEP,) and first.alternatives == ()
    assert second.parameters["gain"].value == pytest.approx(1.1)


def test_errors_are_root_mean_squares_of_valid_readings_in_the_readers_unit(monkeypatch):
    monkeypatch.setattr("ctrlgen.diagnosis.selection.findings.prediction_uncertainty", lambda *_: np.array([5e-9]))
    valid = np.ones((4, 1), bool)
    valid[3] = False
    nominal, chosen, moved = trial(), trial(), fitted()
    read = {id(nominal.fit): 1e-6, id(chosen.fit): 3e-6, id(moved): 4e-6}
    f = fitter(predict=lambda fit, r: np.full((4, 1), read[id(fit)]))
    f.held_out_records = [SimpleNamespace(valid=valid, observed=np.array([[4e-6], [5e-6], [6e-6], [9.0]]))]
    f.recording = SimpleNamespace(channels=("reading.axis",), units=("um",))
    found, unknown = (
        held_out_errors(search(nominal, chosen, of=f), np.array([known]), outcome(moved, axis=0.2))["reading.axis"]
        for known in (True, False)
    )
    wanted = (np.sqrt((9 + 16 + 25) / 3), np.sqrt((1 + 4 + 9) / 3), np.sqrt((0 + 1 + 4) / 3), 2e-3, 5e-3)
    assert (
        found.rms_before,
        found.rms_after,
        found.rms_refitted,
        found.noise_floor,
        found.uncertainty,
    ) == pytest.approx(wanted)
    assert unknown.noise_floor is None and found.goes_with_motion == 0.2
    f.held_out_records = []
    (none,) = held_out_errors(search(nominal, chosen, of=f), np.array([True]), outcome(moved)).values()
    assert np.isnan(none.rms_after) and none.goes_with_motion is None
