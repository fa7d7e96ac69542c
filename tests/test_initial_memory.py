"""Records that begin in the middle of a motion: where the plays of a hysteresis stood is found from what follows."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from axis_records import AXIS, BACKLASH, FINE, H, fine, move, record
from planted_axis import slew_rate
from play_records import NOISE, SERVO, lagging, moved
from recovery import fitter_of

from ctrlgen.core.files import validate
from ctrlgen.devices import Device
from ctrlgen.estimation import initial_memory
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.initial_memory import begins_worse, memory_before
from ctrlgen.estimation.least_squares import initial_state_sd
from ctrlgen.estimation.settings import INITIAL_MEMORY
from ctrlgen.estimation.structure import Structure

LAW = Hypothesis("displacement_hysteresis", "stage:axis", "axis")
REACH, SHARE = 2e-5, 0.15
BEGUN = {"share": SHARE, "reach": REACH, "taper": 0.0, "reversible": 0.0}


def cut(fit_from: int, held_from: int) -> tuple[Fitter, Structure]:
    """Records from these samples on; the axis went through plays that lag by up to 1.7 um, 170 times the noise, before."""
    device = validate(Device.library["servo"], SERVO, "device")
    rng, parts = np.random.default_rng(1), []
    for seed, role, begin in ((2, "fit", fit_from), (4, "hold_out", held_from)):
        u = moved(seed)
        y = lagging(u, REACH * np.arange(1, 9) / 8, SHARE) + NOISE * rng.standard_normal(len(u))
        parts.append(record(u[begin:], y[begin:], role, h=H))
    fitter = fitter_of(device, ("reading.axis",), ("um",), (NOISE,), "series", parts)
    return fitter, Structure(device).with_cause(LAW, BEGUN)


@pytest.mark.parametrize("begin", [280, 440])
def test_a_held_out_record_begins_with_the_memory_of_what_was_before(begin):
    fitter, structure = cut(0, begin)
    fit, held = fitter.fit(structure, steps=3), fitter.held_out_records[0]
    assert (
        np.sqrt(np.mean((held.observed - fitter.predict(fit, held)) ** 2)) < 1.1 * NOISE
    )  # 6 of it from the middle of all plays


def test_the_driven_side_of_a_gap_is_looked_for_where_one_step_led_astray():
    """A step bent the speed and the place with which a record begins, and was shortened to a quarter of the way to the driven side."""
    gap, rng, t = 4e-6, np.random.default_rng(1), H * np.arange(400)
    u = np.where(t < 0.1, 0.0, 0.8 * np.sin(2 * np.pi * 11 * t))
    w, y = -0.7 * gap / 2, []
    for place in fine(u).tolist():
        w = min(max(w, place - gap / 2), place + gap / 2)
        y.append(w)
    part = record(u, np.array(y[::FINE]) + NOISE * rng.standard_normal(len(u)), "hold_out")
    fitter = fitter_of(AXIS, ("reading.axis",), ("um",), (NOISE,), "series", [replace(part, role="fit"), part])
    structure = Structure(AXIS).with_cause(BACKLASH, {"gap": gap})
    simulator = fitter.simulator(structure, part)
    sd = initial_state_sd(simulator)
    (start,) = simulator.gaps
    astray = np.zeros(len(sd))
    astray[start] = -0.17 / sd[start]

    def white(record, readings):
        return ((record.observed - readings) / NOISE).ravel()

    assert begins_worse(part, white(part, simulator.simulate(part, structure.start, sd * astray)))
    found = memory_before(simulator, structure.start, part, astray, np.zeros(len(sd)), white)
    assert sd[start] * found[start] == pytest.approx(-0.7, abs=0.125)


def test_a_record_to_fit_begins_with_the_memory_of_what_was_before():
    fitter, structure = cut(280, 0)
    fit = fitter.fit(structure)
    assert np.sqrt(fit.chi2 / fit.n) < 1.1  # 15 from the middle of all plays
    assert fit.values(0)["share"] == pytest.approx(SHARE, rel=0.01)


def test_a_fit_from_there_ends_where_it_cannot_win_as_any_other_does():
    fitter, structure = cut(280, 0)
    early, whole = fitter.fit(structure, enough=-np.inf), fitter.fit(structure)
    assert np.array_equal(early.theta, structure.start) and not np.array_equal(whole.theta, structure.start)
    assert whole.objective < early.objective < 0.1 * fitter.initial_objective(structure)  # from there, but no step on


@pytest.mark.parametrize("way", (0.0, *INITIAL_MEMORY.ways_back))
@pytest.mark.parametrize("side, back", [(-1.0, 1), (1.0, -1), (0.0, 1), (0.0, -1)])
def test_a_turning_point_is_sought_where_the_record_begins_and_every_way_back(monkeypatch, way, side, back):
    """From either side, or from rest. A record that begins at `here` has these readings from that turning point alone."""
    here, at_rest = 0.3, np.zeros(2)
    turned = np.array([here + back * way, side])
    simulator = SimpleNamespace(
        plays=((0, 0, 1),),
        gaps=(),
        slews=(),
        simulate=lambda record, theta, states: states,
        simulate_states=lambda record, theta, states: (np.array([[here - states[0]]]),),
    )
    monkeypatch.setattr(initial_memory, "initial_state_sd", lambda _: np.ones(2))
    part = record(at_rest, at_rest, "fit")
    found = memory_before(simulator, at_rest, part, at_rest, at_rest, lambda _, y: 1e3 * (y - turned))
    assert found == pytest.approx(turned, abs=1e-12)


def test_a_fit_and_a_prediction_look_for_the_memory_about_the_states_that_they_expect(monkeypatch):
    """In prior deviations: each of its own record."""
    fitter, structure = cut(280, 280)
    sd = initial_state_sd(fitter.simulator(structure, fitter.fit_records[0]))
    asked, about = [], 1.0 + np.arange(len(sd))
    monkeypatch.setattr("ctrlgen.estimation.fit.states_to_begin", lambda *_: 0.01 * sd * about)
    monkeypatch.setattr("ctrlgen.estimation.fit.begins_elsewhere", lambda *_: True)
    monkeypatch.setattr("ctrlgen.estimation.fit.start_of", lambda *_: 0.02 * sd * about)
    monkeypatch.setattr("ctrlgen.estimation.fit.memory_before", lambda *a: asked.append(a[4]) or a[3])
    fitted = fitter.fit(structure, steps=0)
    fitter.predict(fitted, fitter.held_out_records[0])
    assert np.array(asked) == pytest.approx(np.outer([0.01, 0.02], about))


def only_a_prior(monkeypatch, plays, gaps, n):
    """A simulator whose readings tell nothing of where its n states began, each of a prior deviation of one."""
    monkeypatch.setattr(initial_memory, "initial_state_sd", lambda _: np.ones(n))
    return SimpleNamespace(
        plays=plays,
        gaps=gaps,
        slews=(),
        simulate=lambda record, theta, states: states,
        simulate_states=lambda record, theta, states: (np.zeros((1, n)),),
    )


def test_a_memory_is_weighed_by_how_far_it_is_from_where_it_is_expected(monkeypatch):
    """From rest, the first states that are tried lie nearer to what is expected, and from that none does."""
    simulator, rest = only_a_prior(monkeypatch, ((0, 0, 1),), (), 2), np.zeros(2)
    part, expected = record(rest, rest, "fit"), np.array([INITIAL_MEMORY.ways_back[-1], -1.0])
    nothing = lambda *_: rest[:0]  # noqa: E731
    assert memory_before(simulator, rest, part, rest, expected, nothing) == pytest.approx(expected)
    assert memory_before(simulator, rest, part, expected, expected, nothing) is expected


def test_the_driven_side_of_a_gap_moves_nothing_else_from_where_it_is_expected(monkeypatch):
    simulator, rest = only_a_prior(monkeypatch, (), (0,), 2), np.zeros(2)
    side, expected = INITIAL_MEMORY.sides[0], np.array([0.0, 3.0])
    told = np.array([side, 3.0])
    found = memory_before(simulator, rest, record(rest, rest, "fit"), rest, expected, lambda _, y: 1e3 * (y - told))
    assert found == pytest.approx(told)


SLEWS = Hypothesis("slew_rate", "actuator:axis", "axis")


def cut_while_it_slews():
    """The axis from where its amplifier, of 12 V/s, is farthest behind its drive; a record to fit and the same to hold out."""
    n, rng = 2400, np.random.default_rng(1)
    t, noise = H * np.arange(n), 5e-9
    u = 1.5 * np.sin(2 * np.pi * 2.3 * t) + 0.3 * np.sin(2 * np.pi * 13.1 * t + 1)
    y = slew_rate(u, t)
    begin = 1000 + int(np.argmax(np.abs(y - move(u))[1000:1400]))
    part = record(u[begin:], y[begin:] + noise * rng.standard_normal(n - begin), "hold_out", h=H)
    part = replace(part, resumed=True)
    return fitter_of(AXIS, ("reading.axis",), ("um",), (noise,), "series", [replace(part, role="fit"), part]), noise


def test_an_amplifier_that_slews_when_a_record_begins_is_behind_its_drive_there():
    fitter, noise = cut_while_it_slews()
    (part,) = fitter.held_out_records
    fit = fitter.fit(Structure(AXIS).with_cause(SLEWS, {"share": 1.0, "rate": 12.0}), steps=0)
    assert np.sqrt(np.mean((part.observed - fitter.predict(fit, part)) ** 2)) < 1.1 * noise  # 100 of it before
