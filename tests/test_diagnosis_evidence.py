"""What stands beside the verdict, on recordings simulated without ctrlgen: exact steps of m, c, k, finer than a sample."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from axis_records import AXIS, KF, NOISE, SETTLING, C, H, K, M, N, axis_fitter, drive, move, record
from conftest import MESO_FILE
from scipy.signal import lfilter

from ctrlgen import build_model, load_device, load_scenario
from ctrlgen.core.to_json import plain
from ctrlgen.devices.changed_numbers import written
from ctrlgen.diagnosis.evidence import unmodelled_dynamics
from ctrlgen.diagnosis.evidence.detectability import detectability
from ctrlgen.diagnosis.evidence.drive_envelope import DriveEnvelope
from ctrlgen.diagnosis.evidence.excitation_signals import admissible, time_series
from ctrlgen.diagnosis.evidence.experiment_design import separate
from ctrlgen.diagnosis.evidence.experiment_files import files
from ctrlgen.diagnosis.evidence.ltv_linearisation import linearise_along
from ctrlgen.diagnosis.evidence.residual_localisation import localise_residual, regions_of
from ctrlgen.diagnosis.evidence.residual_location import LocatedIn
from ctrlgen.diagnosis.evidence.spectral_lines import spectral_lines
from ctrlgen.diagnosis.evidence.supporting_analyses import run_supporting_analyses
from ctrlgen.diagnosis.evidence.unknown_input import estimate_unknown_input
from ctrlgen.diagnosis.evidence.unmodelled_dynamics import describe_unmodelled_force
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.search import Searcher
from ctrlgen.diagnosis.selection.search_history import search_history
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.noise import Noise, NoiseSource, estimate_noise
from ctrlgen.estimation.profile_likelihood import BOUNDED, profiles
from ctrlgen.estimation.robust_covariance import robust_deviations, sandwich_over_model
from ctrlgen.estimation.simulator import Simulator
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.reader import load_recordings
from ctrlgen.recordings.recording import Recording
from ctrlgen.reporting.result_file import json_text

CREEP, DRIFT, CUBIC = (
    Hypothesis("creep", "stage:axis", "axis"),
    Hypothesis("drift", "sensor:axis", "axis"),
    Hypothesis("stiffening", "stage:axis", "axis"),
)


def mapped(fitter, structure=None):
    """The fit, its linearisations and the map of what it leaves."""
    fit = fitter.fit(structure or Structure(AXIS))
    left = [linearise_along(fitter, fit, r) for r in (*fitter.fit_records, *fitter.held_out_records)]
    return fit, left, localise_residual(left, fitter.recording.channels, fitter.recording.units)


def stop(t, q, v, memory):
    return -4e4 * max(q - 55e-6, 0.0), memory


def coulomb(t, q, v, memory):
    return -0.05 * np.tanh(v / 1e-4), memory


def cubic(t, q, v, memory):
    return -2e10 * q**3, memory


def detent(t, q, v, memory):
    return 0.2 * np.sin(2 * np.pi * q / 30e-6), memory


def creeping(t, q, v, memory, gain=0.02, tau=0.6, fine=10):
    """The stage yields by gain of the displacement, with the time constant tau: as a force of k times that."""
    return K * gain * memory, memory + H / fine / tau * (q - memory)


def test_a_stop_is_placed_at_the_end_of_the_travel_where_it_stands():
    region = mapped(axis_fitter(stop))[2].by_travel["axis"]
    assert max(region, key=lambda s: s.share) is region[-1]
    assert region[-1].share > 0.5 and region[-1].ci95[0] > 10


def test_a_clean_record_has_nothing_to_place():
    found = mapped(axis_fitter())[2]
    assert found.by_reading[0].ci95[0] < 0 < found.by_reading[0].ci95[1]
    assert found.coordinates.located_in is LocatedIn.NO_EXCESS
    assert not any("direction" in said for said in found.statements)


def test_friction_differs_by_direction_and_a_cubic_spring_does_not():
    rubbed = mapped(axis_fitter(coulomb))[2].by_direction["axis"]
    sprung = mapped(axis_fitter(cubic))[2].by_direction["axis"]
    assert rubbed[0].label == "forward" and rubbed[0].mean_ci95[1] < 0 < rubbed[1].mean_ci95[0]
    assert sprung[0].mean_ci95[1] > sprung[1].mean_ci95[0] and sprung[1].mean_ci95[1] > sprung[0].mean_ci95[0]


def test_a_vibration_is_placed_in_its_band_and_owes_nothing_to_the_drive():
    bands = mapped(axis_fitter(change=lambda y, u: y + 30e-9 * np.sin(2 * np.pi * 70 * np.arange(len(y)) * H)))[
        2
    ].by_frequency
    worst = max(bands, key=lambda b: b.excess)
    assert worst.low < 70 < worst.high and worst.ci95[0] > 1
    assert worst.coherence < 0.5


def test_a_step_is_placed_in_time():
    def late(y, u):
        return y + 40e-9 * (np.arange(len(y)) > 0.8 * len(y))

    time = mapped(axis_fitter(change=late))[2].by_time
    loud = [k for k, s in enumerate(time[:10]) if s.excess > 20]
    assert loud and min(loud) >= 8  # tenths of the record to fit


@pytest.mark.parametrize(
    ("law", "word"),
    [(lambda q: q, "at the excited lines only"), (lambda q: q + 40 * q**2, "even"), (lambda q: q + 4e6 * q**3, "odd")],
)
def test_the_lines_of_a_periodic_drive_tell_the_class_of_the_nonlinearity(law, word):
    t = np.arange(3000) * H
    u = sum(0.5 * np.cos(2 * np.pi * k * t + k**2) for k in (1, 3, 7))
    y = law(move(u)) + NOISE * np.random.default_rng(1).standard_normal(len(u))
    said = spectral_lines(record(u, y, "fit"), 0, "reading.axis", "um").statement
    assert word in said and ("even" in said) == (word == "even")


@pytest.fixture(scope="module")
def meso():
    device = load_device(MESO_FILE)
    channels = tuple(f"reading.{c}" for c in build_model(device).signals["reading"].channels)
    return device, channels, Simulator(device, (), channels, np.inf, False)


def pose_fitter(meso, on_drive, on_pose):
    """40 poses to fit and 20 to hold out; what the device does wrong is done here, outside its model."""
    device, channels, simulator = meso
    rng = np.random.default_rng(5)
    u = rng.uniform(-2e-4, 2e-4, (60, 6))
    noise = np.repeat([2e-6, 2e-7], 3)
    blank = record(u, np.zeros((60, 6)), "fit", h=np.inf)
    blank = replace(blank, drive=u * on_drive)
    y = simulator.simulate(blank, np.zeros(0)) * on_pose + noise * rng.standard_normal((60, 6))
    parts = [record(u[a], y[a], role, h=np.inf) for role, a in (("fit", slice(0, 40)), ("hold_out", slice(40, 60)))]
    units = ("deg",) * 3 + ("um",) * 3
    recording = Recording("t", device.name, "poses", channels, units, tuple(noise), tuple(parts), ())
    return Fitter(recording, estimate_noise(recording, SETTLING))


def test_a_weak_actuator_and_a_wrong_reading_are_told_apart(meso):
    device = meso[0]
    weak, wrong = np.ones(6), np.ones(6)
    weak[2], wrong[3] = 0.97, 0.97
    for on_drive, on_pose, kind, name in (
        (weak, 1.0, "actuator", "2y"),
        (1.0, wrong, "reading", "reading.delta_x"),
    ):
        found = mapped(pose_fitter(meso, on_drive, on_pose), Structure(device))[2]
        assert found.coordinates.located_in == kind
        alone = found.coordinates.explained_by_one[kind]
        assert max(alone, key=alone.get) == name and alone[name] > 0.9
        # Poses reached from below stand higher on the whole
        assert not any("direction" in said for said in found.statements)
        other = {"actuator": "reading", "reading": "actuator"}[kind]
        assert found.coordinates.participation_ratio[kind] < 1.2 < found.coordinates.participation_ratio[other]


def test_the_free_force_is_the_hidden_one():
    def bumps(t, q, v, memory):
        return 0.08 * np.exp(-(((t - 0.9) / 0.04) ** 2)) - 0.05 * np.exp(-(((t - 1.8) / 0.1) ** 2)), memory

    fitter = axis_fitter(bumps)
    left = mapped(fitter)[1]
    found = estimate_unknown_input(left[0], fitter.noise, np.array([0.05]))
    true = np.array([bumps(t, 0, 0, 0)[0] for t in left[0].record.time])
    assert np.sqrt(np.mean((found.f[:, 0] - true) ** 2)) < 0.02 * np.abs(true).max()
    assert np.corrcoef(found.f[:, 0], true)[0, 1] > 0.99


def test_the_free_force_is_the_conditional_mean_with_its_deviation():
    """Against the Gaussian posterior written out as one dense system."""
    fitter = axis_fitter(stop, n=150)
    left = mapped(fitter)[1][0]
    size, n = 0.05, len(left.white)
    found = estimate_unknown_input(left, fitter.noise, np.array([size]))
    D = np.hstack([np.eye(2), np.zeros((2, n))])  # of the state, by what it starts with and every f
    G = np.zeros((n, n + 2))
    for k in range(n):
        own = np.zeros(n + 2)
        own[2 + k] = 1.0
        G[k] = left.H_S[k, 0] @ D + left.H_f[k, 0, 0] * own
        D = left.F_S[k] @ D + np.outer(left.F_f[k, :, 0], own)
    prior = np.zeros((n + 2, n + 2))
    prior[:2, :2] = np.diag(left.start_sd**2)
    prior[2:, 2:] = size**2 * (1 + found.speed * np.minimum.outer(np.arange(n), np.arange(n)))
    gain = prior @ G.T @ np.linalg.inv(G @ prior @ G.T + NOISE**2 * np.eye(n))
    np.testing.assert_allclose(found.f[:, 0], (gain @ left.residual[:, 0])[2:], atol=1e-4 * size)
    posterior = prior - gain @ G @ prior
    np.testing.assert_allclose(found.sd[:, 0], np.sqrt(np.diag(posterior)[2:]), rtol=1e-3)


def test_unknown_physics_is_mapped_and_described_but_not_named():
    fitter = axis_fitter(detent)
    _, left, _ = mapped(fitter)
    found = describe_unmodelled_force(fitter, left)
    share = {m.coordinate: m.variance_share for m in found.maps["axis"]}
    assert found.quantity == "force" and found.unit == "N"
    assert share["position"] > 3 * max(share["time"], share["velocity"])
    warm = [replace(a, record=replace(a.record, ambient=np.linspace(0, 1, len(a.record.time)))) for a in left]
    assert {m.coordinate for m in describe_unmodelled_force(fitter, warm).maps["axis"]} - share.keys() == {
        "temperature"
    }


def test_profiles_are_finite_and_cover():
    """Ten records; 95 % intervals that cover in seven or fewer of them would have a chance of 1e-3."""
    covered = 0
    for seed in range(10):
        off = 1 + np.array([0.05, 0.2, 0.05, 0.02]) * np.random.default_rng(seed).standard_normal(4)  # as stated
        fitter = axis_fitter(cubic, n=1500, seed=seed, numbers=(M, C, K, KF) * off)
        fit = fitter.fit(Structure(AXIS).with_cause(CUBIC, {"k3": 1e10}))
        (found,) = profiles(fitter, fit)
        low, high = found.ci95
        assert found.verified and found.shape == BOUNDED
        assert low < found.value < high and high - low < 0.2 * found.value
        covered += low <= 2e10 * 1e-18 <= high  # N/um^3
    assert covered >= 8


def test_a_shape_without_amplitude_is_not_bounded():
    fitter = axis_fitter(n=1500)
    fit = fitter.fit(Structure(AXIS).with_cause(CREEP, {"gain": 1e-4, "tau": 0.3, "slow": 0.1}))
    found = {p.parameter: p for p in profiles(fitter, fit)}
    assert found["tau"].shape != BOUNDED and found["tau"].verified


def test_noise_with_memory_taken_as_white_widens_the_interval():
    def red(e):
        return lfilter([np.sqrt(1 - 0.95**2)], [1, -0.95], e)

    ratios = []
    for white in (None, red):
        fitter = axis_fitter(white=white)
        assert len(fitter.noise.ar[0]) == 0
        fit = fitter.fit(Structure(AXIS).with_cause(DRIFT, {"rate": 1e-9}))
        ratios.append(sandwich_over_model(fit)[-1])
        widened = robust_deviations(fit)[-1] / np.sqrt(fit.covariance[-1, -1])
        assert widened == (1.0 if white is None else ratios[-1])
        (found,) = profiles(fitter, fit)
        width = found.ci95[1] - found.ci95[0]
        assert width > 1.9 * 1.96 * np.sqrt(fit.covariance[-1, -1]) * 1e6 * max(ratios[-1] / 1.25, 1)
    assert ratios[0] < 1.25 < 2 < ratios[1]


def rivals():
    """A short slow record of a stage that creeps, fitted with creep and with drift."""
    u = 1.5 * np.minimum(np.arange(600) * H / 0.05, 1.0)
    fitter = axis_fitter(lambda *a: creeping(*a, gain=4e-4, tau=2.0), u=u)
    creep = fitter.fit(Structure(AXIS).with_cause(CREEP, {"gain": 1e-3, "tau": 1.0, "slow": 0.0}))
    drift = fitter.fit(Structure(AXIS).with_cause(DRIFT, {"rate": 1e-8}))
    return fitter, creep, drift


def test_drift_and_creep_get_an_experiment_that_separates_them():
    fitter, creep, drift = rivals()
    found = separate(fitter, creep, drift, "both explain this recording alike")
    assert found.before < 3 < found.after and found.after > 2 * found.before
    assert found.settles and found.candidates[0].separation == max(c.separation for c in found.candidates)
    u = found.proposed.drive[:, 0]
    y = move(u, lambda *a: creeping(*a, gain=4e-4, tau=2.0))
    y = y + NOISE * np.random.default_rng(9).standard_normal(len(u))
    new = replace(found.proposed, observed=y[:, None])
    parts = (*fitter.recording.records, new)
    both = Fitter(Recording(**{**fitter.recording.__dict__, "records": parts}), fitter.noise)
    gained = both.fit(drift.structure).objective - both.fit(creep.structure).objective
    assert 0.7 < gained / found.after**2 < 1.4  # measured, the proposal settles it as far as was promised


def test_a_drive_that_could_do_far_too_much_is_used_a_little():
    """A limit of 400 V, of which the stage bears two volts."""
    strong = AXIS.actuator.model_copy(update={"drive_limit": written(400.0, "V")})
    structure = Structure(AXIS.model_copy(update={"actuator": strong}))
    fitter = axis_fitter()
    template = fitter.fit_records[0]
    simulator = structure.simulator(fitter.recording.channels, template.timing)
    endless = np.full(1, np.inf)
    stated = DriveEnvelope(*simulator.model.u_bounds, endless, endless)
    for shape in time_series(2000, stated, H, 0, 1):
        record, strength = admissible(shape, simulator, structure.start, template, 0.0, stated)
        assert strength < 0.02 and 0.3 < np.abs(record.drive).max() < 4.0


def test_the_proposal_is_a_recording_to_fill_in(tmp_path):
    fitter, creep, drift = rivals()
    for name, text in files(fitter, creep, separate(fitter, creep, drift, ""), "../device.toml").items():
        (tmp_path / name).write_text(text)
    lines_ = (tmp_path / "drive.csv").read_text().splitlines()
    rng = np.random.default_rng(0)
    filled = [lines_[0] + ",reading.axis [um]", *(f"{line},{rng.standard_normal():.6g}" for line in lines_[1:])]
    (tmp_path / "drive.csv").write_text("\n".join(filled))
    read = load_recordings([tmp_path], build_model(AXIS))
    assert [r.role for r in read.records] == ["fit", "hold_out"] and not (tmp_path / "scenario.toml").exists()


def test_the_proposal_for_a_hexapod_is_a_scenario(meso, tmp_path):
    device = meso[0]
    fitter = pose_fitter(meso, 1.0, 1.0)
    bare = fitter.fit(Structure(device))
    pair = [
        fitter.fit(bare.structure.with_cause(Hypothesis("drive_gain", f"actuator:{at}", at), {"gain": 1e-3}))
        for at in ("2y", "3x")
    ]
    for name, text in files(fitter, bare, separate(fitter, *pair, ""), str(MESO_FILE)).items():
        (tmp_path / name).write_text(text)
    scenario = load_scenario(tmp_path)
    assert scenario.bind(build_model(device)).samples.shape[1] == 6


@pytest.mark.long
def test_what_is_called_detectable_is_seen_and_half_of_it_is_not():
    clean = axis_fitter()
    fit = clean.fit(Structure(AXIS))
    open_ = [CUBIC, CREEP, DRIFT]
    found = detectability(fit, Screen(clean, open_).run(fit), fit.n).smallest["stiffening"]
    seen = {0.5: 0, 1.5: 0}
    for share in seen:
        for seed in range(3):
            k3 = share * found.detectable_from * 1e18  # N/um^3
            fitter = axis_fitter(lambda t, q, v, memory, k3=k3: (-k3 * q**3, memory), seed=20 + seed)
            screened = Screen(fitter, open_).run(fitter.fit(Structure(AXIS)))
            z = next(s.z for s in screened.suspects if s.hypothesis == CUBIC)
            seen[share] += abs(z) > screened.threshold
    assert seen == {0.5: 0, 1.5: 3}


def test_what_a_record_at_one_place_hides_is_said():
    fitter = axis_fitter(u=np.full(600, 1e-9))
    fit = fitter.fit(Structure(AXIS))
    found = detectability(fit, Screen(fitter, [CUBIC, DRIFT]).run(fit), fit.n)
    assert [h.effect for h in found.undetectable] == ["stiffening"] and "drift" in found.smallest


def test_a_gain_shows_only_at_the_price_of_what_the_device_states():
    """The force constant is stated to 2 %, the stiffness to 5 %: together they take a gain of some 5 % for nothing."""
    fitter = axis_fitter()
    fit = fitter.fit(Structure(AXIS))
    gain = Hypothesis("sensor_gain", "sensor:axis", "axis")
    smallest = detectability(fit, Screen(fitter, [CUBIC, gain]).run(fit), fit.n).smallest["sensor_gain"]
    assert 0.05 < smallest.detectable_from < 4 * np.hypot(0.02, 0.05)


@pytest.mark.long
def test_evidence_is_numbers_that_json_knows(monkeypatch):
    fitter = axis_fitter(lambda t, q, v, memory: (cubic(t, q, v, 0)[0] + 0.02 * detent(t, q, v, 0)[0], 0), n=1000)
    search = Searcher(fitter, Screen(fitter, [CUBIC, DRIFT]), lambda _: None).run(AXIS)
    found = run_supporting_analyses(search, explained=False)
    history = search_history(search)
    entries = (found.residual_location, found.detectability, found.unmodelled_force.record(), *history)
    assert sum(len(json_text(entry)) for entry in entries) < 1e6
    assert found.unmodelled_force.sentences() and "unmodelled_force" not in found.residual_location.after.as_json()
    assert [row.round for row in history] == list(range(1, len(search.rounds) + 1))
    monkeypatch.setattr(
        unmodelled_dynamics, "estimate_unknown_input", lambda *_: SimpleNamespace(f=np.array([np.nan]), sd=np.ones(1))
    )
    without = run_supporting_analyses(search, explained=False)
    assert without.unmodelled_force is None
    assert without.failed == ("the unknown input is left out: it grows without bound along the motion",)
    first, last = history[0], history[-1]
    assert first.decision == "added stiffening at stage:axis" and first.candidates[0].causes[0].accepted
    assert last.decision.endswith("stopped")
    assert not any(cause.accepted for trial in last.candidates for cause in trial.causes)
    assert plain({"a": np.array([np.nan, 1.0]), "b": np.bool_(True)}) == {"a": [None, 1.0], "b": True}


def test_noise_of_one_colour_is_taken_at_its_density():
    """Free force of pure red noise stays within its own intervals."""
    e = lfilter([np.sqrt(1 - 0.9**2)], [1, -0.9], np.random.default_rng(4).standard_normal(N)) * NOISE
    parts = (record(drive(), move(drive()) + e, "fit"), record(drive(), move(drive()) + e[::-1], "hold_out", N * H))
    recording = Recording("t", AXIS.name, "series", ("reading.axis",), ("um",), (None,), parts, ())
    noise = Noise(
        np.array([NOISE * np.sqrt(1 - 0.9**2)]),
        (np.array([0.9]),),
        (NoiseSource.STATED,),
        ("given",),
        np.array([np.inf]),
    )
    fitter = Fitter(recording, noise)
    left = mapped(fitter)[1]
    found = estimate_unknown_input(left[0], noise, np.array([K * NOISE]))
    assert np.mean(np.abs(found.f) < 1.96 * found.sd) > 0.9


def test_a_rounding_of_zero_is_no_end_of_a_region():
    travel = np.linspace(0.0, 6e-6, 101)
    travel[0] = -3.4e-21
    assert next(text for text, _ in regions_of(travel, "um")) == "0 ... 1.2 um"
