"""Geometric stiffening of mechanisms: stretching, beam-columns and buckling against closed forms and geometrically exact beams."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from exact_joints import ExactJoints, jointed
from held_blades import EA, EI, STIFFENS, E, L, T, W, guided, held, stretched
from mechanism_files import HEAD, PARALLELOGRAM, REST, SILICON, blade, dm, loaded, with_values

from ctrlgen import InputError, build_model, load_scenario, run, solve
from ctrlgen.devices.mechanism.condensed import Condensed
from ctrlgen.devices.mechanism.second_order import SecondOrder
from ctrlgen.model.assembly import movable


def force_law(device) -> ca.Function:
    """d -> the whole force on the axes."""
    physics, d = device.physics(device.values()), ca.SX.sym("d", len(device.placed_actuators))
    return ca.Function("force", [d], [physics.restoring_force(d)])


def free(p: float) -> float:
    """The same of a beam with one free end, which buckles at -pi^2/4."""
    z = np.sqrt(complex(p))
    return float((p * z / (z - np.tanh(z))).real)


def test_a_beam_with_held_ends_stretches_by_the_known_cubic(tmp_path):
    """12 E I y/l^3 + (18/25) E A y^3/l^3 of each: P = E A 0.6 y^2/l^2, 1.2 P y/l, less a share 0.3 (y/t)^2 that is seen at y = t/20."""
    device = loaded(tmp_path, held())
    d, y = force_law(device), 10e-6
    linear = 24 * EI / L**3
    assert float(d(1e-9)) == pytest.approx(linear * 1e-9, rel=1e-6)
    assert float(d(y)) - linear * y == pytest.approx(2 * 0.72 * EA * y**3 / L**3, rel=1e-3)


def test_a_beam_with_held_ends_pulls_as_the_beam_column_does_up_to_seven_thicknesses(tmp_path):
    """Against the beam whose shape the tension changes too; the cubic alone is 1 % off at a thickness and 9 % at two."""
    law = force_law(loaded(tmp_path, held()))
    for share, off in ((0.5, 2e-4), (1.0, 5e-4), (2.0, 1e-3), (7.0, 0.01)):
        assert float(law(share * T)) == pytest.approx(2 * stretched(share * T), rel=off)


def test_held_blades_pull_as_geometrically_exact_beams_do(tmp_path):
    pytest.importorskip("exudyn", reason="no Exudyn to compare with: pip install ctrlgen[plant]")
    from exact_mechanism import ExactMechanism

    device = loaded(tmp_path, held())
    law, plant = force_law(device), ExactMechanism(device, 16)
    for y, off in ((0.25 * T, 3e-4), (0.5 * T, 2e-3), (T, 5e-3)):
        force = float(law(y))
        reached = plant.travel(plant.pushed([force], steps=10))[0]
        assert float(law(reached)) == pytest.approx(force, rel=off)
    assert force > 1.7 * 24 * EI / L**3 * T  # most of it is the stretching


def test_a_stage_whose_blades_may_come_nearer_does_not_stiffen(tmp_path):
    """Of the elastica's (36/35) (y/l)^2, of the bending alone, nothing is kept; the stretching cancels to rounding."""
    device = loaded(tmp_path, PARALLELOGRAM.replace(blade("left", -10), blade("left", -10) + STIFFENS))
    y = 300e-6
    assert float(force_law(device)(y)) == pytest.approx(24 * EI / L**3 * y, rel=0.1 * (y / L) ** 2)


WIRE = 'kind = "wire"\nslender = true\ndiameter = "0.2 mm"\n'


def column(wires: int, flexure: str = WIRE, across: str = "[1, 0, 0]") -> str:
    """A body on one flexure, or guided by two, pushed across and along: d = (across, along)."""
    text = HEAD + SILICON + '[[body]]\nname = "stage"\n'
    for k in range(wires):
        text += (
            f'[[element]]\n{flexure}name = "wire{k}"\nfrom = "ground"\nto = "stage"\n'
            f'at = ["{20 * k - 10 * (wires - 1)} mm", "0 mm", "0 mm"]\n'
            f'along = [0, 1, 0]\nacross = {across}\nlength = "20 mm"\nmaterial = "silicon"\n{STIFFENS}'
        )
    at = f'["0 mm", "{-10 * (wires - 1)} mm", "0 mm"]'
    for name, along in (("across", "[1, 0, 0]"), ("along", "[0, 1, 0]")):
        text += (
            f'[[actuator]]\nname = "{name}"\nkind = "force"\non = "stage"\nat = {at}\nalong = {along}\ngain = "1 N/V"\nlow = "-9 V"\n'
            'high = "9 V"\ntravel = "20 um"\n'
        )
    return text + '[output]\nbody = "stage"\nat = ["0 mm", "0 mm", "0 mm"]\nchannels = ["delta_x", "delta_y"]\n'


@pytest.mark.parametrize(
    ("wires", "exact", "series"), [(1, free, (3, 1.2, -1 / 175)), (2, guided, (12, 1.2, -1 / 700))]
)
def test_an_axial_load_stiffens_and_softens_as_a_beam_column(tmp_path, wires, exact, series):
    """12 + 6 p/5 - p^2/700 of Awtar's beams, and of a free end 3 + 6 p/5 - p^2/175: within their third order of the beam-column."""
    bending, area = E * np.pi * 0.2e-3**4 / 64, E * np.pi * 0.2e-3**2 / 4
    device, d = loaded(tmp_path, column(wires)), ca.SX.sym("d", 2)
    K = ca.Function("K", [d], [ca.jacobian(force_law(device)(d), d)])
    for p in (-2.0, -0.5, 0.5, 2.0):
        across = K([0.0, p * bending / (L * area)]).full()[0, 0] * L**3 / bending / wires
        assert across == pytest.approx(np.polyval(series[::-1], p), abs=5e-4)
        assert across == pytest.approx(exact(p), abs=3e-4 * abs(p) ** 3 + 5e-4)
    assert across - series[0] == pytest.approx(2.4, rel=0.02)


@pytest.mark.parametrize(
    ("flexure", "across", "bending", "area"),
    [
        (WIRE, "[1, 0, 0.7]", np.pi * T**4 / 64, np.pi * T**2 / 4),
        (
            'kind = "blade"\nslender = true\nthickness = "0.2 mm"\nwidth = "0.4 mm"\n',
            "[1, 0, 0]",
            2 * T**4 / 12,
            2 * T**2,
        ),
        (
            'kind = "blade"\nslender = true\nthickness = "0.2 mm"\nwidth = "0.4 mm"\n',
            "[0, 0, 1]",
            8 * T**4 / 12,
            2 * T**2,
        ),
    ],
)
def test_an_axial_load_stiffens_in_both_planes_of_a_flexure(tmp_path, flexure, across, bending, area):
    """3 + 6 p/5 - p^2/175 of a free end, pushed across the thickness or the width of a blade, or askew to the frame of a wire;
    the load changes its length by p EI/(EA l^2), 7e-5 at most, and the stiffness by three to ten times as much."""
    device, d = loaded(tmp_path, column(1, flexure, across)), ca.SX.sym("d", 2)
    K = ca.Function("K", [d], [ca.jacobian(force_law(device)(d), d)])
    for p in (-2.0, 2.0):
        stiffness = K([0.0, p * bending / (L * area)]).full()[0, 0] * L**3 / (E * bending)
        assert stiffness == pytest.approx(3 + 1.2 * p - p**2 / 175, abs=1e-3)


def test_an_axial_load_bends_the_length_that_it_stretches_to(tmp_path):
    """Of an extensible beam P and F act on (1 + e) l, e = P/EA: F l^3/(EI y) = 3 + (6/5 - 6 EI/(EA l^2)) p + ..., 1.12 for a blade that is
    pushed in its plane, w = 0.4 l. Source: E. Reissner, Z. Angew. Math. Phys. 23 (1972) 795, without shear."""
    flexure = 'kind = "blade"\nslender = true\nthickness = "0.2 mm"\nwidth = "8 mm"\n'
    device, d = loaded(tmp_path, column(1, flexure, "[0, 0, 1]")), ca.SX.sym("d", 2)
    K = ca.Function("K", [d], [ca.jacobian(force_law(device)(d), d)])
    share = W**2 / (12 * L**2)  # EI/(EA l^2)
    rises = [K([0.0, p * share * L]).full()[0, 0] * L**3 / (E * T * W**3 / 12) for p in (0.1, -0.1)]
    assert (rises[0] - rises[1]) / 0.2 == pytest.approx(1.2 - 6 * share, rel=1e-6)


def test_the_force_of_an_actuator_on_an_arm_turns_with_its_lever(tmp_path):
    """On an arm of length r that turns by theta about a pivot of stiffness k and is pushed at its end, almost along the arm, the travel is
    r (cos a sin theta - sin a (1 - cos theta)). Of k theta^2/2 the fourth order is k (5/8 tan^2 a + 1/6) (d/(r cos a))^4; the 1/6,
    which is of the arm's third order, is what is left out."""
    a, r = np.radians(80), 10e-3
    pivot = "".join(f'theta_{x}_per_M_{x} = "{1 if x == "z" else 1e-6} rad/(N*m)"\n' for x in "xyz")
    pivot += "".join(f'delta_{x}_per_F_{x} = "1e-6 um/N"\n' for x in "xyz")
    push = f'at = ["10 mm", "0 mm", "0 mm"]\nalong = [{-np.sin(a)}, {np.cos(a)}, 0]'
    rest = REST.replace('at = ["0 mm", "0 mm", "0 mm"]\nalong = [1, 0, 0]', push).replace("delta_x", "theta_z")
    for side in (1, -1):
        text = (
            HEAD
            + '[[body]]\nname = "plate"\n[[element]]\nkind = "compliance"\nname = "pivot"\nfrom = "ground"\nto = "plate"\n'
        )
        text += 'at = ["0 mm", "0 mm", "0 mm"]\n' + pivot + rest.replace(f"[{-np.sin(a)}", f"[{-side * np.sin(a)}")
        s = SecondOrder(Condensed(*with_values(loaded(tmp_path, text))))
        turned = 1 / (r * np.cos(a))  # rad/m
        assert dm(s.cubic)[0, 0] == pytest.approx(-side * np.tan(a) / 2 * turned**3, rel=1e-4)
        assert dm(s.quartic)[0, 0] == pytest.approx(5 / 8 * np.tan(a) ** 2 * turned**4, rel=1e-4)


@pytest.mark.parametrize("direction", [[1.0, 0.0], [0.0, 1.0], [0.8, -0.5], [0.5, 0.9]])
def test_the_energy_of_joints_and_the_motion_of_their_bodies_are_those_of_finite_rotations(tmp_path, direction):
    """Order by order, from equilibria at finite travels of both signs; what is of third order in deformations and travels is left out."""
    c = Condensed(*with_values(loaded(tmp_path, jointed())))
    s, exact, d = SecondOrder(c), ExactJoints(c), np.array(direction) * 1e-3
    products = dm(s.products(ca.DM(d))).ravel()
    (first, second), V = exact.orders(d)
    assert first == pytest.approx(np.concatenate([dm(T) @ d for T in c.twists]), rel=1e-6, abs=1e-9)
    assert np.concatenate([dm(T) @ products for T in s.twists]) == pytest.approx(
        second, abs=1e-5 * np.abs(second).max()
    )
    assert V[0] == pytest.approx(d @ dm(c.stiffness) @ d / 2, rel=1e-8)
    assert V[1] == pytest.approx(d @ dm(s.cubic) @ products, rel=1e-5)
    left_out = exact.of_third_order(first, dm(c.stiffness) @ d)
    assert V[2] == pytest.approx(products @ dm(s.quartic) @ products + left_out, rel=1e-4)


def test_force_and_pose_of_a_held_stage_come_from_one_energy(tmp_path):
    """Slope of the restoring force: symmetric to rounding, with an axis along the blades too."""
    device, d = loaded(tmp_path, column(2)), ca.SX.sym("d", 2)
    K = ca.Function("K", [d], [ca.jacobian(force_law(device)(d), d)])([60e-6, 2e-6]).full()
    assert abs(K[0, 1]) > 0.1 * K[0, 0] and K[0, 1] == pytest.approx(K[1, 0], rel=1e-9)


@pytest.mark.long
def test_a_held_stage_is_solved_and_its_c_is_the_model(tmp_path):
    """The drive at the end of a line is that of the beam-column, at nearly twice the linear force."""
    (tmp_path / "device.toml").write_text(held())
    (tmp_path / "scenario.toml").write_text(
        'title = "t"\ndevice = "device.toml"\nsample_rate = "1 kHz"\nduration = "20 ms"\n'
        '[path]\nkind = "line"\nstart = { delta_x = "-100 um" }\nend = { delta_x = "235 um" }\n'
    )
    device = loaded(tmp_path, held().replace('high = "1 A"', 'high = "3 A"'))
    solution, y = solve(load_scenario(tmp_path), build_model(device)), 235e-6
    wanted = 2 * stretched(y)
    assert solution.drive[-1, 0] == pytest.approx(wanted / 2, rel=1e-3) and wanted > 1.95 * 24 * EI / L**3 * y
    assert run(tmp_path, tmp_path / "out").passed


def test_a_thickness_may_be_free(tmp_path):
    """The slope of the stretching by the thickness: E A grows with it, and the linear force with its cube."""
    device = loaded(tmp_path, held())
    names = tuple(name for name in movable(device) if name.endswith("thickness"))
    model, y = build_model(device, free=names), 20e-6
    part = ca.Function("part", [model.z, model.p], [model.force_parts["geometric"]])
    at = [float(part(y, s * np.array(model.p_nominal))) for s in (1.0, 1.1)]
    assert at[1] / at[0] == pytest.approx(1.1, rel=1e-3)


def test_stiffening_beside_prescribed_displacements_is_refused(tmp_path):
    text = held().replace(
        'kind = "force"\non = "stage"\nat = ["0 mm", "0 mm", "0 mm"]', 'kind = "displacement"\non = "left"'
    )
    with pytest.raises(InputError) as caught:
        loaded(tmp_path, text.replace('gain = "2 N/A"', 'gain = "2 um/A"'))
    assert "geometric_stiffening: of right has no effect where actuators prescribe displacements" in str(caught.value)


def test_stiffening_of_first_order_is_refused(tmp_path):
    with pytest.raises(InputError, match="geometric_stiffening of right is of second order"):
        loaded(tmp_path, 'kinematics = "first_order"\n' + held())


def test_the_energy_of_fourth_order_has_no_negative_stretching(tmp_path):
    """V_4 of a stage that is held by two blades is positive: stretching takes energy."""
    s = SecondOrder(Condensed(*with_values(loaded(tmp_path, held()))))
    assert dm(s.quartic)[0, 0] == pytest.approx(0.36 * EA / L**3, rel=1e-3)
