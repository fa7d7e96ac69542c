"""S3's stage by its own equations entry by entry, beam theory and a direct-stiffness assembly, and as a device."""

from __future__ import annotations

from itertools import product
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import pytest
import rrr_direct as direct
from command_line import ctrlgen as command
from conftest import DEVICES
from matrices import array

from ctrlgen import InputError, build_model, load_device, load_scenario, solve
from ctrlgen.devices import rrr_stage as device_module
from ctrlgen.physics import circular_hinge_table, piezo_stack
from ctrlgen.physics import rrr_kinetostatics as rrr_stage
from ctrlgen.trajectory.workspace import Workspace
from papers import s3, s3_lengths

CASES = (1, 2)
ROTATION_SCALE = np.array([1.0, 1.0, 30e-3])  # rotations as motion of a point 30 mm away


def whole(k: rrr_stage.Kinetostatics, C_in: Any) -> np.ndarray:
    """The (6, 6) matrix of S3 eq. (1), rotations as millimetres at 30 mm, so that all entries are m/N."""
    M = np.block([[array(k.C_oFo), array(k.C_oFin)], [array(k.C_inFo), array(C_in)]])
    scale = np.append(ROTATION_SCALE, [1.0, 1.0, 1.0])
    return M * np.outer(scale, scale)


def output_per_voltage(device: device_module.RrrStage) -> np.ndarray:
    """Output displacement per stack voltage at rest, (3, 3) [m/V, m/V, rad/V]."""
    return array(device_module.stage(device).complete_J) @ device_module.input_per_voltage(device)


def geometry(rng: np.random.Generator) -> SimpleNamespace:
    l = dict(zip(("l1", "l2", "l3", "l4", "l5", "l6"), rng.uniform(2e-3, 50e-3, 6), strict=True))
    R = dict(zip(("R1", "R2", "R3"), rng.uniform(1e-3, 3e-3, 3), strict=True))
    return SimpleNamespace(**l, **R, frame_angle=rng.uniform(-3, 3))


def random_hinge(rng: np.random.Generator, R: float) -> np.ndarray:
    """Of the form of a hinge, positive definite, sized like those of S3."""
    x, alpha = rng.uniform(1e-9, 6e-9), rng.uniform(0.02, 0.2)
    return array(circular_hinge_table.end_compliance(x, R**2 * alpha * rng.uniform(1.01, 1.3), alpha, R))


@pytest.fixture(scope="module", params=CASES)
def case(request: pytest.FixtureRequest) -> int:
    return request.param


@pytest.fixture(scope="module")
def corrected(case: int) -> rrr_stage.Kinetostatics:
    return device_module.stage(s3_lengths.printed_device(case), s3_lengths.corrected(case))


# Hinges


def test_a_hinge_that_would_give_energy_away_is_refused_by_its_name(tmp_path: Any) -> None:
    text = (DEVICES / "rrr_case2.toml").read_text()
    assert text.count('value = "1.5"') == 3
    path = tmp_path / "device.toml"
    path.write_text(text.replace('value = "1.5"', 'value = "0"'))
    with pytest.raises(InputError) as caught:
        load_device(path)
    message = str(caught.value)
    assert "hinge1" in message and "hinge2" in message and "hinge3" not in message
    assert "not positive definite" in message and "shear" in message


def test_the_hinges_may_choose_their_own_equations(tmp_path: Any) -> None:
    """A device file whose hinges say "auto": another stiffness, but hardly another Jacobian (S3 section 5.1.1)."""
    lines = (DEVICES / "rrr_case2.toml").read_text().splitlines()
    auto = ['equation = "auto"' if line.startswith("equation = ") else line for line in lines]
    assert auto != lines
    path = tmp_path / "device.toml"
    path.write_text("\n".join(auto))
    ours, printed = (device_module.stage(d) for d in (load_device(path), s3_lengths.printed_device(2)))
    assert np.abs(array(ours.J) / array(printed.J) - 1).max() < 0.01
    assert 0.001 < np.abs(array(ours.C_oFo)[2, 2] / array(printed.C_oFo)[2, 2] - 1) < 0.05
    path.write_text("\n".join(line for line in auto if not line.startswith("outside = ")))
    with pytest.warns(circular_hinge_table.HingeRangeWarning, match="recommends no printed equation here"):
        load_device(path)


@pytest.mark.long
def test_a_command_gives_each_warning_once(tmp_path: Any) -> None:
    """Although the model is built for the check of the device and for the solution."""
    lines = (DEVICES / "rrr_case2.toml").read_text().splitlines()
    changed = ['equation = "auto"' if line.startswith("equation = ") else line for line in lines]
    (tmp_path / "device.toml").write_text("\n".join(line for line in changed if not line.startswith("outside = ")))
    done = command(
        "run", DEVICES.parent / "rrr_circle", "--device", tmp_path / "device.toml", "--out", tmp_path / "out"
    )
    warned = [line for line in done.stderr.splitlines() if line.startswith("warning: ")]
    assert warned and len(warned) == len(set(warned))


def test_a_stage_says_which_equations_stand_outside_their_range(case: int) -> None:
    remarks = s3_lengths.printed_device(case).remarks()
    expected = {1: 9, 2: 6}[case]  # of nine; S3 Table 3 covers the others
    assert len(remarks) == expected and all("S3 Table 3" in remark for remark in remarks)
    assert any(remark.startswith("hinge1: delta_y_per_F_y at t/R = 0.7636") for remark in remarks)


# Appendix B


def test_each_entry_of_appendix_b_follows_from_the_rigid_links_between_the_hinges(rng: np.random.Generator) -> None:
    g = geometry(rng)
    hinges = [random_hinge(rng, R) for R in (g.R1, g.R2, g.R3)]
    (x1, y1, a1), (x2, y2, a2), (x3, y3, a3) = (np.diag(C) for C in hinges)
    l1, l3, l4 = g.l1, g.l3, g.l4
    L = g.l2 + g.l3 + 2 * g.R3
    C_h1 = np.array(
        [
            [x1 + l4**2 * a1, -l4 * (l1 + g.R1) * a1, -l4 * a1],  # (B.26)-(B.28)
            [-l4 * (l1 + g.R1) * a1, y1 + (l1 * g.R1 + l1 * (l1 + g.R1)) * a1, (l1 + g.R1) * a1],  # (B.18)-(B.20)
            [-l4 * a1, (l1 + g.R1) * a1, a1],  # (B.10)-(B.12)
        ]
    )
    C_h2 = np.array(
        [
            [0, x2, 0],  # (B.36)-(B.38)
            [-y2 - (L * g.R2 + L * (L + g.R2)) * a2, 0, (L + g.R2) * a2],  # (B.33)-(B.35)
            [-(L + g.R2) * a2, 0, a2],  # (B.30)-(B.32)
        ]
    )
    C_h3 = np.array(
        [
            [0, x3, 0],  # (B.46)-(B.48)
            [-y3 - l3 * (l3 + 2 * g.R3) * a3, 0, (l3 + g.R3) * a3],  # (B.43)-(B.45)
            [-(l3 + g.R3) * a3, 0, a3],  # (B.40)-(B.42)
        ]
    )
    quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    T_f = np.array([[1, 0, 0], [0, 1, 0], [0, -g.l6, 1]])
    C_L1 = T_f.T @ (C_h1 + quarter @ C_h2 + quarter @ C_h3) @ T_f
    assert np.allclose(array(rrr_stage.link_compliance(hinges, g)), C_L1, rtol=1e-12, atol=1e-12 * np.abs(C_L1).min())
    c = np.array([l4 * (g.l5 + g.R1) * a1, -y1 - (g.l5 * g.R1 + l1 * (g.l5 + g.R1)) * a1, -(g.l5 + g.R1) * a1])
    c[1] -= g.l6 * c[2]  # (B.69), (B.72), (B.73), then (B.74)
    assert np.allclose(array(rrr_stage.link_input_compliance(hinges, g)).ravel(), c, rtol=1e-12, atol=0)


@pytest.mark.parametrize("seed", range(5))
def test_the_stage_is_the_direct_stiffness_assembly_for_any_hinges_and_lengths(seed: int) -> None:
    rng = np.random.default_rng(seed)
    g = geometry(rng)
    hinges = [random_hinge(rng, R) for R in (g.R1, g.R2, g.R3)]
    k = rrr_stage.kinetostatics(hinges, g)
    scale = np.append(ROTATION_SCALE, [1.0, 1.0, 1.0])
    reference = direct.assemble(hinges, g) * np.outer(scale, scale)
    error = np.abs(whole(k, k.input_compliance) - reference).max()
    assert error < 1e-9 * np.abs(reference).max()  # one linear model solved twice in float64


def test_the_corrected_stage_is_the_direct_stiffness_assembly(case: int, corrected: rrr_stage.Kinetostatics) -> None:
    p = s3_lengths.corrected(case)
    g = SimpleNamespace(**vars(p.lengths), R3=p.hinge3.R, frame_angle=p.frame_angle)
    device = s3_lengths.printed_device(case)
    hinges = [array(device_module.hinge_compliance(device, name, p)) for name in device.hinges]
    scale = np.append(ROTATION_SCALE, [1.0, 1.0, 1.0])
    reference = direct.assemble(hinges, g) * np.outer(scale, scale)
    ours = whole(corrected, corrected.input_compliance)
    assert np.abs(ours - reference).max() < 1e-9 * np.abs(reference).max()  # one linear model solved twice in float64


def test_b_83_leaves_out_what_an_input_yields_with_the_platform_held(corrected: rrr_stage.Kinetostatics) -> None:
    printed, complete = array(corrected.C_inFin), array(corrected.input_compliance)
    difference = complete - printed
    assert np.allclose(difference, difference[0, 0] * np.eye(3), rtol=0, atol=1e-15 * complete.max())
    assert 0.01 < difference[0, 0] / printed[0, 0] < 0.02  # softer by 1.6 and 1.7 %


def test_symbols_give_what_numbers_give() -> None:
    device = s3_lengths.printed_device(2)
    l1 = ca.SX.sym("l1")
    k = device_module.stage(device, device.values({"lengths.l1": l1}))
    at = ca.Function("J", [l1], [k.J, ca.jacobian(k.J[0, 0], l1)])
    J, slope = (block.full() for block in at(device.lengths.l1.si))
    assert np.allclose(J, array(device_module.stage(device).J), rtol=1e-12)
    h = 1e-6
    central = float(at(device.lengths.l1.si + h)[0][0, 0] - at(device.lengths.l1.si - h)[0][0, 0]) / (2 * h)
    assert np.isclose(slope.item(), central, rtol=1e-6)  # error of the central difference: h^2


# What physics says of the matrices


def test_the_compliance_of_the_whole_stage_is_symmetric_and_positive_definite(
    corrected: rrr_stage.Kinetostatics,
) -> None:
    M = whole(corrected, corrected.input_compliance)
    assert np.abs(M - M.T).max() < 1e-12 * np.abs(M).max()  # rounding
    assert np.linalg.eigvalsh((M + M.T) / 2).min() > 1e-9  # m/N; the stiffest load of all six
    K = array(corrected.input_stiffness)
    assert np.abs(K - K.T).max() < 1e-12 * K.max() and np.linalg.eigvalsh(K).min() > 0


def test_with_b_83_alone_three_of_six_loads_cost_no_energy(corrected: rrr_stage.Kinetostatics) -> None:
    eigenvalues = np.linalg.eigvalsh(whole(corrected, corrected.C_inFin))
    assert (np.abs(eigenvalues[:3]) < 1e-12 * eigenvalues[-1]).all() and eigenvalues[3] > 1e-3 * eigenvalues[-1]


def test_a_third_of_a_turn_maps_the_stage_onto_itself(corrected: rrr_stage.Kinetostatics) -> None:
    T, shift = direct.turned(2 * np.pi / 3), np.roll(np.eye(3), 1, axis=0)  # arm 2 -> 1 -> 3 -> 2
    for M in (array(corrected.C_oFin), array(corrected.complete_J)):
        assert np.allclose(T @ M, M @ shift.T, rtol=0, atol=1e-12 * np.abs(M).max())
    C = array(corrected.C_oFo)
    assert np.allclose(T @ C @ T.T, C, rtol=0, atol=1e-12 * C.max())


def test_the_jacobian_hardly_depends_on_the_hinge_equations() -> None:
    one, two = (array(s3.stage_of_case(case).J) for case in CASES)
    assert np.abs(one / two - 1).max() < 2e-4  # S3 section 5.1.1; 5 in the fourth digit as printed


def test_an_output_load_reaches_the_inputs_as_an_input_force_reaches_the_output(case: int) -> None:
    k = device_module.stage(s3_lengths.printed_device(case))
    assert (array(k.C_inFo) == array(k.C_oFin).T).all()


# The device


def test_every_number_of_the_stage_has_a_source(case: int) -> None:
    assert all(q.source for _, q in s3_lengths.printed_device(case).quantities())


def test_a_stack_pushes_with_what_its_travel_leaves_of_the_blocking_force(case: int) -> None:
    """Voltage -> input displacement of the model, against C_in F with F = F_b V/V_max - k_p d, solved by hand."""
    device = s3_lengths.printed_device(case)
    model = build_model(device)
    volts = np.array([150.0, 40.0, 90.0])
    k_p, C_in = 850 / 15e-6, array(device_module.stage(device).input_compliance)
    d = np.linalg.solve(np.eye(3) + k_p * C_in, C_in @ (850 * volts / 150))
    _, balance = model.dynamics(volts, d, volts, [])
    assert np.abs(balance.full()).max() < 1e-9 * 850  # rounding
    pose = np.array(model.evaluate(volts, d, volts, [])[list(model.signals).index("pose")]).ravel()
    assert np.allclose(output_per_voltage(device) @ volts, pose, rtol=1e-9)
    assert np.isclose(float(piezo_stack.stiffness(device.values().piezo)), k_p, rtol=1e-12)


def test_the_workspace_is_as_far_as_the_voltages_reach(case: int) -> None:
    """The mapped workspace against the corners of the voltages' cube, seen through the static map."""
    device = s3_lengths.printed_device(case)
    M, limit = output_per_voltage(device), 150.0
    workspace = Workspace(build_model(device))
    _, middle, _ = workspace.bases()
    assert np.allclose(middle, M @ np.full(3, limit / 2), rtol=0, atol=1e-6 * np.abs(M).max(axis=1) * limit)
    corners = M @ np.array(list(product((0.0, limit), repeat=3))).T
    extent = workspace.extent(middle)
    size = np.ptp(corners, axis=1)
    ends = np.column_stack([corners.min(axis=1), corners.max(axis=1)])
    assert (np.abs(extent - ends).max(axis=1) < 2e-4 * size).all()
    for k, (low, high) in enumerate(workspace.ranges(middle)):
        for end in (low, high):
            volts = limit / 2 + np.linalg.solve(M, (end - middle[k]) * np.eye(3)[k])
            assert np.isclose(np.abs(volts - limit / 2).max(), limit / 2, rtol=1e-6)  # one stack just at its end


def test_a_circle_is_solved_with_voltages_that_the_static_map_gives(tmp_path: Any) -> None:
    path = tmp_path / "scenario.toml"
    path.write_text(
        f'''title = "circle"\ndevice = "{DEVICES / "rrr_case2.toml"}"
        sample_rate = "100 Hz"\nduration = "1 s"\n[path]\nkind = "circle"\ndiameter = "20 um"
        plane = ["delta_x", "delta_y"]\ncentre = {{ theta_z = "-2 mrad" }}\n'''
    )
    scenario = load_scenario(path)
    trace = solve(scenario, build_model(scenario.device)).trace
    M = output_per_voltage(s3_lengths.printed_device(2))
    volts, pose = trace.signals["state"], trace.signals["pose"]
    assert np.abs(pose - volts @ M.T)[:, :2].max() < 1e-11 and np.abs(pose - volts @ M.T)[:, 2].max() < 1e-9
    assert volts.min() > 0 and volts.max() < 150
    assert np.isclose(np.hypot(pose[:, 0], pose[:, 1]), 10e-6, rtol=1e-6).all()
