"""A record that goes on in the middle of a run begins with the displacement of its hot heaters, and these are found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from conftest import DEVICES
from model_logs import LOGS, write_log

from ctrlgen import load_device
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.noise import Noise, NoiseSource
from ctrlgen.estimation.settled_start import start_of, states_to_begin
from ctrlgen.estimation.simulator import Simulator
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.reader import load_recordings


@pytest.fixture(scope="module")
def split(tmp_path_factory):
    """A fitter of a log that is held out from its row 840 on, the numbers as stated, and the noise of its readings, which have none."""
    folder, model, text = write_log(LOGS["heaters"], tmp_path_factory.mktemp("hot"))
    (folder / "recording.toml").write_text(text)
    recording = load_recordings([folder / "recording.toml"], model)
    sd = np.array([1e-6 if "theta" in c else 2e-9 for c in recording.channels])
    n_y = len(sd)
    noise = Noise(sd, (np.zeros(0),) * n_y, (NoiseSource.STATED,) * n_y, ("",) * n_y, np.full(n_y, np.inf))
    fitter = Fitter(recording, noise)
    return fitter, fitter.fit(Structure(load_device(DEVICES / LOGS["heaters"].file)), steps=0), sd


def test_the_states_with_which_a_part_begins_are_found_from_rest(split):
    fitter, fit, sd = split
    (held,) = fitter.held_out_records
    left = np.sqrt(np.mean((held.observed - fitter.predict(fit, held)) ** 2, axis=0))
    assert np.all(left < 0.1 * sd)  # 60 um from rest


def test_what_begins_cold_begins_at_rest(split):
    fitter, fit, _ = split
    (cold,), (hot,) = fitter.fit_records, fitter.held_out_records
    starts = [start_of(fitter.simulator(fit.structure, r), fitter.error, fit.theta, r) for r in (cold, hot)]
    assert not starts[0].any() and np.all(starts[1] > 100.0)
    assert np.array_equal(states_to_begin(fitter.problem(fit.structure), fit.theta), starts[0])


def test_where_a_record_is_expected_to_begin_costs_a_fit_nothing(split):
    fitter, fit, _ = split
    (hot,) = fitter.held_out_records
    alone = replace(fitter, recording=replace(fitter.recording, records=(replace(hot, role="fit"),)))
    problem = alone.problem(fit.structure)
    assert np.all(problem.expected > 100.0)
    priors = [
        problem.residual(problem.to_scaled(np.concatenate([fit.structure.start, states])))[-len(states) :]
        for states in (problem.expected, np.zeros_like(problem.expected))
    ]
    assert not priors[0].any() and np.allclose(priors[1], -problem.expected / problem.initial_sd[0])


def test_they_are_found_under_a_large_discrepancy_of_one_reading(split):
    fitter, fit, sd = split
    recording = fitter.recording
    late = []
    for record in recording.records:
        observed = record.observed.copy()
        observed[3:, 0], observed[:3, 0] = observed[:-3, 0], observed[0, 0]
        late.append(replace(record, observed=observed))
    plain = replace(fitter, recording=replace(recording, records=tuple(late))).with_errors_of(fit)
    beside = plain.errors.rms / sd
    assert beside[0] > 100.0 * beside[1:].max()
    delay = Hypothesis("delay", "sensor:theta_x", "theta_x")
    right = plain.fit(fit.structure.with_cause(delay, {"delay": 3e-3}), steps=0)
    (held,) = plain.held_out_records
    left = np.sqrt(np.mean((held.observed - plain.predict(right, held)) ** 2, axis=0))
    assert np.all(left[1:] < 0.1 * sd[1:])


def test_the_first_reading_and_its_slopes_are_those_of_the_states(split):
    fitter, fit, _ = split
    (record,), (held,) = fitter.fit_records, fitter.held_out_records
    r = fitter.simulator(fit.structure, record)
    after, _ = r.simulate_states(record, fit.theta)
    free = list(r.free_initial_states)
    hot = (after[-1] - r.initial_state(held, fit.theta))[free]
    y, Y = r.sensitivities(held, fit.theta, hot, by_free=False)
    assert np.abs(y[0] - held.observed[0]).max() < 1e-9 and np.abs(hot).min() > 100.0
    assert np.array_equal(y, r.simulate(held, fit.theta, hot))
    first = replace(held, **{name: getattr(held, name)[:3] for name in ("time", "drive", "observed", "valid")})
    for k, step in enumerate(np.eye(len(hot))):
        slope = (r.simulate(first, fit.theta, hot + step) - r.simulate(first, fit.theta, hot - step)) / 2
        assert np.allclose(Y[:3, :, k], slope, rtol=0, atol=2e-3 * np.abs(slope).max())


def test_the_first_reading_has_slopes_by_the_numbers_of_the_device(split):
    fitter, fit, _ = split
    (held,) = fitter.held_out_records
    first = replace(held, **{name: getattr(held, name)[:2] for name in ("time", "drive", "observed", "valid")})
    r = Simulator(fit.structure.device, ("stage.half_stage_stiffness",), fitter.recording.channels, held.sample_time)
    p, hot = np.asarray(r.model.p_nominal, float), np.full(len(r.free_initial_states), 250.0)
    slope = r.sensitivities(first, p, hot)[1][0, :, 0]
    ends = [r.simulate(first, p * (1 + sign * 1e-4), hot)[0] for sign in (1, -1)]
    wanted = (ends[0] - ends[1]) / (2e-4 * p[0])
    assert np.abs(wanted).max() * p[0] > 1e-6 and np.allclose(slope, wanted, rtol=0, atol=1e-4 * np.abs(wanted).max())


def test_where_it_has_no_slopes_it_is_asked_once(split, monkeypatch):
    fitter, fit, _ = split
    (held,) = fitter.held_out_records
    asked, real = [], Simulator.sensitivities

    def none(self, *given, **more):
        asked.append(1)
        y, Y = real(self, *given, **more)
        return y, np.full_like(Y, np.inf)

    monkeypatch.setattr(Simulator, "sensitivities", none)
    start, y = replace(fitter, noise=replace(fitter.noise, sd=2 * fitter.noise.sd)).begun(fit, held)
    assert len(asked) == 1 and np.isfinite(y).all() and np.isfinite(start).all()
