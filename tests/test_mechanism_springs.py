"""Springs of a mechanism: closed forms, cubic ones whose freedom no actuator holds, and what is refused."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from mechanism_files import HEAD, PARALLELOGRAM, TWO_BODIES, chain, dm, loaded, spring, with_values
from scipy.optimize import brentq

from ctrlgen import InputError, build_model, load_scenario, run, solve
from ctrlgen.devices.mechanism.condensed import Condensed
from ctrlgen.devices.mechanism.constraints import freedoms
from ctrlgen.model.assembly import movable

K_BLADES = 24 * 130e9 * 8e-3 * 0.2e-3**3 / 12 / 20e-3**3  # of the parallelogram's two blades


def with_spring(numbers: str, at: str = "-10") -> str:
    return PARALLELOGRAM.replace("[[actuator]]", spring(numbers, at=at) + "[[actuator]]")


def test_a_spring_beside_the_blades_adds_its_stiffness_and_holds_no_freedom(tmp_path):
    device = loaded(tmp_path, with_spring('F_x_per_delta_x = "5 N/mm"'))
    c = Condensed(*with_values(device))
    assert dm(c.stiffness)[0, 0] == pytest.approx(K_BLADES + 5000, rel=1e-9)
    assert freedoms(device) == freedoms(loaded(tmp_path, PARALLELOGRAM)) == (1, 1)


def test_six_stiffnesses_alone_hold_a_body_and_are_those_at_its_point(tmp_path):
    numbers = "\n".join(
        f'F_{a}_per_delta_{a} = "{k} N/mm"\nM_{a}_per_theta_{a} = "{k} N*m/rad"'
        for a, k in zip("xyz", (1, 2, 3), strict=True)
    )
    rest = PARALLELOGRAM[PARALLELOGRAM.index("[[actuator]]") :]
    device = loaded(tmp_path, f'{HEAD}[[body]]\nname = "stage"\n{spring(numbers)}{rest}')
    C = dm(Condensed(*with_values(device)).output_compliance)  # twist per (F; M)
    wanted = np.zeros((6, 6))
    for i, k in enumerate((1, 2, 3)):
        wanted[i, 3 + i], wanted[3 + i, i] = 1 / k, 1 / (k * 1e3)
    assert pytest.approx(wanted, abs=1e-12) == C
    with pytest.raises(InputError) as caught:
        loaded(tmp_path, f'{HEAD}[[body]]\nname = "stage"\n{spring(numbers[: numbers.index("M_z")])}{rest}')
    assert "springs leave stage free in some direction" in str(caught.value)


def test_a_cubic_spring_where_the_actuator_pushes_is_its_own_law(tmp_path):
    """F = (K + k_1) d + k_3 d^3, solved for the drive at the end of a line."""
    text = with_spring('F_x_per_delta_x = "1 N/mm"\nF_x_per_delta_x3 = "2e-5 N/um^3"')
    device = loaded(tmp_path, text)
    model = build_model(device)
    force = ca.Function("force", [model.z], [device.physics(device.values()).restoring_force(model.z)])
    d = 80e-6
    wanted = (K_BLADES + 1e3) * d + 2e13 * d**3
    assert float(force(d)) == pytest.approx(wanted, rel=1e-9) and 2e13 * d**3 > wanted / 2
    (tmp_path / "scenario.toml").write_text(
        'title = "t"\ndevice = "device.toml"\nsample_rate = "1 kHz"\nduration = "0.1 s"\n'
        '[path]\nkind = "line"\nstart = { delta_x = "-20 um" }\nend = { delta_x = "40 um" }\n'
    )
    solution = solve(load_scenario(tmp_path), model)
    assert solution.drive[-1, 0] == pytest.approx(((K_BLADES + 1e3) * 40e-6 + 2e13 * 40e-6**3) / 2, rel=1e-9)
    assert set(model.force_parts) == {"linear", "cubic"}


@pytest.mark.long
def test_c_of_a_cubic_spring_beside_the_push_computes_what_the_model_does(tmp_path):
    """3 mm below the stage, and not at the coil: the stage turns a little under its force."""
    device = with_spring('F_x_per_delta_x = "1 N/mm"\nF_x_per_delta_x3 = "2e-5 N/um^3"', at="-3")
    assert loaded(tmp_path, device).cubic_steps > 0
    (tmp_path / "scenario.toml").write_text(
        'title = "t"\ndevice = "device.toml"\nsample_rate = "1 kHz"\nduration = "20 ms"\n'
        '[path]\nkind = "line"\nstart = { delta_x = "-20 um" }\nend = { delta_x = "40 um" }\n'
    )
    outcome = run(tmp_path, tmp_path / "out")
    assert outcome.passed


def test_a_cubic_spring_on_a_freedom_that_no_actuator_holds_is_solved_exactly(tmp_path):
    """k_a a + k_3 a^3 = k_b (b - a), by bracketing; force and pose follow from a."""
    k_a, k_b, k_3 = 1 / 0.5e-6, 1 / 0.2e-6, 6e15
    device = loaded(tmp_path, chain('F_x_per_delta_x3 = "6e-3 N/um^3"'))
    physics = device.physics(device.values())
    d = ca.SX.sym("d")
    f = ca.Function("f", [d], [physics.restoring_force(d), physics.pose(d)])
    for b in (-50e-6, -7e-6, 1e-9, 20e-6, 50e-6):
        a = brentq(lambda a, b=b: k_a * a + k_3 * a**3 - k_b * (b - a), -60e-6, 60e-6, xtol=1e-20, rtol=1e-15)
        force, pose = (float(v) for v in f(b))
        assert pose == pytest.approx(a, rel=1e-12) and force == pytest.approx(k_b * (b - a), rel=1e-10)
    assert 3 * k_3 * a**2 > k_a + k_b  # far from linear: there it is stiffer than what stands beside it


def test_the_force_of_cubic_springs_comes_from_one_energy(tmp_path):
    """Two axes and two cubic springs between them and beside: the slope of the restoring force is symmetric."""
    second = (
        '[[actuator]]\nname = "other"\nkind = "force"\non = "a"\nat = ["0 mm", "3 mm", "0 mm"]\nalong = [0, 1, 0]\n'
        'gain = "1 N/V"\nlow = "-9 V"\nhigh = "9 V"\ntravel = "50 um"\n'
    )
    text = chain('F_x_per_delta_x3 = "2e-3 N/um^3"\nalong = [1, 2, 0]')
    text = text.replace(
        "[output]",
        second + spring('M_x_per_theta_x3 = "9e9 N*m/rad^3"\nalong = [0, 0, 1]', "a", "b", "5", "twist") + "[output]",
    )
    text = text.replace('channels = ["delta_x"]', 'channels = ["delta_x", "delta_y"]')
    device = loaded(tmp_path, text)
    physics, d = device.physics(device.values()), ca.SX.sym("d", 2)
    slope = ca.Function("slope", [d], [ca.jacobian(physics.restoring_force(d), d)])
    K, home = slope([30e-6, -20e-6]).full(), slope([0, 0]).full()
    assert home[0, 1] == 0 and K[0, 1] > 0.05 * np.sqrt(K[0, 0] * K[1, 1])
    assert K[0, 1] == pytest.approx(K[1, 0], rel=1e-7)


def test_a_cubic_spring_beside_prescribed_displacements_bends_the_pose(tmp_path):
    """The element k_a is stretched by s; body b hangs on it behind k_b, which a cubic spring to the ground loads."""
    move = (
        '[[actuator]]\nname = "stroke"\nkind = "displacement"\non = "k_a"\nalong = [1, 0, 0]\ngain = "1 um/V"\nlow = "0 V"\n'
        'high = "50 V"\ntravel = "50 um"\n[output]\nbody = "b"\nat = ["10 mm", "0 mm", "0 mm"]\nchannels = ["delta_x"]\n'
    )
    text = TWO_BODIES + spring('F_x_per_delta_x3 = "1e-3 N/um^3"', to="b") + move
    device = loaded(tmp_path, text)
    physics, d = device.physics(device.values()), ca.SX.sym("d")
    pose, s = float(ca.Function("pose", [d], [physics.pose(d)])(40e-6)), 40e-6
    C = 0.5e-6 + 0.2e-6
    assert pose == pytest.approx(brentq(lambda b: b + C * 1e15 * b**3 - s, 0, s, xtol=1e-20, rtol=1e-15), rel=1e-11)


def test_every_number_of_a_cubic_spring_may_be_free(tmp_path):
    device = loaded(tmp_path, chain('F_x_per_delta_x = "0.1 N/um"\nF_x_per_delta_x3 = "3e-3 N/um^3"'))
    free = movable(device)
    assert "element[2].F_x_per_delta_x3" in free and "element[2].F_x_per_delta_x" in free
    model, fixed = build_model(device, free=free), build_model(device)
    pose = [ca.Function("p", [m.z, m.p], [m.signals["pose"].expr])(30e-6, m.p_nominal) for m in (model, fixed)]
    assert float(pose[0]) == pytest.approx(float(pose[1]), rel=1e-12)


@pytest.mark.parametrize(
    ("numbers", "says"),
    [
        ("along = [1, 0, 0]", "gives no stiffness; add one"),
        ('F_x_per_delta_x = "-5 N/mm"', "F_x_per_delta_x"),
        ('F_x_per_delta_x3 = "5 N/mm"', "has the wrong unit: N/um^3"),
        ('F_x_per_delta_x3 = "-1e-3 N/um^3"', "soften"),
    ],
)
def test_a_spring_that_cannot_be_is_refused(tmp_path, numbers, says):
    with pytest.raises(InputError) as caught:
        build_model(loaded(tmp_path, chain(numbers)))
    assert says in str(caught.value)
