"""More drives than axes online: the least effort within limits, a sample at a time. References are scipy's linear programmes and SLSQP."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import SCENARIOS
from scipy.optimize import linprog
from three_stacks import HIGH, LOW, RANGE, WEIGHTS, B, W, can_push, circle, forces, heavy, loaded, reference, stage

from ctrlgen import InputError, build_model, generate, load_scenario, solve
from ctrlgen.controller.controller_step import ControllerStatus
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.controller.null_motion import null_motion
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.online.vectors import vectors
from ctrlgen.firmware.player_only import check_online
from ctrlgen.verification.comparison import compare

T = 1e-3
OPPOSED = 0.2 * np.array([[1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -0.5]])  # N/V


def pairs(**other):
    """Two axes, each between two stacks that only push."""
    words = dict(
        drive={name: ("0 V", "150 V") for name in "abcd"},
        force=lambda u, p: [p.g * (u.a - u.b), p.g * (u.c - 0.5 * u.d)],
        axes={"x": "25 um", "y": "12 um"},
    )
    return stage(**(words | other))


@pytest.mark.parametrize("weights", [None, WEIGHTS])
def test_the_drives_are_those_of_the_quadratic_programme_wherever_there_are_any(weights):
    controller = controller_of(build_model(stage(drive_weight=weights)), "pose", T)
    rng, state, acted = np.random.default_rng(5), controller.rest(), 0
    for _ in range(80):
        target = rng.uniform(-26e-6, 26e-6, 2)
        step = controller.step(state, target)
        f, state = forces(target), step.state
        assert np.all((step.drive >= LOW) & (step.drive <= HIGH))
        assert (step.status == 0) == can_push(f)
        assert np.allclose(B @ step.drive, forces(step.displacement), rtol=0, atol=1e-8)  # N of 20 N
        if step.status == 0:
            w = W if weights else np.ones(3)
            best = reference(f, w)
            assert np.allclose(step.drive, best, rtol=0, atol=2e-3)  # V: where SLSQP ends
            R = np.diag(RANGE / np.sqrt(w))
            acted += np.abs(R @ np.linalg.pinv(B @ R) @ f - best).max() > 1
        else:
            assert step.status == ControllerStatus.DRIVE
    assert acted > 10


def test_the_null_space_keeps_a_rate_wherever_drives_keep_it_and_push_as_wanted():
    """Whether there are such drives is what a linear programme over range and rate says."""
    model = build_model(stage(drive_rate={"a": "30 V/ms", "b": "60 V/ms"}))
    controller, rng = controller_of(model, "pose", T), np.random.default_rng(6)
    rise = np.array([30.0, 60.0, np.inf])
    state, kept, spared = controller.rest(), 0, 0
    target = np.zeros(2)
    for _ in range(250):
        target = np.clip(target + rng.normal(size=2) * 4e-6, -15e-6, 15e-6)
        last, step = state[2], controller.step(state, target)
        low, high = np.maximum(LOW, last - rise), np.minimum(HIGH, last + rise)
        assert np.all((step.drive >= low - 1e-9) & (step.drive <= high + 1e-9))
        possible = (
            linprog(np.zeros(3), A_eq=B, b_eq=forces(target), bounds=list(zip(low, high, strict=True))).status == 0
        )
        if step.status == 0:
            assert np.allclose(B @ step.drive, forces(target), rtol=0, atol=1e-8)
            R = np.diag(RANGE)
            free = R @ np.linalg.pinv(B @ R) @ forces(target)
            spared += np.any((free < low - 1) | (free > high + 1))
        assert (step.status == 0) == possible, (step.status, possible)
        kept, state = kept + possible, step.state
    assert 50 < kept < 240 and spared > 5


def test_pairs_that_act_on_axes_of_their_own_are_chosen_each_by_itself():
    model = build_model(pairs())
    motion = null_motion(model)
    assert motion.groups == ((0, 1), (2, 3))
    assert np.allclose(OPPOSED @ motion.direction, 0.0, atol=1e-15)
    controller = controller_of(model, "pose", T)
    for target in np.random.default_rng(7).uniform(-1, 1, (40, 2)) * [25e-6, 12e-6]:
        step = controller.step(controller.rest(), target)
        f = forces(target)
        assert step.status == 0
        expected = [max(f[0] / 0.2, 0), max(-f[0] / 0.2, 0), max(f[1] / 0.2, 0), max(-f[1] / 0.1, 0)]
        assert np.allclose(step.drive, expected, rtol=0, atol=1e-9)  # V: the one that pulls would have to stays off


@pytest.mark.parametrize(
    ("device", "says"),
    [
        (
            stage(
                drive=dict.fromkeys("abcd", "100 V"), force=lambda u, p: [p.g * (u.a + u.b + u.d), p.g * (u.c - u.b)]
            ),
            r"drives \(a, b, c, d\) with 2 free choices.*use the player",
        ),
        (
            stage(force=lambda u, d, p: [p.g * (u.a + 0.5 * u.b), p.g * (1 + d.x / 1e-3) * (u.c - 0.5 * u.b)]),
            "slope by the drives changes.*use the player",
        ),
        (
            stage(
                drive={"a": "100 V", "c": "130 V"},
                axes={"x": ("5 um", "30 um"), "y": "30 um"},
                force=lambda u, p: [p.g * u.a, p.g * u.c],
                limits={"flexure_force": (lambda d, p: p.k * d.x, "20 N")},
            ),
            "moves x in a range that leaves out where it rests",
        ),
    ],
)
def test_what_cannot_be_chosen_online_is_refused(device, says, tmp_path):
    scenario, model = loaded(tmp_path, device, circle(10))
    with pytest.raises(InputError, match=says):
        check_online(scenario, model)


def test_the_shipped_vectors_of_the_platform_meet_range_and_rate():
    scenario = load_scenario(SCENARIOS / "tilt_platform")
    model = build_model(scenario.device)
    controller = controller_of(model, "pose", scenario.sample_time)
    rows = vectors(controller, scenario.bind(model).samples, Real.FLOAT)["rows"]
    seen = {int(row["status"]) for row in rows}
    assert {0, 1, 8, 16, 128} <= {bit for status in seen for bit in (0, 1, 8, 16, 128) if status & bit or status == bit}
    assert {row["how"] & 1 for row in rows if row["status"] & 128} == {0, 1}


@pytest.mark.long
@pytest.mark.parametrize(
    "device",
    [
        stage(drive_weight=WEIGHTS),
        stage(drive_rate={"a": "40 V/ms"}),
        pairs(),
        heavy(drive_rate={"a": "40 V/ms"}),
        heavy(),
    ],
    ids=["weighted", "rated", "pairs", "inertial and rated", "inertial"],
)
def test_the_c_chooses_as_the_controller_does(device, tmp_path):
    path, timing = circle(20), 'sample_rate = "1 kHz"\nduration = "0.1 s"\n'
    model = build_model(device)
    if model.inertial:
        path = 'kind = "line"\nstart = { x = "-12 um", y = "5 um" }\nend = { x = "14 um", y = "-3 um" }\n'
        timing = 'sample_rate = "5 kHz"\nduration = "0.05 s"\n'
    scenario, model = loaded(tmp_path, device, path, timing)
    solution = solve(scenario, model)
    compared = compare(generate(scenario, model, tmp_path / "c", solution), solution)
    assert compared.passed, [row for row in compared.rows if not row.passed]
