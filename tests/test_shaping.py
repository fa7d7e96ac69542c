"""Input shaping and drives without inertia feedforward. What the stage does is reckoned by scipy from mass, damping and stiffness, what is
left of a vibration by the closed form of Singer and Seering (1990)."""

from __future__ import annotations

import numpy as np
import pytest
from command_line import ctrlgen as run
from conftest import SCENARIOS
from scipy.linalg import eigh
from scipy.signal import cont2discrete

from ctrlgen import InputError, SolverError, build_model, load_scenario, solve
from ctrlgen.devices import load_device
from ctrlgen.model.quasi_static import natural_modes, quasi_static

AXIS = SCENARIOS / "devices" / "flexure_axis.toml"
MASS, DAMPING, STIFFNESS, FORCE = 0.5, 30.0, 0.2e6, 10.0  # of flexure_axis.toml: kg, N*s/m, N/m, N/V
MODE, RATIO = np.sqrt(STIFFNESS / MASS) / (2 * np.pi), DAMPING / (2 * np.sqrt(STIFFNESS * MASS))
TRAVEL, H = 50e-6, 5e-5
LINE = 'kind = "line"\nend = { axis = "50 um" }\nsmooth = 3\n'


def written(folder, shaping="", feedforward="static", path=LINE, device=AXIS, rate="20 kHz", duration="4 ms"):
    (folder / "scenario.toml").write_text(
        f'title = "t"\ndevice = "{device}"\nsample_rate = "{rate}"\nduration = "{duration}"\nfeedforward = "{feedforward}"\n{shaping}\n'
        f"[path]\n{path}"
    )
    return load_scenario(folder)


def solved(folder, *given, **words):
    scenario = written(folder, *given, **words)
    return solve(scenario, build_model(scenario.device))


def driven(drive, more=0, start=(0.0, 0.0)):
    """(n + more + 1, 2) position and speed of the stage, the last drive held: exact for held drives."""
    A, B, *_ = cont2discrete(
        (
            np.array([[0, 1], [-STIFFNESS / MASS, -DAMPING / MASS]]),
            np.array([[0], [FORCE / MASS]]),
            np.eye(2),
            np.zeros((2, 1)),
        ),
        H,
    )
    u, y = np.append(drive, np.full(more, drive[-1])), [np.array(start)]
    for each in u:
        y.append(A @ y[-1] + B[:, 0] * each)
    return np.array(y)


def vibration(solution, at):
    """The amplitude [m] of what vibrates after the path, as if it had begun at the time `at`."""
    y = driven(solution.drive[:, 0])
    d, v = y[-1] - [TRAVEL, 0.0]
    w_d = 2 * np.pi * MODE * np.sqrt(1 - RATIO**2)
    size = np.hypot(d, (v + RATIO * 2 * np.pi * MODE * d) / w_d)
    return size * np.exp(RATIO * 2 * np.pi * MODE * (H * len(solution.drive) - at))


def left(times, amplitudes):
    """Singer and Seering (1990): what impulses leave of a vibration, both as if it had begun with the first of them."""
    w = 2 * np.pi * MODE
    grown, phase = amplitudes * np.exp(RATIO * w * times), w * np.sqrt(1 - RATIO**2) * times
    return np.hypot(np.sum(grown * np.cos(phase)), np.sum(grown * np.sin(phase)))


def impulses(kind, frequency, ratio):
    """Times and amplitudes as the paper prints them."""
    K = np.exp(-np.pi * ratio / np.sqrt(1 - ratio**2))
    amplitudes = {
        "ZV": np.array([1, K]) / (1 + K),
        "ZVD": np.array([1, 2 * K, K**2]) / (1 + 2 * K + K**2),
        "ZVDD": np.array([1, 3 * K, 3 * K**2, K**3]) / (1 + 3 * K + 3 * K**2 + K**3),
    }[kind]
    return np.arange(len(amplitudes)) / (2 * frequency * np.sqrt(1 - ratio**2)), amplitudes


@pytest.mark.parametrize("kind", ["ZV", "ZVD", "ZVDD"])
def test_a_shaped_line_leaves_no_vibration_without_inertia_feedforward(tmp_path, kind):
    plain = vibration(solved(tmp_path), 0.0)
    assert plain > 0.3 * TRAVEL  # 4 ms are less than half a period
    shaped = solved(tmp_path, f'shaping = {{ kind = "{kind}" }}')
    # What sampling the set-point at 20 kHz leaves of the smooth path's own
    assert vibration(shaped, 0.0) < 1e-7 * plain
    last = impulses(kind, MODE, RATIO)[0][-1]
    assert len(shaped.drive) == 80 + np.ceil(last / H)
    assert shaped.command[-1, 0] == pytest.approx(TRAVEL, abs=1e-18)


@pytest.mark.parametrize("kind", ["ZV", "ZVD", "ZVDD"])
@pytest.mark.parametrize("share", [0.95, 1.05])
def test_a_wrong_frequency_leaves_what_the_closed_form_says(tmp_path, kind, share):
    plain = vibration(solved(tmp_path), 0.0)
    wrong = (
        f'shaping = {{ kind = "{kind}", frequency = "{float(share * MODE)!r} Hz", damping_ratio = {float(RATIO)!r} }}'
    )
    said = left(*impulses(kind, share * MODE, RATIO))
    assert vibration(solved(tmp_path, wrong), 0.0) == pytest.approx(said * plain, rel=1e-4)  # the same sampling
    assert {"ZV": 0.05, "ZVD": 0.003, "ZVDD": 0.0002}[kind] < said < {"ZV": 0.11, "ZVD": 0.012, "ZVDD": 0.0014}[kind]


def test_the_trace_is_what_scipy_says_of_the_drives(tmp_path):
    solution = solved(tmp_path, 'shaping = { kind = "ZV" }')
    y = driven(solution.drive[:, 0])
    assert np.abs(solution.trace.z[:, 0] - y[: len(solution.drive), 0]).max() < 1e-15
    middle = (solution.command[1:, 0] + solution.command[:-1, 0]) / 2  # each drive fits the middle of its sample
    # V, of 1: the path's bend within a sample
    assert np.allclose(solution.drive[:-1, 0], STIFFNESS / FORCE * middle, rtol=0, atol=2e-4)


def test_a_periodic_motion_without_inertia_feedforward_is_that_of_the_transfer_function(tmp_path):
    """Tilting at 40 Hz, of a mode with 1 %: 1/(1 - s^2 + 2 i zeta s), s the ratio of frequencies, times the sinc of a held drive."""
    two = AXIS.parent / "tripod.toml"
    path = 'kind = "circle"\ndiameter = "8 mrad"\nplane = ["theta_x", "theta_y"]\ncentre = { delta_z = "50 um" }\n'
    solution = solved(tmp_path, path=path, device=two, rate="8 kHz", duration="25 ms")
    n, h, w = 200, 1 / 8e3, 2 * np.pi * 40
    line = np.fft.fft(solution.trace.signals["pose"][:, 0])[1] / n
    wanted = np.fft.fft(solution.command[:, 0])[1] / n
    m = build_model(load_device(two))
    u = solution.drive.mean(axis=0)
    modes = sorted(natural_modes(m, solution.trace.x[0], solution.trace.z[0], u), key=lambda mode: mode[0])
    natural, ratio = min(modes, key=lambda mode: abs(mode[0] - tilting(m)))
    assert ratio == pytest.approx(0.01, rel=1e-6)
    s = w / (2 * np.pi * natural)
    transfer = np.sinc(w * h / (2 * np.pi)) / (1 - s**2 + 2j * ratio * s)
    assert abs(line / wanted - transfer) < 2e-4  # harmonics of the held drive, folded by the modes' response
    assert abs(abs(transfer) - 1) > 0.01


def tilting(model):
    """[Hz] by scipy from the model's own stiffness and mass at home: the mode that two axes share."""
    import casadi as ca

    at = [model.x, model.z, model.u, model.p]
    F = ca.Function("F", at, [ca.jacobian(model.rates[-3:], model.z)])(
        model.rest, np.zeros(3), np.zeros(3), model.p_nominal
    ).full()
    w2 = np.sort(eigh((-F - F.T) / 2, eigvals_only=True))
    pairs = [(w2[0], w2[1]), (w2[1], w2[2])]
    return np.sqrt(np.mean(min(pairs, key=lambda p: abs(p[1] - p[0]) / p[0]))) / (2 * np.pi)


def test_with_inertia_feedforward_a_shaped_path_is_followed_exactly(tmp_path):
    solution = solved(tmp_path, 'shaping = { kind = "ZVD" }', "inertia")
    # The goal for devices with inertia
    assert np.abs(solution.trace.signals["pose"] - solution.command).max() < 1e-9 * 100e-6
    assert vibration(solution, 0.0) < 1e-6 * TRAVEL


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (
            {
                "shaping": 'shaping = { kind = "ZV" }',
                "path": 'kind = "circle"\ndiameter = "8 mrad"\nplane = ["theta_x", "theta_y"]\n',
                "device": AXIS.parent / "tripod.toml",
            },
            "periodic: write from_rest",
        ),
        (
            {
                "shaping": 'shaping = { kind = "ZV" }',
                "feedforward": "inertia",
                "path": 'kind = "line"\nend = { delta_z = "10 um" }\n',
                "device": AXIS.parent / "mems_hexapod.toml",
                "rate": "1 kHz",
                "duration": "0.5 s",
            },
            "no inertia, so that no mode vibrates",
        ),
        (
            {
                "path": 'kind = "line"\nend = { delta_z = "10 um" }\n',
                "device": AXIS.parent / "mems_hexapod.toml",
                "rate": "1 kHz",
                "duration": "0.5 s",
            },
            "the device has no inertia; leave it out",
        ),
        ({"shaping": 'shaping = { kind = "zv" }'}, "ZVD"),
        ({"shaping": 'shaping = { kind = "ZV", frequency = "-3 Hz" }'}, "frequency"),
        ({"shaping": 'shaping = { kind = "ZV", damping_ratio = "120 %" }'}, "damping_ratio"),
        ({"shaping": 'shaping = "ZV"'}, "shaping"),
        ({"shaping": 'shaping = { kind = "ZV", frequency = "1 mHz" }'}, "1e\\+07 samples longer, but at most 1000000"),
        ({"shaping": 'shaping = { kind = "ZV", frequency = "11 kHz" }'}, "above half the sample_rate, 10000 Hz"),
    ],
)
def test_what_cannot_be_shaped_is_a_fault(tmp_path, words, what):
    with pytest.raises(InputError, match=what):
        solved(tmp_path, **words)


@pytest.mark.parametrize(
    ("more", "what"),
    [
        (
            '[[effect]]\nkind = "thermal_lag"\nat = "axis"\nshare = "0.2"\ntau = "0.01 s"\nsecond = "0.3"\n',
            "effects with memories,",
        ),
        (
            '[loop]\nposition_gain = "50 1/s"\nvelocity_gain = "100 V/(m/s)"\nintegral_gain = "0 V/(m*s)"\n',
            "a feedback loop",
        ),
        (
            '[[effect]]\nkind = "coulomb"\nat = "axis"\nforce = "1 N"\nreach = "0.1 um"\nsmoothing = "1 um/s"\n',
            "and dry friction",
        ),
    ],
)
def test_a_drive_that_depends_on_the_motion_is_not_static(tmp_path, more, what):
    (tmp_path / "device.toml").write_text(AXIS.read_text() + more)
    with pytest.raises(InputError, match=f"feedforward: is static, but .*{what}"):
        quasi_static(build_model(load_device(tmp_path / "device.toml")))


def test_without_inertia_feedforward_and_slowed_a_path_is_shaped_for_the_mode_of_the_device(tmp_path):
    """Half the sample rate is below the mode: a stated frequency would be refused, the mode of the device is taken as with inertia."""
    problems = []
    for feedforward in ("static", "inertia"):
        scenario = written(tmp_path, 'shaping = { kind = "ZV" }', feedforward, rate="150 Hz", duration="0.2 s")
        problems.append(scenario.bind(build_model(scenario.device)))
    for problem in problems:
        still = problem.in_balance
        assert still.shaper.frequency == pytest.approx(MODE) and not still.model.inertial
        assert np.array_equal(still.samples, problems[1].samples)
        assert len(problem.slowed(2.0)) == 60 + len(problem.samples) - 30


def test_a_device_in_balance_is_shaped_for_a_stated_frequency(tmp_path):
    path = 'kind = "line"\nstart = { delta_z = "5 um" }\nend = { delta_z = "10 um" }\n'
    words = {
        "feedforward": "inertia",
        "path": path,
        "device": AXIS.parent / "mems_hexapod.toml",
        "rate": "1 kHz",
        "duration": "0.2 s",
    }
    plain, shaped = (solved(tmp_path, s, **words) for s in ("", 'shaping = { kind = "ZV", frequency = "25 Hz" }'))
    both = [np.append(np.full(k, 5e-6), np.append(plain.command[:, 5], np.full(20 - k, 10e-6))) for k in (0, 20)]
    assert np.abs(shaped.command[:, 5] - np.mean(both, axis=0)).max() < 1e-18


def test_an_overshoot_beyond_a_limit_is_named(tmp_path):
    with pytest.raises(SolverError, match=r"overshoots its limits.*displacement at sample"):
        solved(tmp_path, path=LINE.replace("50 um", "90 um"))  # after the end of the path
    assert solved(tmp_path, 'shaping = { kind = "ZV" }', path=LINE.replace("50 um", "90 um")).command[
        -1, 0
    ] == pytest.approx(90e-6)


@pytest.mark.long
def test_the_command_line_names_the_mode_and_refuses_the_online_controller(tmp_path):
    written(tmp_path, 'shaping = { kind = "ZV" }')
    assert "shaped by ZV for a mode of 100.7 Hz, damping ratio 0.0474" in run("check", tmp_path).stdout
    done = run("generate", tmp_path, "--out", tmp_path / "c")
    assert done.returncode == 1 and "feedforward" in done.stderr and "--player" in done.stderr
    assert run("generate", tmp_path, "--player", "--out", tmp_path / "c").returncode == 0
