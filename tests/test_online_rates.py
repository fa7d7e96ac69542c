"""Limits on rates of drives, kept online: the controller in Python against references written by hand and against the simulated model, and
its C against it. What `tests/test_limiter.py` shows of every combination of branches holds for rates too."""

from __future__ import annotations

import numpy as np
import pytest

import ctrlgen
from ctrlgen import ControllerStatus, build_model, generate, load_scenario, simulate, solve
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.online.vectors import vectors
from ctrlgen.verification.comparison import compare
from ctrlgen.verification.comparison_entry import ComparisonKind

GAIN, STIFFNESS, T = 0.2, 1e6, 1e-3  # N/V, N/m, s
FALL, RISE = np.array([-5.0, -8.0]), np.array([10.0, 8.0])  # V a sample
CIRCLE = 'kind = "circle"\ndiameter = "10 um"\ncentre = { x = "9 um", y = "8 um" }\nplane = ["x", "y"]\n'
RATE = ControllerStatus.RATE


def stage(**other):
    """A piezo X-Y stage without memory: gain u = stiffness d."""
    words = dict(
        parameters={"gain": "0.2 N/V", "k": "1 N/um"},
        drive={"x": ("0 V", "150 V"), "y": ("0 V", "150 V")},
        drive_rate={"x": ("-5 V/ms", "10 V/ms"), "y": "8 V/ms"},
        axes={"x": ("-1 um", "30 um"), "y": ("-1 um", "30 um")},
        force=lambda u, p: p.gain * u.vector,
        restoring_force=lambda d, p: p.k * d.vector,
    )
    return ctrlgen.user_device("stage", **(words | other))


def heated(**other):
    """Two heaters whose temperatures lag by 20 ms: 10 K/W, not above 100 K, and 0.1 um/K."""
    words = dict(
        parameters={"tau": "20 ms", "r": "10 K/W", "g": "0.1 um/K", "k": "1 N/um"},
        state={"a": ("-10 K", "100 K"), "b": ("-10 K", "100 K")},
        drive={"x": ("0 W", "30 W"), "y": ("0 W", "30 W")},
        drive_rate={"x": "1 W/ms", "y": "1 W/ms"},
        axes={"x": ("-1 um", "12 um"), "y": ("-1 um", "12 um")},
        rates=lambda u, x, p: [(p.r * u.x - x.a) / p.tau, (p.r * u.y - x.b) / p.tau],
        force=lambda x, p: [p.k * p.g * x.a, p.k * p.g * x.b],
        restoring_force=lambda d, p: p.k * d.vector,
    )
    return ctrlgen.user_device("heated", **(words | other))


def coil():
    """An axis with inertia."""
    return ctrlgen.user_device(
        "coil",
        parameters={"m": "0.5 kg", "c": "30 N*s/m", "k": "0.2 N/um", "f": "10 N/A"},
        axes={"axis": "100 um"},
        drive={"coil": "4 A"},
        drive_rate={"coil": "150 A/s"},
        force=lambda u, p: p.f * u.coil,
        mass=lambda p: p.m,
        restoring_force=lambda d, p: p.k * d.axis,
        damping_force=lambda v, p: p.c * v.axis,
    )


def loaded(folder, device, path=CIRCLE, timing='sample_rate = "1 kHz"\nduration = "0.05 s"\n'):
    (folder / "scenario.toml").write_text(f'title = "t"\ndevice = "{device.name}"\n{timing}[path]\n{path}')
    return load_scenario(folder, device), build_model(device)


def answers(controller, targets, settle=False):
    """Status, drive and predicted (x, z) of each target, one after the other from rest."""
    state, found = controller.rest(), []
    for target in targets:
        step = controller.step(state, target, settle=settle)
        state = step.state
        found.append(step)
    return found


def test_drives_go_toward_the_target_on_a_straight_line_as_fast_as_the_slowest_may():
    controller = controller_of(build_model(stage()), "pose", T)
    targets = np.random.default_rng(3).uniform(0, 28e-6, (60, 2)).repeat(4, axis=0)
    last = np.zeros(2)
    for step, target in zip(answers(controller, targets), targets, strict=True):
        change = STIFFNESS / GAIN * target - last
        share = min([1.0, *(r / c for c, r in zip(change, np.where(change > 0, RISE, FALL), strict=True) if c)])
        assert np.allclose(step.drive, last + share * change, rtol=0, atol=1e-11)  # V
        assert bool(step.status & RATE) == (share < 1) and step.status in (0, RATE)
        assert np.allclose(step.displacement, GAIN / STIFFNESS * step.drive, rtol=0, atol=1e-18)
        last = step.drive


def test_a_target_beyond_every_limit_keeps_ranges_and_rates():
    controller = controller_of(build_model(stage()), "pose", T)
    targets = np.random.default_rng(4).normal(size=(300, 2)) * 60e-6
    found = answers(controller, targets)
    drive = np.array([np.zeros(2), *(step.drive for step in found)])
    assert np.all((drive >= 0) & (drive <= 150))
    assert np.all((np.diff(drive, axis=0) <= RISE + 1e-12) & (np.diff(drive, axis=0) >= FALL - 1e-12))
    assert any(step.status == RATE | ControllerStatus.DISPLACEMENT for step in found)


def test_settling_takes_as_many_calls_as_the_drive_takes_samples():
    controller = controller_of(build_model(stage()), "pose", T)
    found = answers(controller, [np.array([20e-6, 4e-6])] * 12, settle=True)  # 100 V and 20 V, 10 V a sample
    assert [step.status for step in found] == [RATE] * 9 + [0] * 3
    assert np.allclose([step.drive for step in found[:9]], np.outer(np.arange(1, 10), [10.0, 2.0]), rtol=0, atol=1e-12)


def test_what_is_no_target_leads_to_the_safe_drives_as_fast_as_they_may_and_a_lost_state_at_once():
    controller = controller_of(build_model(stage()), "pose", T)
    state = answers(controller, [np.array([6e-6, 3e-6])] * 4)[-1].state
    assert np.allclose(state[2], [30.0, 15.0])
    for expected in ([25.0, 12.5], [20.0, 10.0]):  # the fall of x, 5 V, is the slower
        step = controller.step(state, np.array([np.nan, 0.0]))
        assert step.status == ControllerStatus.INPUT and np.allclose(step.drive, expected, rtol=0, atol=1e-12)
        state = step.state
    for spoilt in (np.array([np.nan, 1.0]), np.array([1e9, 1.0])):
        step = controller.step((*state[:2], spoilt), np.array([25e-6, 3e-6]))
        assert step.status == ControllerStatus.LOST and np.all(step.drive == 0.0)
        assert all(np.all(np.isnan(part)) for part in step.state)


def test_a_state_that_passes_its_limit_because_the_drive_falls_too_slowly_is_told_and_comes_back():
    """Heating to 100 K at full power, which would end at 300 K: from 30 W to 10 W takes 20 ms, a time constant."""
    model = build_model(heated())
    controller = controller_of(model, "pose", T)
    hot, cold = np.array([9.9e-6, 2e-6]), np.array([1e-6, 1e-6])
    targets = [hot] * 150 + [cold] * 100 + [hot] * 60
    found = answers(controller, targets)
    drive = np.array([step.drive for step in found])
    assert np.all((drive >= 0) & (drive <= 30)) and np.abs(np.diff(drive, axis=0)).max() <= 1 + 1e-12
    moved = simulate(model, drive, T, *controller.rest()[:2])
    assert np.allclose([step.state[1] for step in found], moved.z[1:], rtol=0, atol=1e-15)
    beyond = (moved.x[1:] > 100 + 1e-6).any(axis=1)
    assert 3 < beyond.sum() < 60  # the case that is meant, and it ends
    told = [bool(step.status & RATE) and bool(step.status & ControllerStatus.STATE) for step in found]
    assert all(t for t, b in zip(told, beyond, strict=True) if b)
    assert found[149].status == 0 and np.allclose(moved.z[150], hot, rtol=0, atol=1e-12)


def test_a_motion_that_is_too_fast_for_its_drive_is_left_and_found_again():
    controller = controller_of(build_model(coil()), "pose", 2e-4)
    held = controller.rate.rise[0]
    assert held == pytest.approx(0.03)  # A a sample
    step = controller.step(controller.rest(), np.array([0.0, 0.0, 4.0]))  # 2 N take 0.2 A
    assert step.status == RATE and step.drive == pytest.approx([held])
    for _ in range(6):
        step = controller.step(step.state, np.array([0.0, 0.0, 4.0]))
    assert step.status == 0 and step.drive == pytest.approx([0.2])


@pytest.mark.parametrize("device", [stage, heated])
def test_the_shipped_vectors_meet_the_rate_and_what_it_leads_beyond(device, tmp_path):
    scenario, model = loaded(tmp_path, device())
    command = scenario.bind(model).samples
    controller = controller_of(model, "pose", T)
    for real in Real:
        rows = vectors(controller, command, real)["rows"]
        both = {bool(row["how"] & 1) for row in rows if row["status"] & RATE}
        assert both == {True, False}
        assert any(row["status"] == 0 for row in rows)


@pytest.mark.long
@pytest.mark.parametrize("device", [stage, heated, coil])
def test_the_c_keeps_the_rates_as_the_controller_does(device, tmp_path):
    """Along the scenario, at random and hostile targets, in both arithmetics: status and drives, and what the model does under them."""
    path, timing = CIRCLE, 'sample_rate = "1 kHz"\nduration = "0.5 s"\n'
    if device is coil:
        path, timing = (
            'kind = "line"\nstart = { axis = "-20 um" }\nend = { axis = "30 um" }\n',
            'sample_rate = "5 kHz"\nduration = "0.1 s"\n',
        )
    if device is heated:
        path = CIRCLE.replace("10 um", "5 um").replace("9 um", "6 um").replace("8 um", "5 um")
    scenario, model = loaded(tmp_path, device(), path, timing)
    solution = solve(scenario, model)
    compared = compare(generate(scenario, model, tmp_path / "c", solution), solution)
    assert compared.passed, [row for row in compared.rows if not row.passed]
    assert any(row.what is ComparisonKind.RATE for row in compared.rows)


def test_rates_without_time_are_refused(tmp_path):
    poses = 'kind = "poses"\npoints = [{ x = "5 um", y = "1 um" }]\n'
    scenario, model = loaded(tmp_path, stage(), poses, "")
    with pytest.raises(ctrlgen.InputError, match=r"sample_rate: is missing, .*rate of x, rate of y"):
        generate(scenario, model, tmp_path / "c")
    assert not (tmp_path / "c").exists()
