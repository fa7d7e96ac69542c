"""Feedforward that leads modes of the bodies: two masses and a spring, whose inverse is known, and all bodies of a stage with levers."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from conftest import DEVICE
from mechanism_files import dm, loaded
from two_masses import K1, K2, M1, M2, MASS, STIFFNESS, damping, two_masses

from ctrlgen import InputError, build_model, error_budget, fastest, load_scenario, solve
from ctrlgen.app.scenario_pipeline import compare_only
from ctrlgen.budget.budget_section import budget_section
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.devices.mechanism.condensed import nominal
from ctrlgen.devices.mechanism.modes import as_displacements, body_matrices
from ctrlgen.devices.structural_model import StructuralModel
from ctrlgen.model.led_modes import inverse_series, lowest_zero
from ctrlgen.physics.rigid_bodies import point_motion
from ctrlgen.physics.screw import inverse_adjoint

LINE = '[path]\nkind = "line"\nstart = { delta_x = "0 um" }\nend = { delta_x = "100 um" }\n'
CIRCLE = '[path]\nkind = "circle"\ndiameter = "2 um"\nplane = ["delta_x", "delta_y"]\ncentre = { delta_x = "-3 um", delta_y = "-3 um" }\n'


def solved(folder, how, seconds, path=LINE, rate="2 kHz"):
    """The path of the device in `folder` with a feedforward; listed samples say themselves how many `seconds` they take."""
    lasts = "" if seconds is None else f'duration = "{seconds} s"\n'
    (folder / "s.toml").write_text(
        f'title = "t"\ndevice = "device.toml"\nsample_rate = "{rate}"\n{lasts}feedforward = "{how}"\n{path}'
    )
    scenario = load_scenario(folder / "s.toml")
    return solve(scenario, build_model(scenario.device))


def under(M, K, D, push, see, force, h, closed=False):
    """What `see` sees of M x'' + D x' + K x = push f under held forces, from rest at home or in periodic motion."""
    k = len(M)
    A = np.block([[np.zeros((k, k)), np.eye(k)], [-np.linalg.solve(M, K), -np.linalg.solve(M, D)]])
    B = np.vstack([np.zeros_like(push), np.linalg.solve(M, push)])
    both = scipy.linalg.expm(h * np.block([[A, B], [np.zeros((push.shape[1], 2 * k + push.shape[1]))]]))
    step, kick = both[: 2 * k, : 2 * k], force @ both[: 2 * k, 2 * k :].T
    x = np.zeros(2 * k)
    if closed:
        for f in kick:
            x = step @ x + f
        x = np.linalg.solve(np.eye(2 * k) - np.linalg.matrix_power(step, len(force)), x)
    seen = []
    for f in kick:
        seen.append(see @ x[:k])
        x = step @ x + f
    return np.array(seen)


def test_drives_that_lead_modes_leave_less_by_both_masses_themselves(tmp_path):
    """A move in two periods of the slowest mode: by the exponential of both masses, 20 nm of 100 um instead of microns; so much is told."""
    loaded(tmp_path, two_masses('modes_below = "200 Hz"\n'))
    left = {}
    for how in ("inertia", "modes"):
        solution = solved(tmp_path, how, 0.05)
        force = np.vstack([solution.drive, np.tile(solution.drive[-1:], (50, 1))])
        push, see = np.eye(2)[:, :1], np.eye(2)[1:]
        seen = under(MASS, STIFFNESS, damping(), push, see, force, 5e-4)[:, 0]
        off = np.abs(seen - np.append(solution.command[:, 0], np.full(50, 1e-4)))
        left[how], told = off.max(), solution.unstated_modes
        assert told.along == pytest.approx(off[:100].max(), rel=0.02)
        assert told.after == pytest.approx(off[100:].max(), rel=0.02)  # of one period of the slowest mode
        if how == "modes":
            assert solution.trace.signals["pose"][:, 0] == pytest.approx(seen[:100], abs=1e-10)
            assert "led to the fourth derivative" in solution.left_out[0] and told.led is None
        else:
            assert told.led[1] < 2e-8 and 'feedforward = "modes", which leaves 0.014' in told.sentence()
    assert left["inertia"] > 1e-6 and left["modes"] < 2e-8
    farther = solved(tmp_path, "modes", 0.05, LINE.replace("100 um", "150 um").replace("0 um", "50 um", 1))
    beyond = farther.trace.signals["pose"] - solution.trace.signals["pose"]
    assert beyond == pytest.approx(np.full(beyond.shape, 5e-5), abs=1e-10)
    assert farther.unstated_modes.after == pytest.approx(told.after, rel=1e-3)  # it begins at rest, wherever that is


def test_the_controller_takes_two_derivatives_more_and_pushes_the_modes(tmp_path):
    """f = K1 r + (M1 + M2 + K1 M2/K2) r'' + M1 M2/K2 r'''' of two masses, and d = r + M2/K2 r'' of the first, without damping."""
    model = build_model(loaded(tmp_path, two_masses('modes_below = "200 Hz"\n').replace("1.0 %", "1e-7 %")))
    kernels = controller_of(model, "pose", 5e-4, True).kernels
    assert kernels.target.channels == ("delta_x", *(f"d{k}_delta_x" for k in (1, 2, 3, 4)))
    target = np.array([1e-5, 1e-3, 0.3, 50.0, 2e4])
    force = K1 * target[0] + (M1 + M2 + K1 * M2 / K2) * target[2] + M1 * M2 / K2 * target[4]
    assert float(kernels.motion["drive"](target)) == pytest.approx(force, rel=1e-4)
    assert float(kernels.motion["displacement"](target)) == pytest.approx(target[0] + M2 / K2 * target[2], rel=1e-4)


def test_the_series_is_the_inverse_to_the_fourth_power_wherever_zeros_lie():
    """G(iw) sum_j f_j (iw)^j - 1 falls as w^5 or faster: zeros on the imaginary axis, and one to the right, of a platform that a mode moves
    against its axis."""
    for moved, real in ((0.2, False), (-3.0, False), (3.0, True)):
        M = np.array([[1.0, 0.4], [0.4, 1.0]])
        structure = StructuralModel(M, np.diag([100.0, 900.0]), np.array([[1.0, moved]]), 1, 0.02)
        off = []
        for w in (1.0, 2.0):
            forces = sum(f * (1j * w) ** j for j, f in enumerate(inverse_series(structure)[1]))
            off.append(abs((structure.receptance(np.array([w]))[:, :, 0] @ forces)[0, 0] - 1))
        assert off[1] / off[0] > 2**4.8 and off[0] < 1e-4
        square = 900 / (1 - 0.4 * moved)  # -s^2 of the zero
        assert lowest_zero(structure) == pytest.approx(np.sqrt(abs(square)) / (2 * np.pi)) and (square < 0) == real


def test_two_masses_have_no_zero_behind_the_spring_and_one_before_it(tmp_path):
    text = two_masses('modes_below = "200 Hz"\n')
    assert lowest_zero(loaded(tmp_path, text).structural_model()) is None
    first = loaded(tmp_path, text.replace('body = "second"', 'body = "first"')).structural_model()
    assert lowest_zero(first) == pytest.approx(np.sqrt(K2 / M2) / (2 * np.pi), rel=1e-4)


def test_modes_cannot_be_led_where_there_are_none(tmp_path):
    loaded(tmp_path, two_masses('modes_below = "4 Hz"\n'))
    with pytest.raises(InputError, match="no mode of its bodies below modes_below"):
        solved(tmp_path, "modes", 0.05)
    loaded(tmp_path, two_masses().split("[dynamics]")[0])
    with pytest.raises(InputError, match="has no inertia of bodies"):
        solved(tmp_path, "modes", 0.05)


def test_what_is_not_computed_with_led_modes_is_refused_with_the_reason(tmp_path):
    """The fastest law and the error budget have the model condensed to its axes alone: an sd of the spring that is led would do nothing."""
    loaded(tmp_path, two_masses('modes_below = "200 Hz"\n'))
    solution = solved(tmp_path, "modes", 0.05)
    (tmp_path / "uncertainty.toml").write_text(
        'title = "t"\n[numbers]\n"element[1].delta_x_per_F_x" = { sd = "1 %", source = "s" }\n'
    )
    with pytest.raises(InputError, match="is not in an error budget"):
        error_budget(tmp_path / "s.toml", draws=0)
    section = budget_section(solution)
    assert section.budget is None and "is not in an error budget" in section.missing
    with pytest.raises(InputError, match="the fastest path is not computed: its law has no bodies"):
        fastest(tmp_path / "s.toml")
    with pytest.raises(InputError, match="robust judges the model condensed to its axes"):
        solved(tmp_path, "modes", 0.05, LINE + '[robust]\nprobability = "99 %"\n')


def test_static_drives_have_no_fastest_path(tmp_path):
    """The law of time is that of the inertia, which static drives leave out: between its set-points they were 81 um off."""
    loaded(tmp_path, two_masses('modes_below = "200 Hz"\n'))
    solved(tmp_path, "static", 0.05)
    with pytest.raises(InputError, match='is "static", whose drives do not follow a path this fast'):
        fastest(tmp_path / "s.toml")


def test_all_bodies_of_a_stage_with_levers_follow_a_circle_better(tmp_path):
    """The uncondensed 42 freedoms under the solved drives of a circle of 2 um at 20 Hz, periodic: 0.17 nm instead of 2.1."""
    text = (DEVICE.parent / "xy_lever_stage.toml").read_text()
    device = loaded(tmp_path, text + '[dynamics]\ndamping_ratio = "1 %"\nmodes_below = "2 kHz"\n')
    c, n = nominal(device), len(device.placed_actuators)
    K, M, heavy = body_matrices(c)
    size, push = as_displacements(device), np.zeros((len(K), n))
    for i, a in enumerate(device.placed_actuators):
        push[6 * a.second : 6 * a.second + 6, i] = dm(point_motion(c.point(a), c.directions[i])).ravel()
    push *= size[:, None]
    see, body = np.zeros((2, len(K))), device.bodies.index(device.output.body)
    see[:, 6 * body : 6 * body + 6] = dm(inverse_adjoint(None, c.output_point))[c.channel_rows]
    light = [i for i in range(len(K)) if i not in heavy]
    follows = np.eye(len(K))[:, heavy]
    follows[light] = -np.linalg.solve(K[np.ix_(light, light)], K[np.ix_(light, heavy)])
    K, M, push, see = follows.T @ K @ follows, follows.T @ M @ follows, follows.T @ push, (see * size) @ follows
    squares, V = scipy.linalg.eigh(K, M)
    D = M @ V @ np.diag(0.02 * np.sqrt(squares)) @ V.T @ M
    left = {}
    for how in ("inertia", "modes"):
        solution = solved(tmp_path, how, 0.05, CIRCLE, "8 kHz")
        force = solution.trace.signals["force"]
        middle, h = (force + np.roll(force, -1, axis=0)) / 2, 1 / 8000  # linear between samples, nearly
        seen = under(M, K, D, push, see, middle, h, closed=True)
        left[how] = np.abs(seen - solution.command).max()
    assert left["inertia"] > 1.5e-9 and left["modes"] < 0.1 * left["inertia"]


@pytest.mark.long
def test_the_c_that_leads_modes_is_the_reference(tmp_path):
    """From rest to rest, with a correction in the C, in periodic motion, and with a coil that lags."""
    device, samples = two_masses('modes_below = "200 Hz"\n'), 5e-6 * (1 - np.cos(2 * np.pi * np.arange(100) / 100))
    points = ", ".join(f'{{ delta_x = "{x:.12g} m" }}' for x in samples)
    correction = (
        '[[correction]]\nof = "delta_x"\nkind = "harmonic"\nperiod = "40 um"\nharmonics = 2\nbound = "0.1 um"\n'
    )
    closed = f'[path]\nkind = "poses"\nperiodic = true\npoints = [{points}]\n'
    lagging = device.replace('gain = "1 N/A"', 'gain = "1 N/A"\ntime_constant = "2 ms"')
    for text, seconds, path in ((device, 0.1, LINE + correction), (device, None, closed), (lagging, 0.1, LINE)):
        loaded(tmp_path, text)
        solved(tmp_path, "modes", seconds, path)
        compared = compare_only(tmp_path / "s.toml").comparison
        assert compared.passed, [row for row in compared.rows if not row.passed]
