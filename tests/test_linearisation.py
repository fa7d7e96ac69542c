"""The model as a linear system: closed forms, small steps of the nonlinear simulation; its Bode plot for every shipped device."""

from __future__ import annotations

import control
import numpy as np
import pytest
from conftest import DEVICES

from ctrlgen import InputError, build_model, load_device, simulate
from ctrlgen.controller.bode import draw_bode
from ctrlgen.controller.linearisation import equilibrium, linearise
from ctrlgen.trajectory.workspace import middle_pose

SMALL = 1e-4  # of a drive's range: the second order of the force is then far below the tolerance


def model_of(name: str):
    return build_model(load_device(DEVICES / name))


def test_an_axis_with_mass_is_the_oscillator_of_its_file():
    """k_f/(k + i w c - w^2 m), with the numbers of flexure_axis.toml; at resonance as below and above it."""
    system = linearise(model_of("flexure_axis.toml"), np.zeros(1))
    m, c, k, k_f = 0.5, 30.0, 0.2e6, 10.0
    omega = np.array([1.0, 300.0, np.sqrt(k / m), 1e4])
    response = control.frequency_response(system, omega, squeeze=False).complex[0, 0]
    assert response == pytest.approx(k_f / (k + 1j * omega * c - omega**2 * m), rel=1e-9)
    assert list(system.state_labels) == ["velocity_axis", "displacement_axis"] and list(system.output_labels) == [
        "axis"
    ]


@pytest.mark.parametrize("name", ["mems_hexapod.toml", "xy_lever_stage.toml", "tripod.toml", "dynamic_hexapod.toml"])
def test_a_small_step_of_a_drive_moves_the_pose_as_simulated(name):
    """From the equilibrium in the middle, during the first lags and periods: the pose of the nonlinear model, to a thousandth of the
    largest motion, counted in the channels' typical sizes."""
    model = model_of(name)
    pose, scale = middle_pose(model), np.array(model.signals["pose"].scale)
    x, z, u = equilibrium(model, pose)
    system = linearise(model, pose)
    time = np.linspace(0, 3 / np.abs(system.poles()).min(), 61)
    for j in range(len(u)):
        step = np.zeros(len(u))
        step[j] = SMALL * float((model.u_bounds[1] - model.u_bounds[0])[j])
        linear = control.forced_response(system, time, np.outer(step, np.ones(len(time))), squeeze=False).outputs
        held = simulate(model, np.tile(u + step, (len(time) - 1, 1)), time[1], x, z).signals["pose"] - pose
        moved = float(np.abs(held / scale).max())
        assert moved > 0
        assert np.abs((np.asarray(linear).T - held) / scale).max() < 1e-3 * moved


QUICK = ("flexure_axis.toml", "parallelogram.toml", "tilt_platform.py", "tripod.toml")
SHIPPED = sorted(path.name for path in DEVICES.iterdir() if path.suffix in (".toml", ".py"))


@pytest.mark.long
@pytest.mark.parametrize("name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.long) for n in SHIPPED])
def test_a_bode_plot_of_a_shipped_device_is_drawn_or_there_is_nothing_to_draw(name, tmp_path, recwarn):
    model, path = model_of(name), tmp_path / "bode.png"
    pose = middle_pose(model)
    if len(linearise(model, pose).poles()):
        draw_bode(model, pose, path)
        assert path.stat().st_size > 10_000 and not recwarn.list
    else:
        with pytest.raises(InputError, match="nothing to draw"):
            draw_bode(model, pose, path)
