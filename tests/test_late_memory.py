"""Creep under held drives: where these put a stage elsewhere at once it learns of that in time; behind heaters, half a sample late, and a
solved path says how far off that is."""

from __future__ import annotations

import shutil

import casadi as ca
import numpy as np
import pytest
from conftest import SCENARIOS
from scipy.interpolate import CubicSpline

from ctrlgen import build_model, load_device, load_scenario, simulate, solve
from ctrlgen.core.units import show
from ctrlgen.model.discretisation import balanced, driven_step
from ctrlgen.model.inverse import invert

GAIN, TAU = 0.1, 0.05
CREEP = '\n[[effect]]\nkind = "creep"\nat = "all"\ngain = "{}"\ntau = "50 ms"\nslow = "0"\n'
AT_ONCE, HEATED = ("meso_circle", "meso_hexapod", "100 Hz"), ("circle20", "mems_hexapod", "1 kHz")


def circled(folder, which, more: str = "", rate: str = ""):
    scenario, device, usual = which
    shutil.copytree(SCENARIOS / "devices", folder / "devices")
    shutil.copytree(SCENARIOS / scenario, folder / scenario)
    with (folder / "devices" / f"{device}.toml").open("a") as file:
        file.write(more)
    path = folder / scenario / "scenario.toml"
    path.write_text(path.read_text().replace(f'sample_rate = "{usual}"', f'sample_rate = "{rate or usual}"'))
    described = load_scenario(path)
    return solve(described, build_model(described.device))


def crept(solution) -> tuple[np.ndarray, np.ndarray]:
    """(n, 6) [m] each creep of a solution, and the displacement that it follows, at the samples."""
    t = solution.trace
    return t.x[:, [k for k, name in enumerate(solution.model.x_names) if "_z_" in name]], t.z


def poses(solution, off: np.ndarray) -> np.ndarray:
    """How far the pose is off where every creep is `off` (n, 6) [m]."""
    creep, z = crept(solution)
    J = np.linalg.lstsq(z + GAIN * creep, solution.trace.signals["pose"], rcond=None)[0]
    return GAIN * np.abs(off @ J)


def test_where_drives_move_the_stage_at_once_creep_is_in_time(tmp_path):
    """Each relaxes exactly to the displacement that its drive holds, and nothing is told."""
    solution = circled(tmp_path, AT_ONCE, CREEP.format(GAIN))
    creep, _ = crept(solution)
    true, kept = [creep[0]], np.exp(-solution.scenario.sample_time / TAU)
    for u in solution.drive:
        true.append(u + (true[-1] - u) * kept)
    n = len(creep)
    assert np.ptp(creep) > 1e-5 and np.abs(np.array(true)[:n] - creep).max() < 1e-9 * np.ptp(creep)
    assert solution.late_memory is None and not solution.left_out
    # and the drives lead along the path
    follow = solution.scenario.file.follow
    replayed = simulate(
        solution.model, solution.drive, solution.scenario.sample_time, solution.trace.x[0], solution.trace.z[0]
    ).signals[follow][: len(solution.drive)]
    assert np.abs(replayed - solution.trace.signals[follow][: len(solution.drive)]).max() < 1e-12


STIFFENING = '\n[[effect]]\nkind = "stiffening"\nat = "all"\nk3 = "5e-9 N/um^3"\n'


@pytest.mark.parametrize("device, more", [("meso_hexapod", ""), ("parallelogram", STIFFENING)])
def test_kernels_see_the_displacement_that_the_drive_gives(device, more, tmp_path):
    """The inverse's step and the model's are one, whatever the displacement of the sample before was; of a stage that stiffens too."""
    text = (SCENARIOS / "devices" / f"{device}.toml").read_text() + CREEP.format(GAIN) + more
    (tmp_path / "device.toml").write_text(text)
    model, rng = build_model(load_device(tmp_path / "device.toml")), np.random.default_rng(1)
    inverse = invert(model, "pose", 0.01)
    x, z, u = (scale * rng.uniform(-1, 1, len(scale)) for scale in (model.x_scale, model.z_scale, model.u_scale / 2))
    under = ca.Function("z", [model.x, model.z, model.u, model.p], [balanced(model, model.x, model.u, 8)])
    there = under(x, z, u, model.p_nominal).full().ravel()
    taus = np.where(["_z_" in name for name in model.x_names], TAU, 4 * TAU)  # and the slow ones
    to = np.repeat(there, 2)
    then = to + (x - to) * np.exp(-0.01 / taus)
    assert inverse.advance(x, z, u).full().ravel() == pytest.approx(then, rel=1e-9)
    assert inverse.memory(x, z, there).full().ravel() == pytest.approx(then, rel=1e-9)
    assert inverse.drive(x, z, there, []).full().ravel() == pytest.approx(u, rel=1e-9)
    moved = simulate(model, u[None, :], 0.01, x, z)
    assert moved.x[1] == pytest.approx(then, rel=1e-9) and moved.z[1] == pytest.approx(there, rel=1e-9)
    led = inverse.displacement(x, z, moved.signals["pose"][1]).full().ravel()
    assert led == pytest.approx(there, rel=1e-9)


def test_a_drive_that_goes_from_end_to_end_is_met_where_it_leads(tmp_path):
    """The step of IPOPT and of the plant's C, of always as many of Newton's steps, beside the simulation, which takes what it needs."""
    text = (SCENARIOS / "devices" / "parallelogram.toml").read_text() + CREEP.format(GAIN) + STIFFENING
    (tmp_path / "device.toml").write_text(text)
    model, (low, high) = build_model(load_device(tmp_path / "device.toml")), (-1.5, 1.5)
    begun = simulate(model, np.array([[low]] * 2), 0.01)
    wanted = simulate(model, np.array([[high]]), 0.01, begun.x[-1], begun.z[-1]).x[1]
    step = ca.Function("x", [model.x, model.z, model.u, model.p], [driven_step(model, 0.01)])
    found = step(begun.x[-1], begun.z[-1], high, model.p_nominal).full().ravel()
    assert found == pytest.approx(wanted, rel=1e-5)


def late(solution) -> np.ndarray:
    """(n, channels) how far the pose is off where each creep relaxes to what the stage does between samples, a smooth curve."""
    creep, z = crept(solution)
    h = solution.scenario.sample_time
    curve, true = CubicSpline(np.arange(len(z)) * h, z), [creep[0]]
    # w(h) = w e^(-h/tau) + int_0^h e^(-(h - s)/tau) z(s)/tau ds, by Gauss's rule
    nodes, weights = np.polynomial.legendre.leggauss(8)
    at = h * (nodes + 1) / 2
    share = weights * h / 2 * np.exp(-(h - at) / TAU) / TAU
    for k in range(len(creep) - 1):
        true.append(true[-1] * np.exp(-h / TAU) + share @ curve(k * h + at))
    return poses(solution, np.array(true) - creep)


def test_behind_heaters_a_solved_path_says_how_far_off_creep_leaves_it(tmp_path):
    solution = circled(tmp_path, HEATED, CREEP.format(GAIN))
    told, off = solution.late_memory, late(solution)
    channel = told.signal.channels.index(told.channel)
    most = off[: len(solution.drive), channel].max()
    assert told.off == pytest.approx(most, rel=0.05)  # what eight steps leave, extrapolated
    assert told.off > 1e-9 and told.channel in ("delta_x", "delta_y")
    (sentence,) = solution.left_out
    assert show(told.off, "um") in sentence and "half the sample time" in sentence


@pytest.mark.parametrize("delay", ["0.5 ms", "5 ms"])
def test_a_late_reading_beside_it_changes_nothing(tmp_path, delay):
    """A delay keeps as many readings as it is samples long, which are more where these are shorter."""
    late = f'\n[[effect]]\nkind = "delay"\nat = "delta_x"\ndelay = "{delay}"\n'
    plain, delayed = (
        circled(tmp_path / str(k), HEATED, CREEP.format(GAIN) + more) for k, more in enumerate(("", late))
    )
    assert delayed.late_memory.off == pytest.approx(plain.late_memory.off, rel=1e-9)


def test_half_the_sample_time_leaves_half_and_no_creep_nothing(tmp_path):
    whole, half = (
        circled(tmp_path / rate[:1], HEATED, CREEP.format(GAIN), rate).late_memory.off for rate in ("500 Hz", "1 kHz")
    )
    assert half == pytest.approx(whole / 2, rel=0.1)
    assert circled(tmp_path / "none", HEATED).late_memory is None
    assert circled(tmp_path / "little", HEATED, CREEP.format(1e-4)).late_memory is None
