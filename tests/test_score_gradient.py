"""The screen's slopes against what they stand for: a plain recursion, and differences of simulated readings."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import DEVICE

from ctrlgen import build_model, load_device
from ctrlgen.diagnosis.selection import score_gradient as slopes_module
from ctrlgen.diagnosis.selection.ltv_propagation import LtvPropagation
from ctrlgen.diagnosis.selection.score_gradient import ScoreGradient, law_terms
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import PARAMETER, DataHints, Hypothesis
from ctrlgen.estimation.noise import Noise, NoiseSource
from ctrlgen.estimation.settings import CANDIDATE_TERMS
from ctrlgen.estimation.simulator import Simulator
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Record, Recording

H, N = 1e-3, 700
HEXAPOD = load_device(DEVICE)
LAWS = [
    Hypothesis("creep", "stage:1X", "1X"),
    Hypothesis("stiffening", "stage:2Y", "2Y"),
    Hypothesis("hysteresis", "stage:3X", "3X"),
    Hypothesis("drive_gain", "actuator:1Y", "1Y"),
    Hypothesis("drive_gain", "actuator:all", "all"),
    Hypothesis("heater_resistance", "actuator:2X", "2X"),
    Hypothesis("cubic_sensor", "sensor:delta_x", "delta_x"),
    Hypothesis("low_pass", "sensor:theta_z", "theta_z"),
    Hypothesis("swapped", "actuator:1X", "1X", "2X"),
    Hypothesis("frame_rotation_z", "mechanism:delta_x", "delta_x"),
    Hypothesis(PARAMETER, "actuator:thermal_resistance", path="actuator.thermal_resistance"),
]


def shows_nothing(place, i):
    return DataHints()


def terms_at(record):
    """The terms of the laws of the hexapod, that any structure shares."""
    channels = tuple(f"reading.{name}" for name in build_model(HEXAPOD).signals["reading"].channels)
    return law_terms(HEXAPOD, LAWS, channels, record.timing, len(record.time))


@pytest.fixture(scope="module")
def hexapod():
    """A fitter on one record of six moving actuators, with noise that remembers in three channels and a gap in one."""
    model = build_model(HEXAPOD)
    channels = tuple(f"reading.{name}" for name in model.signals["reading"].channels)
    t = np.arange(N)[:, None] * H
    u = model.u_scale * (0.4 + 0.3 * np.sin(2 * np.pi * (3.0 + np.arange(6)) * t + np.arange(6)))
    valid = np.ones((N, 6), bool)
    valid[300:320, 2] = False
    records = [Record(role, role, t[:, 0], H, u, np.zeros((N, 6)), False, None, valid) for role in ("fit", "hold_out")]
    y = Simulator(HEXAPOD, (), channels, H, False).simulate(records[0], np.zeros(0))
    sd = np.ptp(y, axis=0) / 300
    noisy = y + sd * np.random.default_rng(4).standard_normal(y.shape)
    records = [Record(r.name, r.role, r.time, H, u, noisy, False, None, valid) for r in records]
    recording = Recording(
        "t", HEXAPOD.name, "series", channels, ("rad",) * 3 + ("m",) * 3, (None,) * 6, tuple(records), ()
    )
    ar = tuple(np.array([0.4, -0.1]) if i % 2 else np.zeros(0) for i in range(6))
    return Fitter(recording, Noise(sd, ar, (NoiseSource.REST,) * 6, ("",) * 6, np.full(6, np.inf)))


def brute(slopes, start):
    """S (n, n_y, columns) by the recursion over all states and all columns, whitened."""
    r, record = slopes.simulator, slopes.record
    after, _ = r.simulate_states(record, slopes.p, start)
    before = np.vstack([r.starting_state(record, slopes.p, start), after[:-1]])
    F_S, F_p, H_S, H_p = slopes.linear.evaluate_along(before, *r.inputs(record))
    motion = (before, record.drive, np.zeros((N, 1)), after)
    _, f, ends = slopes.laws.along(slopes.p, slopes.laws.start(record.time[0]), *motion)
    f = np.hstack([f, np.tile(slopes.sizes, (N, 1))])
    following = np.vstack([f[1:], f[-1:]])
    following[:, slopes.laws.driven] = ends
    mean = (f + following) / 2
    D, Y = np.zeros((r.n_s, len(slopes.columns))), np.zeros((N, 6, len(slopes.columns)))
    enters = np.zeros((f.shape[1], len(slopes.columns), F_p.shape[2]))
    for j, column in enumerate(slopes.columns):
        for probe, term in zip(column.probes, column.terms, strict=True):
            enters[term, j, probe] += 1.0
    for k in range(N):
        Y[k] = H_S[k] @ D + H_p[k] @ np.einsum("t,tjp->pj", f[k], enters)
        D = F_S[k] @ D + F_p[k] @ np.einsum("t,tjp->pj", mean[k], enters)
    return Y


def test_the_sums_of_the_screen_are_those_of_a_plain_recursion(hexapod, monkeypatch):
    monkeypatch.setattr(slopes_module, "CANDIDATE_TERMS", replace(CANDIDATE_TERMS, block=123))
    fit = hexapod.fit(Structure(HEXAPOD))
    record = hexapod.fit_records[0]
    slopes = ScoreGradient(hexapod, fit, record, LAWS, shows_nothing, terms_at(record))
    white, J = fit.residual[: N * 6].reshape(N, 6), fit.J[: N * 6].reshape(N, 6, -1)
    found = slopes.sums(white, J, fit.initial_states[0])
    noise, usable = hexapod.noise, hexapod.noise.usable(record.valid)
    S = noise.whiten(brute(slopes, fit.initial_states[0]), np.ones((N, 6), bool)) * usable[:, :, None]
    # Huber's weight, as the fit's own derivatives
    S *= np.minimum(1.0, 3.0 / np.maximum(np.abs(white), 1e-300))[:, :, None]
    assert np.abs(white).max() > 3.0
    for name, value in (
        ("US", np.einsum("nik,nij->kj", J, S)),
        ("Sr", np.einsum("nij,ni->j", S, white)),
        ("SS", np.einsum("nij,nik->jk", S, S, optimize=True)),
    ):
        size = np.sqrt(np.outer(np.sum(J**2, axis=(0, 1)), np.sum(S**2, axis=(0, 1)))) if name == "US" else 1.0
        size = np.sqrt(np.einsum("nij,nij->j", S, S)) * np.linalg.norm(white) if name == "Sr" else size
        size = np.sqrt(np.outer(*(np.einsum("nij,nij->j", S, S),) * 2)) if name == "SS" else size
        assert np.abs((getattr(found, name) - value) / size).max() < 1e-12, name


@pytest.mark.long
@pytest.mark.parametrize("law", [h for h in LAWS if h.effect != PARAMETER], ids=lambda h: f"{h.effect}-{h.at}")
def test_a_slope_is_the_difference_of_two_simulations(hexapod, law):
    fit = hexapod.fit(Structure(HEXAPOD))
    record = hexapod.fit_records[0]
    slopes = ScoreGradient(hexapod, fit, record, [law], shows_nothing, terms_at(record))
    column, start = slopes.columns[-1], np.zeros(len(fit.initial_states[0]))
    name, off = law.law.amplitude().name, slopes.laws.terms[column.terms[0]].off
    slope = brute(slopes, start)[:, :, -1]
    structure = Structure(HEXAPOD).with_cause(law, {**column.shape, name: off + column.size})
    simulator = Simulator(structure.device_with_causes, (f"effect[0].{name}",), hexapod.recording.channels, H, False)
    ends = [simulator.simulate(record, np.array([off + share * column.size])) for share in (0.01, 0.0)]
    apart = (ends[0] - ends[1]) / 0.01
    assert np.linalg.norm(slope - apart) < 0.04 * np.linalg.norm(apart)


POSED = [
    Hypothesis("creep", "stage:1X", "1X"),
    Hypothesis("hysteresis", "stage:3X", "3X"),
    Hypothesis("second_pole", "actuator:2Y", "2Y"),
    Hypothesis("degradation", "actuator:1Y", "1Y"),
    Hypothesis("cubic_sensor", "sensor:delta_x", "delta_x"),
]


@pytest.mark.long
@pytest.mark.parametrize("law", POSED, ids=lambda h: f"{h.effect}-{h.at}")
def test_a_slope_of_poses_that_have_not_settled_is_the_difference_of_two_simulations(hexapod, law):
    count, dwell = 30, 0.02  # four time constants of the heaters
    u = build_model(HEXAPOD).u_scale * np.random.default_rng(5).uniform(0.2, 0.8, (count, 6))
    records = tuple(
        Record(
            role,
            role,
            dwell * np.arange(count),
            dwell,
            u,
            np.zeros((count, 6)),
            False,
            None,
            np.ones((count, 6), bool),
            poses=True,
        )
        for role in ("fit", "hold_out")
    )
    fitter = Fitter(replace(hexapod.recording, kind="poses", records=records), hexapod.noise)
    fit = fitter.fit(Structure(HEXAPOD), steps=0)
    slopes = ScoreGradient(fitter, fit, records[0], [law], shows_nothing, terms_at(records[0]))
    column, start = slopes.columns[-1], np.zeros(len(fit.initial_states[0]))
    lost = np.zeros(len(slopes.laws.terms) + len(slopes.sizes), bool)
    blocks = [list(readings) for _, _, readings in slopes.blocks(start, lost)]
    slope = np.zeros((count, 6))
    for i, seen in enumerate(slopes.spread.seen):
        if len(slopes.columns) - 1 in seen:
            slope[:, i] = np.vstack([b[i] for b in blocks])[:, list(seen).index(len(slopes.columns) - 1)]
    name, off = law.law.amplitude().name, slopes.laws.terms[column.terms[0]].off
    structure = Structure(HEXAPOD).with_cause(law, {**column.shape, name: off + column.size})
    free = (f"effect[0].{name}",)
    simulator = Simulator(structure.device_with_causes, free, hexapod.recording.channels, *records[0].timing)
    ends = [simulator.simulate(records[0], np.array([off + share * column.size])) for share in (0.01, 0.0)]
    apart = (ends[0] - ends[1]) / 0.01
    assert np.linalg.norm(slope - apart) < 0.04 * np.linalg.norm(apart)


def test_terms_written_down_for_one_structure_serve_another(hexapod):
    """What a law reads differs between structures: before the gain of 1Y its heater is told something else than after it."""
    record, kept = hexapod.fit_records[0], terms_at(hexapod.fit_records[0])
    structures = [Structure(HEXAPOD), Structure(HEXAPOD).with_cause(LAWS[3], {"gain": 0.2})]
    lag = Hypothesis("second_pole", "actuator:1Y", "1Y")
    found = []
    for structure in structures:
        fit = hexapod.fit(structure, steps=0)
        white, J = fit.residual[: N * 6].reshape(N, 6), fit.J[: N * 6].reshape(N, 6, -1)
        for laws in (kept, terms_at(record)):
            slopes = ScoreGradient(hexapod, fit, record, [*LAWS[:3], lag], shows_nothing, laws)
            found.append(slopes.sums(white, J, fit.initial_states[0]))
    first, _, second, alike = (np.sqrt(np.diag(sums.SS)) for sums in found)
    assert np.array_equal(found[0].SS, found[1].SS)
    assert np.allclose(second, alike, rtol=1e-12)
    assert np.abs(second / first - 1)[-1] > 0.1  # the lag takes what the gain has made of the command


def test_groups_carry_only_what_enters_them():
    F_S = np.array([[1, 0, 0], [1, 1, 0], [0, 0, 1]], bool)
    F_p = np.array([[1, 0, 0], [0, 0, 0], [0, 1, 0]], bool)
    H_S, H_p = np.array([[0, 1, 0], [0, 0, 1]], bool), np.array([[0, 0, 0], [0, 0, 1]], bool)
    columns = [SimpleNamespace(probes=p, terms=range(len(p))) for p in ((0,), (1,), (2,), (0, 1))]
    spread = LtvPropagation((F_S, F_p, H_S, H_p), columns)
    assert [(list(g.states), list(g.columns)) for g in spread.groups] == [([0, 1], [0, 3]), ([2], [1, 3])]
    assert [list(seen) for seen in spread.seen] == [[0, 3], [1, 2, 3]]


def test_a_device_without_free_numbers_is_screened(hexapod):
    fit = hexapod.fit(Structure(HEXAPOD))
    bare = replace(fit, J=np.zeros((len(fit.residual), 0)))
    assert len(Screen(hexapod, LAWS[:2]).run(bare).suspects) == 2
