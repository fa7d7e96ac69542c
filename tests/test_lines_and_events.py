"""What speaks against a cause: lines that cannot be told apart or are the drive's, events at an onset, a law beyond its range."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from axis_records import AXIS
from fitted_causes import GAIN, fitted

from ctrlgen.diagnosis.selection.objections import objections
from ctrlgen.diagnosis.selection.way_covered import with_longest_periods
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.structure import Structure


def lines(*frequencies: float | None, accepted=(), path=10.0) -> bool:
    """Whether errors that repeat so often per metre of path, and gains for None, are told apart by readings of 10 m."""
    causes = tuple(
        GAIN if f is None else Hypothesis("cyclic", "sensor:axis", "axis", count=k) for k, f in enumerate(frequencies)
    )
    fit = SimpleNamespace(
        structure=SimpleNamespace(device=AXIS, causes=causes, free_parameters=()),
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
    structure = SimpleNamespace(device=AXIS, causes=(cause,), free_parameters=())
    fit = SimpleNamespace(structure=structure, theta=(), values=lambda k: values)
    reason = "the reading covers 1.5 periods of it, and 1.5 are needed to see it repeat"
    assert objections(recording, fit) == ({} if told else {0: reason})
    # one that was accepted shorter may have grown since, as where two causes nearly make up for one another
    assert objections(recording, fit, [cause]) == objections(recording, fit)
    assert objections(recording, fit, exact=True) == {}
    # nor may one that is accepted go on to less than a period where noise alone is left
    values["period"] = 1e-6 / 0.9
    assert objections(recording, fit, [cause], exact=True).keys() == {0}


def test_a_period_that_is_seen_to_repeat_grows_into_none_that_is_not():
    """A turn and a bit more, beside a load on the same axis, once took the place of half a turn. One that begins longer may stay so."""
    record = SimpleNamespace(role="fit", observed=np.array([[0.0], [3e-6]]), valid=np.ones((2, 1), bool))
    recording = SimpleNamespace(records=[record], channels=("reading.axis",))
    known = Hypothesis("cyclic", "sensor:axis", "axis")
    (cause, gain) = with_longest_periods([known, GAIN], recording, AXIS)
    assert cause.longest_period == pytest.approx(2e-6) and cause == known and gain is GAIN

    def longest(period: float) -> float:
        start = {"amplitude": 1e-9, "period": period, "phase": 0.0}
        return next(u.high for u in Structure(AXIS, (cause,), (start,)).free_parameters if u.name == "period")

    assert longest(1.9e-6) == cause.longest_period < longest(2.1e-6)


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
    reason = "it is harmonic 3 of the drive's period, as everything is that the drive causes"
    assert objections(recording, line([HUM], 6.0 + apart / 10)) == ({} if own else {0: reason})
    assert objections(recording, line([HUM], 6.0), exact=True) == {}


@pytest.mark.parametrize("held_out, own", [(0.5, False), (0.2, False), (0.71, True), (None, True)])
def test_a_line_that_a_drive_of_another_period_meets_too_is_its_own(held_out, own):
    """50 Hz is a harmonic of every drive of a round period: 25 of half a second, of 0.71 s none."""
    recording = timed(np.linspace(0.0, 10.0, 1001))
    other = timed(np.linspace(0.0, 10.0, 1001)).records[0]
    recording.records[0].period, other.period, other.role = 0.5, held_out, "hold_out"
    recording.records.append(other)
    assert bool(objections(recording, line([HUM], 50.0))) != own


def test_an_event_where_the_motion_ends_is_none_either_and_a_reversal_is_no_end():
    time = 1e-3 * np.arange(400)
    drive = np.where(time < 0.2005, np.sin(2 * np.pi * 5 * time), 0.0)[:, None]
    assert objections(timed(time, drive), stepped(0.2)) and objections(timed(time, drive), stepped(0.05)) == {}
    held = np.where((time > 0.05) & (time < 0.06), np.sin(2 * np.pi * 5 * 0.05), drive[:, 0])[:, None]
    assert objections(timed(time, held), stepped(0.05)) == {}  # ten samples are no rest


def test_all_pairs_of_lines_are_looked_at_whatever_stands_between():
    assert not lines(None, 5.0, 5.01) and not lines(5.0, None, 5.01) and not lines(5.0, 7.0, 7.01)
    # of two that have moved together since they were accepted, one
    assert not lines(5.0, 5.01, accepted=(0, 1)) and not lines(5.0, 5.01, 9.0, accepted=(0, 2))
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
