"""A pitch before a line, laws that act with the motion before those that happen, a refused start replaced by the next."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from axis_records import AXIS, BACKLASH, fitter_of, played
from fitted_causes import DRIFT
from misfits import left
from strokes import MM, servo, strokes

from ctrlgen.diagnosis.diagnose import diagnose_recording
from ctrlgen.diagnosis.selection import rivals
from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.confusable import explains_better
from ctrlgen.diagnosis.selection.objections import objections
from ctrlgen.diagnosis.selection.precedence import acting_first, even_speed, why_alike
from ctrlgen.diagnosis.selection.pruning import no_worse, pruned
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.structure import Structure


def read_along(y: np.ndarray, step: float) -> SimpleNamespace:
    """A recording of one record to fit, which reads `y` [m] every `step` [s]."""
    time = step * np.arange(len(y))
    record = SimpleNamespace(role="fit", time=time, sample_time=step, period=None, drive=np.zeros((len(y), 1)))
    record.observed, record.valid = y[:, None], np.ones((len(y), 1), bool)
    return SimpleNamespace(records=[record], channels=("reading.axis",), kind="series")


LAWS = ["cyclic", "vibration", "vibration_per_record", "sensor_gain", "drift"]
PITCH, LINE = Hypothesis("cyclic", "sensor:axis", "axis"), Hypothesis("vibration", "disturbance:axis", "axis")
SPEED, WAY = 0.25 * MM, 0.25 * MM  # m/s, m: a line of 1 Hz


def pitched(place, time):
    return 8e-6 * np.sin(2 * np.pi * place / WAY + 0.7)


def hummed(place, time):
    return 8e-6 * np.sin(2 * np.pi * time + 0.7)


def diagnosed(folder, error, *speeds):
    recording = strokes(error, speeds, 4e-7, seconds=12.0)
    found = diagnose_recording(servo(folder), recording, laws=LAWS, jobs=0)
    (finding,) = found.findings
    return finding


@pytest.mark.long
@pytest.mark.parametrize("error", [pitched, hummed])
def test_at_one_speed_a_pitch_comes_first_and_a_line_stands_beside_it(tmp_path, error):
    """Each is as good as the other there, whichever acts: the corrected device must hold at other speeds."""
    finding = diagnosed(tmp_path, error, SPEED, SPEED)
    assert finding.effect == "cyclic" and finding.parameters["period"].value == pytest.approx(0.25, rel=1e-3)
    lines = {a.effect for a in finding.alternatives}
    assert "vibration" in lines and lines <= {"vibration", "vibration_per_record"}
    assert "another speed tells them apart" in why_alike(finding.cause, finding.alternatives[0])


@pytest.mark.long
@pytest.mark.parametrize("error, effect", [(pitched, "cyclic"), (hummed, "vibration")])
def test_where_speeds_differ_the_data_decide(tmp_path, error, effect):
    finding = diagnosed(tmp_path, error, SPEED, 0.6 * SPEED, 0.8 * SPEED)
    assert (finding.effect, finding.alternatives) == (effect, ())


@pytest.mark.parametrize("speeds, even", [((1.0,), True), ((1.0, -1.0), True), ((1.0, 0.6), False), ((1.0, 0.0), True)])
def test_a_motion_has_one_speed_whichever_way_it_goes_and_wherever_it_rests(speeds, even):
    y = np.cumsum(np.repeat(np.array(speeds) * 1e-6, 400))
    recording = read_along(y, 0.01)
    found = even_speed(recording, "axis")
    assert found == (pytest.approx(1e-4, rel=1e-6) if even else None)


def test_why_a_cause_has_an_alternative_is_told():
    assert "another course" in why_alike(BACKLASH, LINE) and "another course" in why_alike(DRIFT, BACKLASH)
    coulomb, stribeck = (Hypothesis(e, "stage:axis", "axis") for e in ("coulomb", "stribeck"))
    assert why_alike(coulomb, stribeck) == "another form of dry friction"
    assert why_alike(BACKLASH, coulomb) == "their effects on these readings are alike"


@pytest.fixture
def trials() -> Trials:
    fitter = fitter_of(played)
    found = Trials(fitter, Screen(fitter, [BACKLASH]), lambda _: None)
    found.objections = lambda *_: {}
    found.converged = lambda t: t
    found.each = lambda function, items, sentence=None: [function(found, item) for item in items]
    return found


def leaving(trials: Trials, cause: Hypothesis, start: dict[str, float], share: float) -> CandidateModel:
    """The axis with a cause, said to leave so much of the squares of both kinds of records, and more than noise."""
    before, fit = (
        trials.fit(Structure(AXIS), steps=0),
        trials.fitter.fit(Structure(AXIS).with_cause(cause, start), steps=0),
    )
    errors = trials.fitter.with_errors_of(before.fit).error
    return replace(before, fit=fit, errors=errors, cause=cause, fitted=left(1e6 * share), held_out=left(1e6 * share))


@pytest.mark.parametrize("share, first", [(0.49, "drift"), (0.51, "backlash")])
def test_a_law_that_acts_comes_before_a_drift_that_takes_away_twice_as_much(trials, share, first):
    """Where both leave more than noise."""
    before = trials.fit(Structure(AXIS), steps=0)
    noisy = trials.fitter.with_errors_of(before.fit).error
    bare = replace(before, fitted=left(1e6), held_out=left(1e6), errors=noisy)
    drift = leaving(trials, DRIFT, {"rate": 1e-6}, 0.2)
    play = leaving(trials, BACKLASH, {"gap": 6e-8}, 1 - 0.8 * share)
    best = acting_first(trials, bare, drift, [drift, play])
    assert best.cause is not None and best.cause.effect == first
    assert acting_first(trials, bare, play, [drift, play]) is play


@pytest.mark.parametrize("share, taken", [(0.8, "backlash"), (0.05, "drift")])
def test_a_function_of_time_takes_no_place_of_a_law_that_acts_by_an_error_of_form(trials, monkeypatch, share, taken):
    """At one speed a line follows what a pitch misses as well: with a few per cent less it took the pitch's place."""
    play = leaving(trials, BACKLASH, {"gap": 6e-8}, 0.1)
    drift = leaving(trials, DRIFT, {"rate": 1e-6}, 0.1 * share)
    assert explains_better(trials.selection, drift, play)
    monkeypatch.setattr(rivals, "replacements", lambda trials, current, k: [drift])
    assert [c.effect for c in rivals.swapped(trials, play, 1).causes] == [taken]


@pytest.mark.parametrize("rate, told", [(0.19, True), (0.21, False)])
@pytest.mark.parametrize("levels_off", [False, True])
def test_a_drift_of_a_fifth_of_the_motion_is_none(rate, told, levels_off):
    """Of ten seconds; one that levels off with ten has gone by 1 - 1/e of what it comes to."""
    drifted = {"size": -rate * 1e-5 / (1 - np.exp(-1)), "tau": 10.0} if levels_off else {"rate": -rate * 1e-6}
    recording = read_along(np.linspace(-5e-6, 5e-6, 11), 1.0)
    cause = Hypothesis("warm_up", "sensor:axis", "axis") if levels_off else DRIFT
    structure = SimpleNamespace(causes=(cause,), free_parameters=())
    fit = SimpleNamespace(structure=structure, theta=(), values=lambda k: drifted)
    reason = "it would drift by 21 % of the motion within a record"
    assert objections(recording, fit) == ({} if told else {0: reason})
    assert objections(recording, fit, exact=True) == {}


def test_a_refused_start_is_replaced_by_the_next():
    """Of two ways the first leads to fringes that are as short as the steps of the reading."""
    pitch = 4e-7

    def fringed(u):
        y = played(u, 0.0)
        return y + 2e-8 * np.sin(2 * np.pi * y / pitch)

    fitter = fitter_of(fringed)
    found = Trials(fitter, Screen(fitter, [PITCH]), lambda _: None)
    before = found.fit(Structure(AXIS))
    starts = [{"amplitude": 2e-8, "period": way, "phase": 0.0} for way in (1.3e-7, 1.7e-7, pitch)]
    real = found.objections
    found.objections = lambda t, accepted=(): (
        {0: "too short"} if t.causes and t.fit.values(0)["period"] < 2e-7 else real(t, accepted)
    )
    found.selection.__class__.advantage, kept = (lambda self, a, b: 1.0), found.selection.__class__.advantage
    try:
        refused = found.fit(Structure(AXIS).with_cause(PITCH, starts[0]))
        best = pruned(found, refused, (), {PITCH: starts}, before)
    finally:
        found.selection.__class__.advantage = kept
    assert best is not None and best.fit.values(0)["period"] == pytest.approx(pitch, rel=1e-3)
    assert [r.reasons for r in found.refused] == [("too short",)]
    assert pruned(found, refused, ()) is None


@pytest.mark.parametrize("energy, stays", [(1.01, True), (1.04, False)])
def test_an_answer_that_predicts_worse_than_the_device_as_described_is_that_device(monkeypatch, trials, energy, stays):
    nominal = trials.fit(Structure(AXIS), steps=0)
    found = trials.fit(Structure(AXIS).with_cause(BACKLASH, {"gap": 6e-8}), steps=0)
    monkeypatch.setattr(
        "ctrlgen.diagnosis.selection.pruning.held_out_energy", lambda _, t: 1e4 * (energy if t.causes else 1.0)
    )
    assert no_worse(trials, nominal, found) is (found if stays else nominal)
