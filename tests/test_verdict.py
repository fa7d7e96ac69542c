"""The numbers that a verdict rests on, at the two sides of each; searches and fits are numbers here."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from misfits import errors_of, left, noise_of
from scipy import stats

from ctrlgen.diagnosis.selection.attribution import Attribution, ShareEntry
from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.findings import findings, held_out_errors
from ctrlgen.diagnosis.selection.objections import objections
from ctrlgen.diagnosis.selection.verdict import (
    Verdict,
    contradicts_datasheet,
    main_rivals,
    poorly_determined,
    unconfirmed,
    verdict,
    within_tolerance,
)
from ctrlgen.estimation.free_parameters import FreeParameter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.residual_tests import ResidualTests

N, JUST = 1000, 1e-6
CREEP, DRIFT, GAIN, REVERSED = (
    Hypothesis(effect, place, "axis")
    for effect, place in (
        ("creep", "stage:axis"), ("drift", "sensor:axis"), ("drive_gain", "actuator:axis"), ("reversed", "actuator:axis"),
    )
)  # fmt: skip


def number(path: str, nominal=1.0, sd=None, cause=None, unit="1") -> FreeParameter:
    return FreeParameter(path, unit, nominal, -np.inf, np.inf, 1e-3, sd, cause, cause is not None)


def fitted(causes=(), theta=(), free_parameters=(), penalty=0.0) -> SimpleNamespace:
    structure = SimpleNamespace(
        causes=causes,
        free_parameters=free_parameters,
        cause_of=lambda parameter: causes[parameter.cause],
        plausible_range=lambda unknown: None,
    )
    return SimpleNamespace(
        structure=structure, theta=np.array(theta), penalty=penalty, J=np.zeros((0, len(theta))),
        covariance=np.diag(np.full(len(theta), 1e-4)),
    )  # fmt: skip


def trial(gone=0.0, held=0.0, cause=None, **more) -> CandidateModel:
    """A candidate that leaves `gone` squares beyond the noise, `held` beyond it held out."""
    found = left(gone, N)
    return CandidateModel(fitted(**more), errors_of(found), found, left(held, N), cause=cause)


def search(nominal, chosen, bare=(), rivals=(), of=None) -> SimpleNamespace:
    return SimpleNamespace(nominal=nominal, chosen=chosen, without_cause=bare, rivals=rivals, fitter=of or fitter())


def fitter(known: bool = True, tolerance=(None,), **squares) -> SimpleNamespace:
    recording = SimpleNamespace(tolerance=tolerance, channels=("reading.axis",), units=("um",))
    held = [SimpleNamespace(valid=np.ones((N, 1), bool))]
    noise = replace(noise_of(known=known), sd=np.array([2e-9]))
    return SimpleNamespace(noise=noise, held_out_records=held, recording=recording, **squares)


def shares_of(*values: float | None, rest: float | None = 0.0) -> Attribution:
    said = tuple(None if v is None else ShareEntry(value=v, ci95=(v, v)) for v in values)
    return Attribution(said, None if rest is None else ShareEntry(value=rest, ci95=(rest, rest)), True)


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
    passed=True, known=True, rivals=((),), causes=(GAIN,), share=0.9, rest=None, confirmed=50.0, worse=0.0, seen=False,
    apart=0.0, tolerance=None, left_over=0.0,
) -> str:  # fmt: skip
    """The word for one cause with a `share` of the mismatch, of which `left_over` squares are left held out."""
    unknowns, theta = (number("p0", 2.0, 0.1),), (2.0 + 0.1 * apart,)
    nominal = trial(1e6, 1e6)
    chosen = trial(-100.0, left_over - 100.0, causes=causes, free_parameters=unknowns, theta=theta)
    f = fitter(known, (tolerance,), held_out_squares=lambda fit: worse if fit is chosen.fit else 0.0)
    bare = (trial(0.0, left_over - 100.0 + confirmed),) * len(causes)
    found = search(nominal, chosen, bare, rivals[: len(causes)], of=f)
    shares = shares_of(*[share] * len(causes), rest=(1 - share) if rest is None else rest)
    return verdict(found, ResidualTests((1.0,), {}, passed), shares, seen)


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
    assert judged(passed=False, share=share) == says and judged(share=share) == Verdict.EXPLAINED


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
    nominal, chosen = trial(), trial()
    f = fitter(predict=lambda fit, r: np.full((4, 1), 1e-6 if fit is nominal.fit else 3e-6))
    f.held_out_records = [SimpleNamespace(valid=valid, observed=np.array([[4e-6], [5e-6], [6e-6], [9.0]]))]
    f.recording = SimpleNamespace(channels=("reading.axis",), units=("um",))
    found = held_out_errors(search(nominal, chosen, of=f), np.array([True]))["reading.axis"]
    wanted = (np.sqrt((9 + 16 + 25) / 3), np.sqrt((1 + 4 + 9) / 3), 2e-3, 5e-3)
    assert (found.rms_before, found.rms_after, found.noise_floor, found.uncertainty) == pytest.approx(wanted)
    assert held_out_errors(search(nominal, chosen, of=f), np.array([False]))["reading.axis"].noise_floor is None
    f.held_out_records = []
    assert np.isnan(held_out_errors(search(nominal, chosen, of=f), np.array([True]))["reading.axis"].rms_after)


def lines(*frequencies: float | None, accepted=(), path=10.0) -> bool:
    """Whether errors that repeat so often per metre of path, and gains for None, are told apart by readings of 10 m."""
    causes = tuple(
        GAIN if f is None else Hypothesis("cyclic", "sensor:axis", "axis", count=k) for k, f in enumerate(frequencies)
    )
    fit = SimpleNamespace(
        structure=SimpleNamespace(causes=causes, free_parameters=()),
        values=lambda k: {"gain": 0.1} if frequencies[k] is None else {"amplitude": 1e-3, "period": 1 / frequencies[k]},
        theta=(),
    )
    observed = np.linspace(0, path, 11)[:, None]
    record = SimpleNamespace(role="fit", time=np.arange(11), valid=np.ones((11, 1), bool), observed=observed)
    recording = SimpleNamespace(records=[record], channels=("reading.axis",))
    recording.kind = "series"
    return objections(recording, fit, [causes[k] for k in accepted]) == {}


def test_two_lines_are_told_apart_by_half_a_period_over_the_path():
    assert lines(5.0, 5.051) and not lines(5.0, 5.049) and not lines(5.049, 5.0)
    assert lines(5.0, 5.026, path=20.0)


@pytest.mark.parametrize("begin", [0.0, 5.0])
def test_two_frequencies_are_told_apart_by_half_a_period_over_the_time_of_the_record(begin):
    """Ten seconds of it, whenever it begins, of a law that may act more than once at a place."""
    prior = replace(HUM.prior, repeatable=True)
    causes = [
        SimpleNamespace(effect=HUM.effect, location=HUM.location, at=HUM.at, law=HUM.law, prior=prior, k=k)
        for k in range(2)
    ]
    recording = timed(begin + np.arange(11.0))
    for apart, told in ((0.049, False), (0.051, True)):
        found = objections(recording, line(causes, *(2.0 + k * apart for k in range(2))))
        assert list(found) == ([] if told else [1])


HUM = Hypothesis("vibration", "disturbance:axis", "axis")


def timed(time: np.ndarray, drive=None) -> SimpleNamespace:
    """A recording of one record to fit, of the given times."""
    given = np.zeros((len(time), 1)) if drive is None else drive
    record = SimpleNamespace(role="fit", time=time, drive=given, sample_time=time[1] - time[0], period=None)
    return SimpleNamespace(records=[record], channels=(), kind="series")


def line(causes, *frequencies: float) -> SimpleNamespace:
    structure = SimpleNamespace(causes=causes, free_parameters=())
    return SimpleNamespace(
        structure=structure, theta=(), values=lambda k: {"amplitude": 1.0, "frequency": frequencies[k], "phase": 0.0}
    )


@pytest.mark.parametrize("frequency, told", [(0.99, False), (1.01, True)])
def test_a_line_lasts_ten_periods(frequency, told):
    """Of fewer, any slow change looks like one; unless it leaves noise alone."""
    recording, fit = timed(np.linspace(3.0, 13.0, 101)), line([HUM], frequency)
    reason = "the records hold 9.9 periods of it, and 10 are needed to tell a line"
    assert objections(recording, fit) == ({} if told else {0: reason})
    assert objections(recording, fit, exact=True) == {} == objections(recording, fit, accepted=[HUM])


@pytest.mark.parametrize("period, told", [(0.68, False), (0.65, True)])
def test_a_pitch_is_seen_to_repeat(period, told):
    """A reading that goes 1 um covers one and a half periods of 0.667 um."""
    cause = Hypothesis("cyclic", "sensor:axis", "axis")
    observed = np.linspace(-0.5e-6, 0.5e-6, 101)[:, None]
    record = SimpleNamespace(role="fit", observed=observed, valid=np.ones_like(observed, bool))
    recording = SimpleNamespace(records=[record], channels=("reading.axis",), kind="series")
    values = {"amplitude": 1e-8, "period": 1e-6 * period, "phase": 0.3}
    structure = SimpleNamespace(causes=(cause,), free_parameters=())
    fit = SimpleNamespace(structure=structure, theta=(), values=lambda k: values)
    reason = "the reading covers 1.5 periods of it, and 1.5 are needed to see it repeat"
    assert objections(recording, fit) == ({} if told else {0: reason})
    assert objections(recording, fit, exact=True) == {}


def stepped(moment: float, rise: float = 1e-3) -> SimpleNamespace:
    cause = Hypothesis("force_step", "stage:axis", "axis")
    values = {p.name: 0.1 for p in cause.law.params} | {"moment": moment, "rise": rise}
    return SimpleNamespace(
        structure=SimpleNamespace(causes=(cause,), free_parameters=()), theta=(), values=lambda k: values
    )


@pytest.mark.parametrize(
    "moment, own", [(0.0944, True), (0.0956, False), (0.1044, False), (0.1066, True), (0.15, True)]
)
def test_an_event_at_the_onset_of_motion_is_friction(moment, own):
    """Motion begins at 0.100 s after rest, five samples to either side of it."""
    time = 1e-3 * np.arange(400)
    drive = np.where(time < 0.0995, 0.0, np.sin(2 * np.pi * 7 * (time - 0.1)))[:, None]
    found = objections(timed(time, drive), stepped(moment))
    assert found == ({} if own else {0: "it happens where the motion begins or ends, as friction, slack and delays do"})
    assert objections(timed(time, drive), stepped(moment), exact=True) == {}


@pytest.mark.parametrize("rise, sharp", [(0.0079, True), (0.0081, False)])
def test_an_event_is_sharp(rise, sharp):
    """Over in a fiftieth of the record, of 0.4 s."""
    time = np.linspace(0.0, 0.4, 401)
    found = objections(timed(time), stepped(0.2, rise))
    assert found == ({} if sharp else {0: "its rise of 0.0081 s is slow beside the record; an event is sharp"})


@pytest.mark.parametrize("apart, own", [(0.24, False), (0.26, True)])
def test_a_line_at_a_harmonic_of_the_drive_is_the_drives(apart, own):
    """A quarter of a cycle within ten seconds, of a drive that is stated to repeat each half second."""
    recording = timed(np.linspace(0.0, 10.0, 1001))
    recording.records[0].period = 0.5
    reason = "it is harmonic 3 of the drive's period, as whatever the drive causes is"
    assert objections(recording, line([HUM], 6.0 + apart / 10)) == ({} if own else {0: reason})
    assert objections(recording, line([HUM], 6.0), exact=True) == {}


def test_an_event_where_the_motion_ends_is_none_either_and_a_reversal_is_no_end():
    time = 1e-3 * np.arange(400)
    drive = np.where(time < 0.2005, np.sin(2 * np.pi * 5 * time), 0.0)[:, None]
    assert objections(timed(time, drive), stepped(0.2)) and objections(timed(time, drive), stepped(0.05)) == {}
    held = np.where((time > 0.05) & (time < 0.06), np.sin(2 * np.pi * 5 * 0.05), drive[:, 0])[:, None]
    assert objections(timed(time, held), stepped(0.05)) == {}  # ten samples are no rest


def test_all_pairs_of_lines_are_looked_at_whatever_stands_between():
    assert not lines(None, 5.0, 5.01) and not lines(5.0, None, 5.01) and not lines(5.0, 7.0, 7.01)
    assert lines(5.0, 5.01, accepted=(0, 1)) and not lines(5.0, 5.01, 9.0, accepted=(0, 2))
    assert not lines(5.0, 5.01, 9.0, 9.01, accepted=(0, 1))


TURNED = "its amplitude is so large beside its period that the reading would turn back"


@pytest.mark.parametrize("period, means", [(6.29, True), (6.28, False)])
def test_a_cause_whose_law_does_not_hold_means_nothing(period, means):
    """Fringes of one metre must be longer than 2 pi metres, or the reading would fall as the position rises."""
    cause = Hypothesis("cyclic", "sensor:axis", "axis")
    fit = fitted(causes=(cause, GAIN))
    fit.values = lambda k: {"amplitude": 1.0, "period": period, "phase": 0.0} if k == 0 else {"gain": 0.1}
    found = objections(timed(np.arange(11.0)), fit)
    assert found == ({} if means else {0: TURNED})
    assert objections(timed(np.arange(11.0)), fit, (cause,)) == {}


@pytest.mark.parametrize("damping, means", [(0.70, True), (0.71, False)])
def test_a_resonance_without_a_peak_is_none(damping, means):
    """From 1/sqrt(2) of critical damping on the response falls from the beginning: it is a lag."""
    cause = Hypothesis("resonance", "stage:axis", "axis")
    fit = fitted(causes=(cause, GAIN))
    fit.values = lambda k: {"stiffness": 1.0, "frequency": 9.0, "damping": damping} if k == 0 else {"gain": 0.1}
    found = objections(timed(np.arange(11.0)), fit)
    assert found == ({} if means else {0: "a damping ratio of 0.71 leaves no resonance, only a lag"})
