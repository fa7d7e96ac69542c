"""Mechanisms whose bodies have inertia: condensed mass, modal damping, trajectories, C, and what the condensation leaves out."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from command_line import ctrlgen as run_command
from conftest import DEVICE
from mechanism_files import HEAD, PARALLELOGRAM, TWO_BODIES, dm, loaded, with_values
from numpy.polynomial import Polynomial

from ctrlgen import InputError, build_model, load_scenario, run, solve
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.devices.mechanism.condensed import Condensed
from ctrlgen.devices.mechanism.modes import condensed_modes, natural_frequencies
from ctrlgen.model.assembly import movable
from ctrlgen.model.simulation import simulate
from ctrlgen.physics.damping import modal_damping

MASS, K_BLADES = 0.05, 24 * 130e9 * 8e-3 * 0.2e-3**3 / 12 / 20e-3**3
HEAVY = '[[body]]\nname = "stage"\nmass = "50 g"\ncentre = ["0 mm", "-10 mm", "0 mm"]\ninertia = ["9 kg*mm^2", "9 kg*mm^2", "9 kg*mm^2"]'
DYNAMICS = '[dynamics]\ndamping_ratio = "3 %"\n'


def moving(dynamics: str = DYNAMICS) -> str:
    """The parallelogram with a mass that its push does not turn."""
    return PARALLELOGRAM.replace('[[body]]\nname = "stage"', HEAVY).replace("[output]", dynamics + "[output]")


def test_a_parallelogram_with_mass_obeys_newtons_law_with_its_blades_and_its_damping_ratio(tmp_path):
    physics = loaded(tmp_path, moving()).physics(loaded(tmp_path, moving()).values())
    assert dm(physics.mass)[0, 0] == pytest.approx(MASS, rel=1e-9)
    assert float(physics.damping_force(ca.SX(1.0))) == pytest.approx(2 * 0.03 * np.sqrt(K_BLADES * MASS), rel=1e-9)


def test_the_simulated_stage_rings_at_its_frequency_and_decays_by_its_damping_ratio(tmp_path):
    model = build_model(loaded(tmp_path, moving()))
    w, z, h = np.sqrt(K_BLADES / MASS), 0.03, 1e-4
    t = h * np.arange(1, 2001)
    wd = w * np.sqrt(1 - z * z)
    step = 2 * 1e-3 / K_BLADES * (1 - np.exp(-z * w * t) * (np.cos(wd * t) + z * w / wd * np.sin(wd * t)))
    reached = simulate(model, np.full((2000, 1), 1e-3), h).signals["displacement"][1:, 0]
    assert np.abs(reached - step).max() < 1e-9 * np.abs(step).max()


def test_a_line_with_inertia_is_solved_on_its_samples(tmp_path):
    (tmp_path / "device.toml").write_text(moving())
    (tmp_path / "scenario.toml").write_text(
        'title = "t"\ndevice = "device.toml"\nsample_rate = "10 kHz"\nduration = "20 ms"\n'
        '[path]\nkind = "line"\nend = { delta_x = "40 um" }\n'
    )
    model = build_model(load_scenario(tmp_path).device)
    solution = solve(load_scenario(tmp_path), model)
    assert np.abs(solution.trace.signals["pose"] - solution.command).max() < 1e-9 * 40e-6
    assert solution.drive[-1, 0] == pytest.approx(K_BLADES * 40e-6 / 2, rel=1e-6)
    # From the first sample to the last, three derivatives at rest
    T, path = (
        0.0199,
        Polynomial([0, 0, 0, 0, 35, -84, 70, -20]),
    )
    tau = (np.arange(199) + 0.5) / 199  # a drive is held, and fits the middle of its sample
    force = (
        MASS * path.deriv(2)(tau) / T**2
        + 2 * 0.03 * np.sqrt(K_BLADES * MASS) * path.deriv(1)(tau) / T
        + K_BLADES * path(tau)
    )
    wanted = force * 40e-6 / 2
    # the hold is exact to second order of a sample over the move, (1/199)^2, times some tens for the path's derivatives
    assert np.abs(solution.drive[:199, 0] - wanted).max() < 1e-3 * wanted.max()


@pytest.mark.long
def test_c_of_a_mechanism_with_inertia_computes_what_the_model_does(tmp_path):
    device = (DEVICE.parent / "parallelogram.toml").read_text() + "\n" + DYNAMICS
    (tmp_path / "device.toml").write_text(device)
    (tmp_path / "scenario.toml").write_text(
        'title = "t"\ndevice = "device.toml"\nsample_rate = "5 kHz"\nduration = "40 ms"\n'
        '[path]\nkind = "line"\nend = { delta_x = "40 um" }\n'
    )
    assert run(tmp_path, tmp_path / "out").passed


def two_masses(k_a: str = "0.5", output: str = "b") -> str:
    """Ground - k_a - body a - k_b - body b on one line, a mass in each, both pushed along it."""
    text = TWO_BODIES.replace('delta_x_per_F_x = "0.5', f'delta_x_per_F_x = "{k_a}')
    for name, mass, x in (("a", 300, 0), ("b", 200, 10)):
        body = f'name = "{name}"\nmass = "{mass} g"\ncentre = ["{x} mm", "0 mm", "0 mm"]\ninertia = ["9 kg*mm^2", "9 kg*mm^2", "9 kg*mm^2"]'
        text = text.replace(f'[[body]]\nname = "{name}"', f"[[body]]\n{body}")
    return text


def pushes(*names: str) -> str:
    places = {"a": 0, "b": 10}
    return "".join(
        f'[[actuator]]\nname = "p{name}"\nkind = "force"\non = "{name}"\nat = ["{places[name]} mm", "0 mm", "0 mm"]\nalong = [1, 0, 0]\n'
        'gain = "1 N/V"\nlow = "-9 V"\nhigh = "9 V"\ntravel = "50 um"\n'
        for name in names
    )


OUTPUT = '[output]\nbody = "b"\nat = ["10 mm", "0 mm", "0 mm"]\nchannels = ["delta_x"]\n'


def test_mass_that_an_unpushed_body_has_counts_by_how_far_it_follows(tmp_path):
    """Pushed at b, a follows by k_b/(k_a + k_b): m = m_b + m_a of its square; one mode is left out."""
    device = loaded(tmp_path, two_masses() + pushes("b") + DYNAMICS + OUTPUT)
    k_a, k_b, m_a, m_b = 1 / 0.5e-6, 1 / 0.2e-6, 0.3, 0.2
    c = Condensed(*with_values(device))
    m, k = m_b + m_a * (k_b / (k_a + k_b)) ** 2, k_a * k_b / (k_a + k_b)
    assert dm(c.mass)[0, 0] == pytest.approx(m, rel=1e-9)
    (mode,), left_out = condensed_modes(device)
    assert mode.frequency == pytest.approx(np.sqrt(k / m) / (2 * np.pi), rel=1e-9)
    squares = np.linalg.eigvals(np.linalg.solve(np.diag([m_a, m_b]), [[k_a + k_b, -k_b], [-k_b, k_b]]))
    first = np.sqrt(squares.min()) / (2 * np.pi)
    assert mode.whole == pytest.approx(first, rel=1e-9) and mode.frequency > first  # a Rayleigh quotient
    assert left_out in natural_frequencies(device)


def test_two_axes_share_the_mass_that_moves_with_both(tmp_path):
    """Both bodies pushed: no motion is left out, so that the condensed modes are those of the two masses."""
    both = '[output]\nbody = "b"\nat = ["10 mm", "0 mm", "0 mm"]\nchannels = ["delta_x", "delta_y"]\n'
    text = two_masses() + pushes("a", "b") + DYNAMICS
    device = loaded(
        tmp_path, text.replace('along = [1, 0, 0]\ngain = "1 N/V"', 'along = [1, 1, 0]\ngain = "1 N/V"', 1) + both
    )
    c = Condensed(*with_values(device))
    M, K = dm(c.mass), dm(c.held_stiffness)
    assert abs(M[0, 1]) > 1e-3 * M[0, 0] and M[0, 1] == pytest.approx(M[1, 0], rel=1e-9)
    model, v = build_model(device), ca.SX.sym("v", 2)
    at = ca.Function("a", [model.x, model.z, model.u, model.p], [model.rates[-2:]])
    d, u = np.array([3e-6, -2e-6]), np.array([0.5, 0.25])
    assert at([0, 0], d, u, []).full().ravel() == pytest.approx(np.linalg.solve(M, u - K @ d), rel=1e-9)
    D = dm(ca.Function("D", [v], [ca.jacobian(device.physics(device.values()).damping_force(v), v)])(0))
    values, shapes = np.linalg.eig(np.linalg.solve(M, K))
    modal = np.linalg.inv(shapes) @ np.linalg.solve(M, D) @ shapes
    assert modal == pytest.approx(np.diag(2 * 0.03 * np.sqrt(values)), abs=1e-9 * np.abs(modal).max())


@pytest.mark.parametrize("spread", [1.0, 30.0, 1000.0])
def test_modal_damping_gives_every_mode_its_ratio_up_to_a_thousandfold_of_frequencies(spread):
    rng = np.random.default_rng(2)
    A = rng.normal(size=(4, 4))
    M = A @ A.T + 4 * np.eye(4)
    L = np.linalg.cholesky(M)
    Q = np.linalg.qr(rng.normal(size=(4, 4)))[0]
    w = 100 * spread ** np.linspace(0, 1, 4)
    K = L @ Q @ np.diag(w**2) @ Q.T @ L.T
    D = dm(modal_damping(ca.DM(M), ca.DM(K), 0.02))
    shapes = np.linalg.inv(L).T @ Q
    # the root of a matrix whose eigenvalues are 1e6 apart keeps 1e-16 * 1e6 of them
    assert shapes.T @ D @ shapes == pytest.approx(np.diag(0.04 * w), abs=1e-9 * w[-1] * 0.04)


def test_masses_stiffness_and_damping_may_all_be_free(tmp_path):
    text = two_masses() + pushes("a", "b") + DYNAMICS.replace('"3 %"', '{ value = "3 %", sd = "1 %" }')
    both = OUTPUT.replace('["delta_x"]', '["delta_x", "delta_y"]')
    text = text.replace('along = [1, 0, 0]\ngain = "1 N/V"', 'along = [1, 1, 0]\ngain = "1 N/V"', 1) + both
    device = loaded(tmp_path, text)
    free = movable(device)
    assert {"body[0].mass", "dynamics.damping_ratio", "element[0].delta_x_per_F_x"} <= set(free)
    models = build_model(device, free=free), build_model(device)
    x, z = [1e-3, -2e-3], [1e-6, 2e-6]
    rates = [ca.Function("r", [m.x, m.z, m.u, m.p], [m.rates])(x, z, 0, m.p_nominal).full() for m in models]
    assert rates[0] == pytest.approx(rates[1], rel=1e-9)


def test_check_says_how_far_the_condensed_modes_are(tmp_path):
    said = run_command("check", DEVICE.parent / "parallelogram.toml").stdout
    assert "43.84 Hz (+0.0096 % of 43.83 Hz); first mode left out: 376.3 Hz" in said
    mirror = loaded(tmp_path, (DEVICE.parent / "tip_tilt_mirror.toml").read_text() + DYNAMICS)
    # Its wires are softer than its stacks
    assert any("do not move as at rest" in remark for remark in mirror.remarks())
    assert not [remark for remark in loaded(tmp_path, moving()).remarks() if "slender" not in remark]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (PARALLELOGRAM.replace("[output]", DYNAMICS + "[output]"), "the actuators move no mass in some direction"),
        (moving('[dynamics]\ndamping_ratio = "3 Hz"\n'), "dynamics.damping_ratio"),
        (moving("[dynamics]\n"), "dynamics.damping_ratio"),
        (
            HEAD
            + TWO_BODIES.removeprefix(HEAD)
            + '[[actuator]]\nname = "s"\nkind = "displacement"\non = "k_b"\nalong = [1, 0, 0]\n'
            'gain = "1 um/V"\nlow = "0 V"\nhigh = "9 V"\ntravel = "9 um"\n' + DYNAMICS + OUTPUT,
            "inertia needs actuators that push",
        ),
    ],
)
def test_dynamics_that_cannot_be_is_refused(tmp_path, text, says):
    with pytest.raises(InputError) as caught:
        loaded(tmp_path, text)
    assert says in str(caught.value)


def test_one_axis_with_mass_has_a_stress_limit_that_binds(tmp_path):
    """Its state is one velocity: of no state before it there is nothing to stack. sigma = 3 E t y/l^2 of a guided blade."""
    text = moving().replace('stress_limit = "300 MPa"', 'stress_limit = "50 MPa"')
    model = build_model(loaded(tmp_path, text))
    kernels = controller_of(model, "pose", 1e-3).kernels
    y = 100e-6
    ratio = float(kernels.composite_ratio(model.rest, np.zeros(1), y))
    assert ratio == pytest.approx(3 * 130e9 * 0.2e-3 * y / 20e-3**2 / 50e6, rel=0.01)
