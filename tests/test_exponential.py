"""The motion of a stage with inertia against fine explicit steps that share nothing with it."""

from __future__ import annotations

from math import tanh

import numpy as np
import pytest
from conftest import SCENARIOS

from ctrlgen import build_model, exponential, load_device, simulate

AXIS = (SCENARIOS / "devices" / "flexure_axis.toml").read_text()
MASS, DAMPING, STIFFNESS, MOTOR = 0.5, 30.0, 2e5, 10.0
H, N = 1e-3, 400
TIME = H * np.arange(N)
DRIVES = {
    "several frequencies": np.sin(2 * np.pi * 11 * TIME) + 0.5 * np.sin(2 * np.pi * 67 * TIME + 1),
    "ramps, where it sticks": np.interp(TIME, np.linspace(0, N * H, 9), [0, 0.2, -0.1, -0.15, 0.3, 0.25, -0.3, 0.1, 0.12]),
    "steps, where it sticks": np.repeat([0.1, 0.3, -0.2, -0.25, 0.05, 0.0, 0.2, 0.21], N // 8),
}  # fmt: skip


def simulated(effect: str, drive: np.ndarray, folder) -> tuple[np.ndarray, exponential.Steps]:
    """Displacement (N + 1,) [m] by ctrlgen, and the steps it took."""
    (folder / "device.toml").write_text(f"{AXIS}\n[[effect]]\nat = 'axis'\n{effect}")
    model = build_model(load_device(folder / "device.toml"))
    return simulate(model, drive[:, None], H).signals["displacement"][:, 0], exponential.steps_of(model, H)


def nothing(z: float, v: float) -> float:
    return 0.0


def stepped(law, drive: np.ndarray, fine: int) -> np.ndarray:
    """The same by Runge and Kutta's classical steps, `fine` a sample; `law` (z, v) [N]."""
    z = v = 0.0
    h, found = H / fine, [0.0]
    for u in drive:
        push = MOTOR * u

        def pull(z, v, push=push):
            return (push - STIFFNESS * z - DAMPING * v + law(z, v)) / MASS

        for _ in range(fine):
            a = pull(z, v)
            b = pull(z + h / 2 * v, v + h / 2 * a)
            c = pull(z + h / 2 * (v + h / 2 * a), v + h / 2 * b)
            d = pull(z + h * (v + h / 2 * b), v + h * c)
            z += h * v + h * h / 6 * (a + b + c)
            v += h / 6 * (a + 2 * b + 2 * c + d)
        found.append(z)
    return np.array(found)


@pytest.mark.parametrize("speed, share", [(20e-3, 1e-3), (1e-3, 0.005), (0.1e-3, 0.03)])
@pytest.mark.parametrize("drive", DRIVES.values(), ids=DRIVES)
def test_dry_friction_is_right_to_hundredths_of_itself_sliding_and_sticking(tmp_path, drive, speed, share):
    """A reversal at 0.1 mm/s takes 3 us of a sample of 1 ms; friction sticks 10 times as stiffly as explicit steps bear."""
    force = 0.5
    found, steps = simulated(f"kind = 'coulomb'\nforce = '{force} N'\nsmoothing = '{speed} m/s'", drive, tmp_path)
    assert isinstance(steps, exponential.Sticking)
    fine = 10 * int(np.ceil(max(10.0, H * force / MASS / speed)))  # a tenth of a step that would chatter
    wanted = stepped(lambda z, v: -force * tanh(v / speed), drive, fine)
    effect = wanted - stepped(nothing, drive, 100)
    rms = np.sqrt(np.mean(effect**2))
    assert np.sqrt(np.mean((found - wanted) ** 2)) < share * rms


def test_what_bends_gently_is_of_second_order(tmp_path, monkeypatch):
    """Reversals that take longer than a step."""
    drive, speed, off = DRIVES["several frequencies"], 0.1, []
    wanted = stepped(lambda z, v: -2.0 * tanh(v / speed), drive, 100)
    effect = "kind = 'coulomb'\nforce = '2 N'\nsmoothing = '0.1 m/s'"
    for count in (1, 2, 4):
        monkeypatch.setattr(exponential, "substeps", lambda *_, count=count: count)
        off.append(np.sqrt(np.mean((simulated(effect, drive, tmp_path)[0] - wanted) ** 2)))
    assert off[0] / off[1] > 3 and off[1] / off[2] > 3


def test_what_does_not_bend_with_the_velocity_is_stepped_explicitly(tmp_path):
    drive, k3 = DRIVES["several frequencies"], 4e12
    found, steps = simulated(f"kind = 'stiffening'\nk3 = '{k3} N/m^3'", drive, tmp_path)
    assert isinstance(steps, exponential.Exponential)
    wanted = stepped(lambda z, v: -k3 * z**3, drive, 100)
    effect = wanted - stepped(nothing, drive, 100)
    assert np.sqrt(np.mean((found - wanted) ** 2)) < 1e-3 * np.sqrt(np.mean(effect**2))


def test_a_standing_stage_stays_where_friction_holds_it(tmp_path):
    """Below the force of friction it creeps at the speed at which tanh gives that force, and no faster."""
    force, speed, push = 0.5, 0.01e-3, 0.3
    drive = np.full(N, push / MOTOR)
    found, _ = simulated(f"kind = 'coulomb'\nforce = '{force} N'\nsmoothing = '{speed} m/s'", drive, tmp_path)
    creeping = np.arctanh((push - STIFFNESS * found[-1]) / force) * speed
    assert 0 < found[-1] < push / STIFFNESS
    assert (found[-1] - found[-2]) / H == pytest.approx(creeping, rel=1e-3)
