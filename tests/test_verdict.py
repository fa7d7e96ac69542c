"""The numbers that a verdict rests on, at the two sides of each; searches and fits are numbers here."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from ctrlgen.diagnosis.estimation.residual_tests import ResidualTests
from ctrlgen.diagnosis.estimation.structure import FreeParameter
from ctrlgen.diagnosis.hypotheses.hypotheses import Hypothesis
from ctrlgen.diagnosis.selection.line_resolvability import lines_resolved
from ctrlgen.diagnosis.selection.model_selection import ModelSelection
from ctrlgen.diagnosis.selection.result import findings, held_out_errors
from ctrlgen.diagnosis.selection.verdict import (
    AMBIGUOUS,
    CONSISTENT,
    EXPLAINED,
    PARTLY,
    UNEXPLAINED,
    contradicts_datasheet,
    model_error_allowance,
    poorly_determined,
    unconfirmed,
    unexplained_share,
    verdict,
)

N, JUST = 1000, 1e-6
CREEP, DRIFT, GAIN, REVERSED = (
    Hypothesis(effect, place, "axis")
    for effect, place in (
        ("creep", "stage:axis"), ("drift", "sensor:axis"), ("drive_gain", "actuator:axis"), ("reversed", "actuator:axis"),
    )
)  # fmt: skip


def number(path: str, nominal=1.0, sd=None, cause=None, unit="1") -> FreeParameter:
    return FreeParameter(path, unit, nominal, -np.inf, np.inf, 1e-3, sd, cause, cause is not None)


def fitted(objective=float(N), causes=(), theta=(), free_parameters=(), penalty=0.0) -> SimpleNamespace:
    structure = SimpleNamespace(
        causes=causes, free_parameters=free_parameters, cause_of=lambda parameter: causes[parameter.cause]
    )
    return SimpleNamespace(
        objective=objective, n=N, structure=structure, theta=np.array(theta), penalty=penalty, J=np.zeros((0, len(theta))),
        covariance=np.diag(np.full(len(theta), 1e-4)),
    )  # fmt: skip


def trial(objective=float(N), held=float(N), cause=None, **more) -> SimpleNamespace:
    return SimpleNamespace(fit=fitted(objective, **more), held_out_deviance=held, cause=cause)


def search(nominal, chosen, bare=(), rivals=()) -> SimpleNamespace:
    return SimpleNamespace(nominal=nominal, chosen=chosen, without_cause=bare, rivals=rivals)


def fitter(known: bool = True, **squares: float) -> SimpleNamespace:
    noise = SimpleNamespace(known=np.array([known]), usable=lambda valid: valid, floor=np.array([2e-9]))
    return SimpleNamespace(noise=noise, held_out_records=[SimpleNamespace(valid=np.ones((N, 1), bool))], **squares)


CHANCE = 4 * np.sqrt(2 * N)  # squares by which N of them differ by chance


def test_nothing_remains_that_is_within_four_deviations_of_the_noise():
    before = trial(N + 1e4, N + 1e4)
    assert unexplained_share(fitter(), search(before, trial(N + CHANCE - JUST, N + CHANCE - JUST))) == 0.0
    assert unexplained_share(fitter(), search(before, trial(N + CHANCE + JUST))) > 0.0
    assert unexplained_share(fitter(), search(before, trial(held=N + CHANCE + JUST))) > 0.0


def test_what_remains_is_a_share_of_root_mean_squares_fitted_or_held_out_whichever_is_larger():
    before = trial(N + 4e5, N + 1e6)
    assert unexplained_share(fitter(), search(before, trial(N + 1e3, N + 4e3))) == pytest.approx(np.sqrt(4e3 / 1e6))
    assert unexplained_share(fitter(), search(before, trial(N + 4e3, N + 1e3))) == pytest.approx(np.sqrt(4e3 / 4e5))
    assert unexplained_share(fitter(), search(trial(N + 1e3), trial(N + 5e3))) == pytest.approx(
        1.0
    )  # worse than before is all


@pytest.mark.parametrize("causes, most", [((), 0.05), ((GAIN,), 0.05), ((CREEP, GAIN), 0.05), ((DRIFT, CREEP), 0.1)])
def test_the_roughest_law_may_leave_what_it_says_and_any_law_a_twentieth(causes, most):
    assert model_error_allowance(search(None, trial(causes=causes))) == most


@pytest.mark.parametrize("side, is_loose", [(-JUST, False), (JUST, True)])
def test_numbers_are_loose_that_foresee_worse_than_none_beyond_four_deviations(side, is_loose):
    squares = {"chosen": 5e4 + CHANCE + side, "nominal": 5e4}
    chosen, nominal = trial(), trial()
    f = fitter(held_out_squares=lambda fit: squares["chosen" if fit is chosen.fit else "nominal"])
    assert poorly_determined(f, search(nominal, chosen)) == is_loose


@pytest.mark.parametrize("confirmed, shown", [(2 - JUST, False), (2 + JUST, True)])
def test_a_cause_is_confirmed_by_two_squares_held_out(confirmed, shown):
    chosen = trial(causes=(GAIN,))
    found = search(None, chosen, (trial(N + 500.0, N + confirmed),))
    assert unconfirmed(found) == (() if shown else (GAIN,))


@pytest.mark.parametrize("hidden, shown", [(249.0, False), (251.0, True)])
def test_a_cause_that_the_device_would_have_to_pay_for_needs_no_confirmation(hidden, shown):
    """Half of what it takes away is a penalty on the device's own numbers."""
    found = search(None, trial(causes=(GAIN,)), (trial(N + 500.0, penalty=hidden),))
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
    passed=True, known=True, rivals=((),), causes=(GAIN,), left=0.0, confirmed=50.0, worse=0.0, seen=False, apart=0.0
) -> str:
    nominal = trial(N + 1e6, N + 1e6)
    unknowns, theta = (number("p0", 2.0, 0.1),), (2.0 + 0.1 * apart,)
    chosen = trial(N + left**2 * 1e6, causes=causes, free_parameters=unknowns, theta=theta)
    found = search(nominal, chosen, (trial(N + 500.0, N + confirmed),) * len(causes), rivals[: len(causes)])
    f = fitter(known, held_out_squares=lambda fit: worse if fit is chosen.fit else 0.0)
    return verdict(f, found, ResidualTests((1.0,), {}, passed), seen)


def test_a_verdict_says_what_is_known():
    assert judged() == EXPLAINED and judged(causes=()) == CONSISTENT
    assert judged(causes=(), seen=True) == EXPLAINED  # read off the readings themselves
    assert judged(rivals=((GAIN,),)) == AMBIGUOUS
    assert judged(known=False) == PARTLY and judged(confirmed=0.0) == PARTLY and judged(worse=CHANCE + 1) == PARTLY
    assert judged(passed=False, left=0.049) == PARTLY and judged(passed=False, left=0.051) == UNEXPLAINED
    assert judged(passed=False, causes=()) == UNEXPLAINED and judged(passed=False, causes=(), known=False) == CONSISTENT
    assert judged(passed=False, left=0.5, known=False) == PARTLY
    assert judged(apart=6.0) == UNEXPLAINED and judged(apart=6.0, causes=()) == UNEXPLAINED


def test_a_whole_number_is_said_as_what_it_was_expected_to_be_and_the_weightier_cause_first(monkeypatch):
    """Reversed 0.9 to 1.1 times: one."""
    monkeypatch.setattr(
        "ctrlgen.diagnosis.selection.result.robust_deviations", lambda fit: np.full(len(fit.theta), 0.01)
    )
    chosen = trial(N, N, causes=(GAIN, REVERSED), free_parameters=(number("effect[0].gain", cause=0),), theta=(1.1,))
    bare = (trial(held=N + 100.0), trial(held=N + 300.0))
    first, second = findings(search(trial(held=1e3), chosen, bare, ((trial(cause=CREEP), trial()), ())))
    assert (first.effect, second.effect) == ("reversed", "drive_gain")
    assert first.parameters["share"].value == pytest.approx(1.0) and first.parameters["share"].ci95 == pytest.approx(
        (1.0, 1.0)
    )
    assert (first.held_out_gain, second.held_out_gain) == pytest.approx((0.3, 0.1))
    assert second.alternatives == (("creep", "stage:axis"),) and first.alternatives == ()
    assert second.parameters["gain"].value == pytest.approx(1.1)


def test_errors_are_root_mean_squares_of_valid_readings_in_the_readers_unit(monkeypatch):
    monkeypatch.setattr("ctrlgen.diagnosis.selection.result.prediction_uncertainty", lambda *_: np.array([5e-9]))
    valid = np.ones((4, 1), bool)
    valid[3] = False
    nominal, chosen = trial(), trial()
    f = fitter(predict=lambda fit, r: np.full((4, 1), 1e-6 if fit is nominal.fit else 3e-6))
    f.held_out_records = [SimpleNamespace(valid=valid, observed=np.array([[4e-6], [5e-6], [6e-6], [9.0]]))]
    f.recording = SimpleNamespace(channels=("reading.axis",), units=("um",))
    found = held_out_errors(f, search(nominal, chosen), np.array([True]))["reading.axis"]
    wanted = (np.sqrt((9 + 16 + 25) / 3), np.sqrt((1 + 4 + 9) / 3), 2e-3, 5e-3)
    assert (found.rms_before, found.rms_after, found.noise_floor, found.uncertainty) == pytest.approx(wanted)
    assert held_out_errors(f, search(nominal, chosen), np.array([False]))["reading.axis"].noise_floor is None
    f.held_out_records = []
    assert np.isnan(held_out_errors(f, search(nominal, chosen), np.array([True]))["reading.axis"].rms_after)


def lines(*frequencies: float | None, accepted=(), path=10.0) -> bool:
    """Whether errors that repeat so often per metre of path, and gains for None, are told apart by readings of 10 m."""
    causes = tuple(
        GAIN if f is None else Hypothesis("cyclic", "sensor:axis", "axis", count=k) for k, f in enumerate(frequencies)
    )
    fit = SimpleNamespace(
        structure=SimpleNamespace(causes=causes),
        values=lambda k: {"gain": 0.1} if frequencies[k] is None else {"period": 1 / frequencies[k]},
    )
    observed = np.linspace(0, path, 11)[:, None]
    record = SimpleNamespace(role="fit", time=np.arange(11), valid=np.ones((11, 1), bool), observed=observed)
    recording = SimpleNamespace(records=[record], channels=("reading.axis",))
    return lines_resolved(recording, fit, [causes[k] for k in accepted])


def test_two_lines_are_told_apart_by_half_a_period_over_the_path():
    assert lines(5.0, 5.051) and not lines(5.0, 5.049) and not lines(5.049, 5.0)
    assert lines(5.0, 5.026, path=20.0)


@pytest.mark.parametrize("begin", [0.0, 5.0])
def test_two_frequencies_are_told_apart_by_half_a_period_over_the_time_of_the_record(begin):
    """Ten seconds of it, whenever it begins, of a law that may act more than once at a place."""
    hum = Hypothesis("vibration", "disturbance:axis", "axis")
    prior = replace(hum.prior, repeatable=True)
    causes = [
        SimpleNamespace(effect=hum.effect, location=hum.location, at=hum.at, law=hum.law, prior=prior, k=k)
        for k in range(2)
    ]
    record = SimpleNamespace(role="fit", time=begin + np.arange(11), valid=np.ones((11, 1), bool))
    recording = SimpleNamespace(records=[record], channels=())
    for apart, told in ((0.049, False), (0.051, True)):
        fit = SimpleNamespace(
            structure=SimpleNamespace(causes=causes), values=lambda k, apart=apart: {"frequency": 2.0 + k * apart}
        )
        assert lines_resolved(recording, fit, ()) == told


def test_all_pairs_of_lines_are_looked_at_whatever_stands_between():
    assert not lines(None, 5.0, 5.01) and not lines(5.0, None, 5.01) and not lines(5.0, 7.0, 7.01)
    assert lines(5.0, 5.01, accepted=(0, 1)) and not lines(5.0, 5.01, 9.0, accepted=(0, 2))
    assert not lines(5.0, 5.01, 9.0, 9.01, accepted=(0, 1))


@pytest.mark.parametrize("period, means", [(6.29, True), (6.28, False)])
def test_a_cause_whose_law_does_not_hold_means_nothing(period, means):
    """Fringes of one metre must be longer than 2 pi metres, or the reading would fall as the position rises."""
    cause = Hypothesis("cyclic", "sensor:axis", "axis")
    fit = fitted(causes=(cause, GAIN))
    fit.values = lambda k: {"amplitude": 1.0, "period": period} if k == 0 else {"gain": 0.1}
    weigh = ModelSelection(
        SimpleNamespace(fit_records=[], held_out_records=[], recording=SimpleNamespace(channels=(), records=())), None
    )
    assert weigh.physically_meaningful(SimpleNamespace(fit=fit)) == means and weigh.physically_meaningful(
        SimpleNamespace(fit=fit), (cause,)
    )


def test_two_lines_that_only_beat_as_one_mean_nothing():
    causes = tuple(Hypothesis("cyclic", "sensor:axis", "axis", count=k) for k in range(2))
    fit = fitted(causes=causes)
    record = SimpleNamespace(
        role="fit", time=np.arange(11), valid=np.ones((11, 1), bool), observed=np.linspace(0, 10, 11)[:, None]
    )
    recording = SimpleNamespace(channels=("reading.axis",), records=(record,))
    weigh = ModelSelection(SimpleNamespace(fit_records=[], held_out_records=[], recording=recording), None)
    for apart, means in ((0.049, False), (0.051, True)):
        fit.values = lambda k, apart=apart: {"amplitude": 0.01, "period": 1 / (5.0 + k * apart)}
        assert weigh.physically_meaningful(SimpleNamespace(fit=fit)) == means
