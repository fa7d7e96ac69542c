"""The motion of a stage with inertia against fine explicit steps that share nothing with it."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from conftest import AXIS_FILE

import ctrlgen
from ctrlgen import build_model, load_device, simulate
from ctrlgen.model import integrators

AXIS = AXIS_FILE.read_text()
MASS, DAMPING, STIFFNESS, MOTOR = 0.5, 30.0, 2e5, 10.0
H, N = 1e-3, 400
TIME = H * np.arange(N)
DRIVES = {
    "several frequencies": np.sin(2 * np.pi * 11 * TIME) + 0.5 * np.sin(2 * np.pi * 67 * TIME + 1),
    "ramps, where it sticks": np.interp(
        TIME, np.linspace(0, N * H, 9), [0, 0.2, -0.1, -0.15, 0.3, 0.25, -0.3, 0.1, 0.12]
    ),
    "steps, where it sticks": np.repeat([0.1, 0.3, -0.2, -0.25, 0.05, 0.0, 0.2, 0.21], N // 8),
}


def simulated(effect: str, drive: np.ndarray, folder) -> tuple[np.ndarray, integrators.ExponentialIntegrator]:
    """Displacement (N + 1,) [m] by ctrlgen, and the steps it took."""
    (folder / "device.toml").write_text(f"{AXIS}\n[[effect]]\nat = 'axis'\n{effect}")
    model = build_model(load_device(folder / "device.toml"))
    return simulate(model, drive[:, None], H).signals["displacement"][:, 0], integrators.integrator_of(model, H)


def rubbing(force: float, reach: float) -> str:
    """The effect; it creeps no faster than some nanometres a second."""
    return f"kind = 'coulomb'\nforce = '{force} N'\nreach = '{reach} m'\nsmoothing = '1 nm/s'"


def nothing(z: float, v: float, b: float) -> tuple[float, float]:
    return 0.0, 0.0


def dahl(force: float, reach: float):
    """Force and rate of the bristle b."""
    return lambda z, v, b: (-force * b, (v - abs(v) * b) / reach)


def stepped(law, drive: np.ndarray, fine: int) -> np.ndarray:
    """The same by Runge and Kutta's classical steps, `fine` a sample; `law` (z, v, b) -> force [N], db/dt."""
    y = np.zeros(3)
    h, found = H / fine, [0.0]
    for u in drive:
        push = MOTOR * u

        def rates(y, push=push):
            z, v, b = y
            force, bent = law(z, v, b)
            return np.array([v, (push - STIFFNESS * z - DAMPING * v + force) / MASS, bent])

        for _ in range(fine):
            a = rates(y)
            b = rates(y + h / 2 * a)
            c = rates(y + h / 2 * b)
            y = y + h / 6 * (a + 2 * b + 2 * c + rates(y + h * c))
        found.append(y[0])
    return np.array(found)


@pytest.mark.long
@pytest.mark.parametrize(
    "reach, share", [(3e-6, 0.005), pytest.param(0.3e-6, 0.01, marks=pytest.mark.long), (0.1e-6, 0.02)]
)
@pytest.mark.parametrize("drive", DRIVES.values(), ids=DRIVES)
def test_dry_friction_is_right_to_hundredths_of_itself_sliding_and_sticking(tmp_path, drive, reach, share):
    """Contacts that yield by 0.1 um are crossed in 5 us of a sample of 1 ms, and hold 25 times as stiffly as the flexures."""
    force = 0.5
    found, steps = simulated(rubbing(force, reach), drive, tmp_path)
    assert isinstance(steps, integrators.ImplicitRadau)
    fine = int(np.ceil(H * 0.03 / reach))  # a bristle slips at 20 mm/s: two thirds of its time a step
    wanted = stepped(dahl(force, reach), drive, max(fine, 40))
    effect = wanted - stepped(nothing, drive, 40)
    rms = np.sqrt(np.mean(effect**2))
    assert np.sqrt(np.mean((found - wanted) ** 2)) < share * rms


@pytest.mark.long
def test_what_bends_gently_is_of_second_order(tmp_path, monkeypatch):
    """Reversals that take longer than a step."""
    drive, off = DRIVES["several frequencies"], []
    wanted = stepped(dahl(0.5, 3e-6), drive, 200)
    effect = rubbing(0.5, 3e-6)
    for count in (4, 8, 16):
        monkeypatch.setattr(integrators, "substeps", lambda *_, count=count: count)
        off.append(np.sqrt(np.mean((simulated(effect, drive, tmp_path)[0] - wanted) ** 2)))
    assert off[0] / off[1] > 3 and off[1] / off[2] > 3


def test_what_does_not_bend_with_the_velocity_is_stepped_explicitly(tmp_path):
    drive, k3 = DRIVES["several frequencies"], 4e12
    found, steps = simulated(f"kind = 'stiffening'\nk3 = '{k3} N/m^3'", drive, tmp_path)
    assert isinstance(steps, integrators.ExponentialRungeKutta)
    wanted = stepped(lambda z, v, b: (-k3 * z**3, 0.0), drive, 40)
    effect = wanted - stepped(nothing, drive, 40)
    assert np.sqrt(np.mean((found - wanted) ** 2)) < 1e-3 * np.sqrt(np.mean(effect**2))


def test_a_standing_stage_stays_where_friction_holds_it(tmp_path):
    """Below the force of friction it comes to rest on the springs of flexure and contact, and stays."""
    force, reach, push = 0.5, 0.1e-6, 0.3
    drive = np.full(N, push / MOTOR)
    found, _ = simulated(rubbing(force, reach), drive, tmp_path)
    free = stepped(nothing, drive, 40)[-1]
    assert 0 < found[-1] < 0.5 * free
    assert abs(found[-1] - found[-50]) < 1e-3 * reach  # of the ringing on the contact


def test_bristles_bend_by_dahls_law(tmp_path):
    """Pulled up slowly from rest: F = f (1 - exp(-d/r))."""
    force, reach = 0.5, 1e-6
    ramp = np.linspace(0, 0.7, N) / MOTOR
    found, _ = simulated(rubbing(force, reach), ramp, tmp_path)
    held = MOTOR * ramp[100:] - STIFFNESS * found[101:]
    assert held == pytest.approx(force * (1 - np.exp(-found[101:] / reach)), rel=0.02)  # but for its inertia


@pytest.mark.long
@pytest.mark.parametrize("stiffness, share", [(5e5, 0.01), (5e6, 0.01), (2e7, 0.02)])
def test_an_impact_is_stable_and_right_to_a_hundredth_of_itself(tmp_path, stiffness, share):
    """Hertz's contact 20 um out, up to a hundred times as stiff as the flexures: its period is half a sample."""
    gap, soft = 20e-6, 1e-3 * 100e-6  # the device's typical travel is 100 um
    text = f"kind = 'end_stop'\nstiffness = '{stiffness} N/m'\ngap = '20 um'\npower = '1.5'"
    drive = 0.6 * DRIVES["several frequencies"]
    found, steps = simulated(text, drive, tmp_path)

    def touching(z, v, b):
        x = max(z - gap, 0.0)
        return -stiffness * x**2 / (x + 1e-3 * soft) * np.sqrt(1 + x / soft), 0.0

    exact, free = stepped(touching, drive, 200), stepped(nothing, drive, 200)
    assert np.ptp(free) > 3 * gap and exact.max() < 1.5 * gap
    assert np.sqrt(np.mean((found - exact) ** 2)) < share * np.sqrt(np.mean((exact - free) ** 2))
    assert isinstance(steps, integrators.ExponentialRungeKutta)


def test_a_law_that_ends_within_the_typical_travel_is_simulated_inside():
    """sqrt(1 - d/0.8) has no value at the whole typical travel of 1 m: no steps are asked for there."""
    device = ctrlgen.user_device(
        "stub",
        parameters={"mass": "1 kg", "spring": "100 N"},
        drive={"motor": "1 N"},
        axes={"way": "1 m"},
        mass=lambda p: p.mass,
        force=lambda u, p: u.motor,
        restoring_force=lambda d, p: p.spring * (1 - ca.sqrt(1 - d.way / 0.8)),
    )
    model = build_model(device)
    assert not np.isfinite(integrators.slope_at_rest(model, displacement=1.0)).all()
    found = simulate(model, np.full((200, 1), 0.5), H).signals["displacement"]
    assert np.isfinite(found).all() and 0 < found.max() < 0.1
