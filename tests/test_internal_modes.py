"""Modes that a mechanism condensed to its axes leaves out: two masses in a row, whose equations are known, in Bode and along a path."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from conftest import DEVICE
from mechanism_files import dm, loaded
from scipy.integrate import solve_ivp
from two_masses import K1, K2, M1, M2, MASS, STIFFNESS, ZETA, damping, two_masses

from ctrlgen import build_model, load_scenario, solve
from ctrlgen.app.commands.devices import bode
from ctrlgen.app.simulated import simulate_device
from ctrlgen.controller.bode import frequency_response
from ctrlgen.devices.mechanism.condensed import nominal
from ctrlgen.devices.mechanism.modes import as_displacements, body_matrices
from ctrlgen.devices.structural_model import StructuralModel
from ctrlgen.model.simulation import simulate
from ctrlgen.physics.rigid_bodies import point_motion
from ctrlgen.physics.screw import inverse_adjoint


def test_the_structure_has_the_modes_and_the_response_of_two_masses(tmp_path):
    """(-w^2 M + i w D + K)^-1 from the first mass to the second, all modes kept; up to 4 Hz the condensed model does."""
    model = build_model(loaded(tmp_path, two_masses()))
    found = frequency_response(model, np.zeros(1))
    w = 2 * np.pi * found.hertz
    exact = np.array([np.linalg.inv(STIFFNESS + 1j * x * damping() - x**2 * MASS)[1, 0] for x in w])
    assert found.response[0, 0] == pytest.approx(exact, rel=1e-4)
    modes = np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(MASS, STIFFNESS)))) / (2 * np.pi)
    assert found.structure.frequencies[:2] == pytest.approx(modes, rel=1e-5)
    both = loaded(tmp_path, two_masses('modes_below = "80 Hz"\n')).structural_model()
    assert both.frequencies == pytest.approx(modes, rel=1e-5)  # the condensed one is wrong there
    few = loaded(tmp_path, two_masses('modes_below = "4 Hz"\n')).structural_model()
    assert few.frequencies == pytest.approx([np.sqrt(K1 / (M1 + M2)) / (2 * np.pi)], rel=1e-5)


def test_as_many_modes_are_kept_as_the_response_of_all_bodies_needs(tmp_path):
    """A stage with levers, 42 freedoms: the uncondensed (K - w^2 M + i w D)^-1, D of one damping ratio, within 1 % up to `modes_below`."""
    text = (
        DEVICE.parent / "xy_lever_stage.toml"
    ).read_text() + '[dynamics]\ndamping_ratio = "1 %"\nmodes_below = "BELOW"\n'
    counts = []
    for below in (100.0, 2000.0):
        device = loaded(tmp_path, text.replace("BELOW", f"{below} Hz"))
        structure, c = device.structural_model(), nominal(device)
        counts.append(len(structure.mass))
        K, M, heavy = body_matrices(c)
        size, n = as_displacements(device), len(device.placed_actuators)
        push = np.zeros((len(K), n))
        for i, a in enumerate(device.placed_actuators):
            push[6 * a.second : 6 * a.second + 6, i] = dm(point_motion(c.point(a), c.directions[i])).ravel()
        push *= size[:, None]
        body = device.bodies.index(device.output.body)
        see = np.zeros((2, len(K)))
        see[:, 6 * body : 6 * body + 6] = dm(inverse_adjoint(None, c.output_point))[c.channel_rows]
        see *= size
        light = [i for i in range(len(K)) if i not in heavy]  # in balance with the others
        follows = np.eye(len(K))[:, heavy]
        follows[light] = -np.linalg.solve(K[np.ix_(light, light)], K[np.ix_(light, heavy)])
        K, M = (follows.T @ X @ follows for X in (K, M))
        squares, V = scipy.linalg.eigh(K, M)
        D = M @ V @ np.diag(0.02 * np.sqrt(squares)) @ V.T @ M
        w = 2 * np.pi * np.geomspace(1, below, 37)
        full = np.array([see @ follows @ np.linalg.solve(K + 1j * x * D - x**2 * M, follows.T @ push) for x in w])
        off = np.abs(np.moveaxis(structure.receptance(w), -1, 0) - full)
        assert (off <= 0.011 * np.maximum(np.abs(full), 0.01 * np.abs(full[0]).max(axis=1, keepdims=True))).all()
    assert counts[0] < counts[1] < 42


def test_a_simulated_step_has_the_motion_of_two_masses(tmp_path):
    """Beside the condensed model's, by the exponential of the whole."""
    loaded(tmp_path, two_masses())
    rate = 2000.0
    trace = simulate_device(tmp_path / "device.toml", None, "5 A", 0.2, rate).trace
    A = np.block(
        [[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(MASS, STIFFNESS), -np.linalg.solve(MASS, damping())]]
    )
    step, x, seen = scipy.linalg.expm(A / rate), np.zeros(4), [0.0]
    held = np.concatenate([np.linalg.solve(STIFFNESS, [5.0, 0.0]), [0.0, 0.0]])
    for k in range(400):
        rest = held if k >= 40 else np.zeros(4)
        x = rest + step @ (x - rest)
        seen.append(x[1])
    found = trace.signals["pose_with_modes"][:, 0]
    assert found == pytest.approx(seen, abs=1e-4 * np.abs(seen).max())
    assert np.abs(trace.signals["pose"][:, 0] - seen).max() > 0.1 * np.abs(seen).max()


def test_the_page_of_the_response_tells_both(tmp_path):
    loaded(tmp_path, two_masses())
    bode(tmp_path / "device.toml", tmp_path / "bode.html", "delta_x=0um")
    assert "The first modes of the bodies are 39.44" in (tmp_path / "bode.html").read_text()


def test_what_internal_modes_leave_along_a_path_is_that_of_two_masses(tmp_path):
    """The same drives on both, held from sample to sample, by a variable-step integrator; the condensed model rings at 41.09 Hz."""
    loaded(tmp_path, two_masses())
    (tmp_path / "s.toml").write_text(
        'title = "t"\ndevice = "device.toml"\nsample_rate = "2 kHz"\nduration = "50 ms"\n[path]\nkind = "line"\n'
        'start = { delta_x = "0 um" }\nend = { delta_x = "100 um" }\n'
    )
    scenario = load_scenario(tmp_path / "s.toml")
    solution = solve(scenario, build_model(scenario.device))
    told, h = solution.unstated_modes, 5e-4
    force = np.concatenate([solution.drive[:, 0], np.full(60, solution.drive[-1, 0])])
    wrong = []
    for M, K, D in ((MASS, STIFFNESS, damping()), (None, None, None)):
        if M is None:
            M, K = np.eye(1) * (M1 + M2), np.eye(1) * K1
            D = 2 * ZETA * np.sqrt(K * M)
        n, x, seen = len(M), np.zeros(2 * len(M)), []
        for f in force:
            seen.append(x[n - 1])
            push = np.eye(n)[0] * f
            x = solve_ivp(
                lambda _, s, n=n, M=M, K=K, D=D, push=push: np.r_[
                    s[n:], np.linalg.solve(M, push - K @ s[:n] - D @ s[n:])
                ],
                (0, h),
                x,
                rtol=1e-9,
                atol=1e-15,
                method="DOP853",
            ).y[:, -1]
        wrong.append(np.array(seen))
    off, n = np.abs(wrong[0] - wrong[1]), len(solution.command)
    assert told.along == pytest.approx(off[:n].max(), rel=1e-3) and told.after == pytest.approx(
        off[n : n + 52].max(), rel=1e-2
    )
    assert "first mode of the bodies is 39.44" in solution.left_out[0]


def test_held_and_linear_forces_are_told_apart():
    """An oscillator without damping under a force that is 0, then 1: x(h) = 0 where it is held, (1 - sin(w h)/(w h))/k where linear."""
    w, h = 2 * np.pi * 100, 2e-3
    oscillator = StructuralModel(np.eye(1), np.eye(1) * w**2, np.ones((1, 1)), 1, 0.0)
    force = np.array([[0.0], [1.0]])
    assert oscillator.response(force, h, held=True)[:, 0] == pytest.approx([0, 0], abs=1e-15)
    assert oscillator.response(force, h, held=False)[1, 0] == pytest.approx((1 - np.sin(w * h) / (w * h)) / w**2)


CELL = '[[reading]]\nname = "cell"\nof = "b"\n'


def test_a_load_cell_reads_the_spring_between_two_masses(tmp_path):
    """K2 (x2 - x1) in Bode, to 0.5 % up to seven tenths of the frequency of the second mass on a held first one."""
    model = build_model(loaded(tmp_path, two_masses(CELL)))
    found = frequency_response(model, np.zeros(1), "reading")
    w = 2 * np.pi * found.hertz
    exact = np.array([np.linalg.inv(STIFFNESS + 1j * x * damping() - x**2 * MASS)[:, 0] for x in w])
    loads = K2 * (exact[:, 1] - exact[:, 0])
    assert found.response[0, 0] == pytest.approx(exact[:, 1], rel=1e-4)
    slow = w < 0.7 * np.sqrt(K2 / M2)
    assert found.response[1, 0][slow] == pytest.approx(loads[slow], rel=5e-3)
    assert (
        np.abs(found.response[1, 0] / loads - 1).max() < 0.05
    )  # damping acts between the masses too, which no cell reads


def test_a_load_cell_reads_the_inertia_of_modes_that_are_left_out(tmp_path):
    """K2 (x2 - x1) far below the modes, by the condensed model in which both masses move alike."""
    model = build_model(loaded(tmp_path, two_masses('modes_below = "4 Hz"\n' + CELL)))
    found = frequency_response(model, np.zeros(1), "reading")
    assert len(found.structure.mass) == 1
    slow = found.hertz < 4
    w = 2 * np.pi * found.hertz[slow]
    exact = np.array([np.linalg.inv(STIFFNESS + 1j * x * damping() - x**2 * MASS)[:, 0] for x in w])
    loads = K2 * (exact[:, 1] - exact[:, 0])
    # damping is out of phase; what the second mass adds of higher powers of w/w_2, w_2 that of it on a held first one
    off = np.abs(found.response[1, 0][slow].real / loads.real - 1)
    assert off.max() < 2 * (w.max() / np.sqrt(K2 / M2)) ** 2


def test_a_load_cell_is_simulated_with_the_inertia_of_what_it_carries(tmp_path):
    """Tension -M2 x'' of the second mass under a force that begins: at once -M2/(M1 + M2) of it. Each reading is under the drive of its
    row, as recordings have it."""
    model = build_model(loaded(tmp_path, two_masses(CELL)))
    trace = simulate(model, np.full((40, 1), 3.0), 1e-4)
    x, cell = trace.signals["reading"].T
    assert cell[0] == pytest.approx(-3.0 * M2 / (M1 + M2), rel=1e-4)
    second = np.gradient(np.gradient(x, 1e-4), 1e-4)
    assert cell[5:-5] == pytest.approx(-M2 * second[5:-5], rel=0.01)
