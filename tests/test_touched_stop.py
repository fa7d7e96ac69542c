"""A stop that the record to fit only touches is told as what it is, since the held-out record runs into it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import AXIS, KF, C, K, M, drive, record

from ctrlgen.diagnosis.report.told_beside import clock_note
from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.candidates import as_meant
from ctrlgen.diagnosis.selection.model_selection import scored
from ctrlgen.diagnosis.selection.rivals import simplified
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.search import Searcher
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.estimation.drive_clock import drive_clock, with_drive_clock
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.integration_error import LARGEST, with_steps_that_suffice
from ctrlgen.estimation.noise import estimate_noise
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Recording

H, N, NOISE, STIFFNESS = 5e-4, 3000, 1e-9, 4e6
STOP = Hypothesis("end_stop", "stage:axis", "axis")


def stopped(u: np.ndarray, gap: float, fine: int = 40) -> np.ndarray:
    """Position [m] of the axis under `u` [V], held, with a spring twenty times as stiff beyond `gap`: Runge and Kutta's steps."""
    h, q, v, out = H / fine, 0.0, 0.0, []

    def pull(q: float, v: float, force: float) -> float:
        return (force - C * v - K * q - STIFFNESS * max(q - gap, 0.0)) / M

    for volts in u.tolist():
        out.append(q)
        force = KF * volts
        for _ in range(fine):
            a = pull(q, v, force)
            b = pull(q + h / 2 * v, v + h / 2 * a, force)
            c = pull(q + h / 2 * (v + h / 2 * a), v + h / 2 * b, force)
            d = pull(q + h * (v + h / 2 * b), v + h * c, force)
            q, v = q + h * v + h * h / 6 * (a + b + c), v + h / 6 * (a + 2 * b + 2 * c + d)
    return np.array(out)


def recorded(early: float = 0.0) -> tuple[Fitter, float]:
    """A stop touched in the record to fit and run into in the other, where the drive comes so many samples before its time stamps."""
    rng, t = np.random.default_rng(0), H * np.arange(N)
    fit, held = 0.55 * drive(N), 0.68 * (1.6 * np.sin(2 * np.pi * 1.7 * t) + 0.4 * np.sin(2 * np.pi * 7.3 * t))
    gap = float(stopped(fit, np.inf).max()) - 4e-7
    parts = []
    for k, (u, role) in enumerate(((fit, "fit"), (held, "hold_out"))):
        y = stopped(np.interp(t + early * H, t, u), gap) + NOISE * rng.standard_normal(N)
        parts.append(record(u, y, role, first=k * N * H, h=H))
    recording = Recording("t", AXIS.name, "series", ("reading.axis",), ("nm",), (NOISE,), tuple(parts), ())
    return Fitter(recording, estimate_noise(recording, 0.5)), gap


@pytest.fixture(scope="module")
def touched() -> tuple[Fitter, float]:
    return recorded()


def model(fitter: Fitter, gap: float) -> tuple[Fitter, CandidateModel]:
    """The stop fitted from its true numbers, and the fitter with the errors that it leaves."""
    begun = Structure(AXIS).with_cause(STOP, {"stiffness": STIFFNESS, "gap": gap, "power": 1.0})
    weighed = fitter.with_errors_of(fitter.fit(replace(begun, finer=2)))
    return weighed, scored(weighed, weighed.fit(replace(begun, finer=2)), STOP)


@pytest.mark.long
def test_a_drive_that_comes_before_its_time_stamps_bends_no_stop():
    """By a hundredth of a sample, 5 us: seven times the noise, where the stage is fast, that no other number takes away."""
    fitter, bent = model(*recorded(early=0.01))
    searcher = Searcher(fitter, Screen(fitter, [STOP]), lambda _: None)
    right = searcher.clocked(bent)
    clock = searcher.trials.fitter.clock
    assert clock == pytest.approx(0.01 * H, rel=0.02)
    left = [np.sqrt(t.fitted.plain_mean[0]) for t in (bent, right)]
    assert left[0] > 5 and left[1] < 1.1
    # told where stamps are not so far off, and only there
    assert clock_note(searcher.trials.fitter) == []
    (note,) = clock_note(replace(fitter, clock=-0.024 * H))
    assert "1.2e-05 s behind" in note and "0.024 of a sample" in note


@pytest.mark.long
def test_a_drive_that_is_in_time_stays_so(touched):
    """And one that is so late that it has a name: a twentieth of a sample."""
    fitter, true = model(*touched)
    same, fit = with_drive_clock(fitter, true.fit)
    assert same is fitter and fit is true.fit
    late, bent = model(*recorded(early=-0.05))
    assert with_drive_clock(late, bent.fit)[0] is late
    # what is said to shift in time says it alone
    delayed = bent.fit.restarted.with_cause(Hypothesis("delay", "sensor:axis", "axis"), {"delay": 1e-4})
    assert drive_clock(late, late.fit(delayed, steps=0)) is None


def test_the_law_is_that_of_the_stop_at_the_depth_at_which_it_is_touched(touched):
    """A corner of 0.1 um, a thousandth of the travel, would leave a multiple of the noise."""
    fitter, gap = touched
    true = Structure(AXIS).with_cause(STOP, {"stiffness": STIFFNESS, "gap": gap, "power": 1.0})
    fit = fitter.fit(true, steps=0)
    for r in fitter.recording.records:
        assert np.std(r.observed - fitter.predict(fit, r)) < 1.1 * NOISE


def test_a_touch_is_simulated_in_as_many_steps_as_the_noise_asks_for(touched):
    """What steps miss at the corner bends the numbers of a stop that is only touched, which then foretell no run into it."""
    fitter, gap = touched
    true = Structure(AXIS).with_cause(STOP, {"stiffness": STIFFNESS, "gap": gap, "power": 1.0})
    usual = fitter.fit(true, steps=0)
    fine = fitter.fit(with_steps_that_suffice(fitter, usual), steps=0)

    def missed(fit):
        """What is wrong of the readings, over the noise; the worst record."""
        exact = [(fitter.predict(fit, r)[:, 0], stopped(r.drive[:, 0], gap)) for r in fitter.recording.records]
        return max(np.sqrt(np.mean((y - x) ** 2)) for y, x in exact) / NOISE

    assert fine.structure.finer in (2, 4) and missed(usual) > LARGEST
    # half the steps tell the error to a third: where in a step the corner lies changes it
    assert missed(fine) < 1.33 * LARGEST
    assert with_steps_that_suffice(fitter, fitter.fit(Structure(AXIS), steps=0)).finer == 1
    assert with_steps_that_suffice(fitter, usual, most=2).finer == 2


def test_a_spring_beyond_an_edge_that_is_refused_shows_where_the_stop_stands(touched):
    """The valley of a stop that is touched is as narrow as the depth, 0.4 um of 65, and no start of its own lies in it."""
    fitter, gap = touched
    spring = Hypothesis("stiffness_above", "stage:axis", "axis")
    trials = Trials(fitter, Screen(fitter, [STOP, spring]), lambda _: None)
    bare = trials.fit(Structure(AXIS), steps=0)
    refused = trials.fit(Structure(AXIS).with_cause(spring, {"stiffness": 2e6, "edge": gap - 1e-7}), spring)
    assert trials.objections(refused) == {0: "a spring that is touched from a place on is a stop"}
    (stop,) = as_meant(trials, bare, [refused])
    assert stop.causes == (STOP,) and stop.fit.values(0)["gap"] == pytest.approx(gap, abs=5e-8)
    # a spring that lets go outwards is what it is called, and so is a cause that was there before
    softer = Structure(AXIS).with_cause(spring, {"stiffness": -1e4, "edge": gap - 1e-6})
    inward = scored(fitter, fitter.fit(softer, steps=0), spring)
    assert as_meant(trials, bare, [inward]) == as_meant(trials, refused, [refused]) == ()


@pytest.mark.long
def test_a_shape_that_the_fit_leaves_open_is_the_usual_one(touched):
    fitter, gap = touched
    start = {"stiffness": 1.9e6, "gap": gap - 3e-8, "power": 1.64}
    open_ = scored(fitter, fitter.fit(Structure(AXIS).with_cause(STOP, start)), STOP)
    plain = simplified(Trials(fitter, Screen(fitter, [STOP]), lambda _: None), open_)

    def missed(t):
        return [np.std(r.observed - fitter.predict(t.fit, r)) for r in fitter.recording.records]

    stiffness, _, power = plain.fit.theta[-3:]
    assert power == pytest.approx(1.0, abs=0.1) and stiffness == pytest.approx(STIFFNESS, rel=0.1)
    (fitted, held), (fitted_before, held_before) = missed(plain), missed(open_)
    assert fitted == pytest.approx(fitted_before, rel=0.02) and held < 0.5 * held_before
