"""Mechanisms from files: closed forms, one frame written twice, and what is refused."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from command_line import ctrlgen as run_command
from conftest import DEVICE
from mechanism_files import HEAD, PARALLELOGRAM, REST, SILICON, SPRING, TWO_BODIES, dm, loaded, vector, with_values

from ctrlgen import InputError, build_model, load_scenario, solve
from ctrlgen.devices.mechanism.condensed import Condensed
from ctrlgen.model.assembly import movable
from ctrlgen.physics.flexure import rectangular_section


def test_a_parallelogram_has_the_stiffness_and_stress_of_the_textbook(tmp_path):
    """Two clamped-guided blades, 12 E I / l^3 each, pushed at their middle height, where their axial stiffness is not asked for;
    M = 6 E I d / l^2 at the ends."""
    c = Condensed(*with_values(loaded(tmp_path, PARALLELOGRAM)))
    E, l, t, w = 130e9, 20e-3, 0.2e-3, 8e-3
    I = w * t**3 / 12
    assert dm(c.stiffness)[0, 0] == pytest.approx(24 * E * I / l**3, rel=1e-9)
    assert dm(c.jacobian)[0, 0] == pytest.approx(1.0, rel=1e-9)
    names, stress = c.stress("silicon", ca.DM(50e-6), 0.3)
    assert names == ("left_free_end", "left_fixed_end", "right_free_end", "right_fixed_end")
    assert dm(stress).ravel() == pytest.approx(np.full(4, 6 * E * I / l**2 / (w * t**2 / 6) * 50e-6), rel=1e-6)


def test_a_mechanism_is_solved_and_its_stress_limit_kept(tmp_path):
    device = loaded(tmp_path, PARALLELOGRAM)
    (tmp_path / "scenario.toml").write_text(
        'title = "t"\ndevice = "device.toml"\nsample_rate = "1 kHz"\nduration = "0.1 s"\n'
        '[path]\nkind = "line"\nend = { delta_x = "80 um" }\n'
    )
    model = build_model(device)
    solution = solve(load_scenario(tmp_path), model)
    K = 24 * 130e9 * 8e-3 * 0.2e-3**3 / 12 / 20e-3**3
    assert solution.drive[-1, 0] == pytest.approx(K * 80e-6 / 2, rel=1e-9)
    stress = {m.limit.name: m.value for m in solution.margins}["stress_silicon"]
    assert stress == pytest.approx(3 * 130e9 * 0.2e-3 / (20e-3) ** 2 * 80e-6, rel=1e-6)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('to = "stage"', 'to = "stag"', "element[0].to: 'stag' is no body"),
        ('material = "silicon"', 'material = "glass"', "element[0].material: 'glass' is no material"),
        ('name = "right"', 'name = "left"', "element: 'left' is named twice"),
        ("along = [0, 1, 0]\nacross = [-1, 0, 0]", "along = [0, 1, 0]\nacross = [0, 2, 0]", "is parallel to along"),
        ('gain = "2 N/A"', 'gain = "2 N/V"', "is no force per drive in A"),
        ('low = "-1 A"', 'low = "2 A"', "low = '2 A' is not below high"),
        ('channels = ["delta_x"]', 'channels = ["delta_x", "theta_z"]', "2 channels, 1 actuator"),
        ('body = "stage"', 'body = "table"', "output.body: 'table' is no body"),
        (
            '[[body]]\nname = "stage"',
            '[[body]]\nname = "stage"\n[[body]]\nname = "free"',
            "nothing joins free to the ground",
        ),
        ('width = "8 mm"', 'width = "0.1 mm"', "thickness = '0.2 mm' is above width = '0.1 mm'"),
        ('channels = ["delta_x"]', 'channels = ["delta_z"]', "no actuator moves delta_z"),
        ('name = "coil"', 'name = "coil"\npattern = "arm"', "actuator[0].pattern: 'arm' is no pattern"),
        (
            'travel = "300 um"',
            'travel = "300 um"\ntime_constant = "1 ms"\n[[actuator]]\nname = "b"\nkind = "force"\non = "stage"\n'
            'at = ["0 mm", "0 mm", "0 mm"]\nalong = [0, 1, 0]\ngain = "2 N/A"\nlow = "-1 A"\nhigh = "1 A"\ntravel = "300 um"',
            "actuator: some have a time_constant and some do not",
        ),
        ('to = "stage"\nat', 'too = "stage"\nat', "did you mean 'to'"),
        ('from = "ground"', 'form = "ground"', "did you mean 'from'"),
    ],
)
def test_what_does_not_fit_together_is_said(tmp_path, old, new, says):
    assert old in PARALLELOGRAM
    with pytest.raises(InputError) as caught:
        loaded(tmp_path, PARALLELOGRAM.replace(old, new))
    assert says in str(caught.value)


def test_a_mechanism_without_an_actuator_is_refused(tmp_path):
    pushed = PARALLELOGRAM[PARALLELOGRAM.index("[[actuator]]") : PARALLELOGRAM.index("[output]")]
    text = PARALLELOGRAM.replace(pushed, "").replace('name = "m"', 'name = "m"\nactuator = []')
    with pytest.raises(InputError) as caught:
        loaded(tmp_path, text)
    assert "actuator: there is none; add a [[actuator]] table" in str(caught.value)


def test_a_pattern_is_the_same_as_the_copies_written_out(tmp_path):
    text = (DEVICE.parent / "tip_tilt_mirror.toml").read_text()
    device = loaded(tmp_path, text)
    assert device.bodies == ("mirror", "head_1", "head_2", "head_3")
    C = dm(Condensed(*with_values(device)).output_compliance)
    T = np.array(
        [
            [np.cos(2 * np.pi / 3), -np.sin(2 * np.pi / 3), 0],
            [np.sin(2 * np.pi / 3), np.cos(2 * np.pi / 3), 0],
            [0, 0, 1],
        ]
    )
    turned = np.kron(np.eye(2), T)
    # The frame has three legs: it is the same after a third of a turn
    assert np.abs(turned @ C @ turned.T - C).max() < 1e-9 * np.abs(C).max()
    angles = 'name = "leg"\ntimes = 3\nangles = ["0 deg", "120 deg", "240 deg"]'
    same = loaded(tmp_path, text.replace('name = "leg"\ntimes = 3', angles, 1))
    assert np.abs(dm(Condensed(*with_values(same)).output_compliance) - C).max() < 1e-12 * np.abs(C).max()
    with pytest.raises(InputError) as caught:
        loaded(tmp_path, text.replace('name = "leg"\ntimes = 3', angles.replace("3", "4", 1), 1))
    assert "has 3 for 4 copies" in str(caught.value)


def test_every_number_of_a_mechanism_may_be_free(tmp_path):
    """The model with all its numbers as symbols is that with their values, and its slope by one is a difference of two."""
    device = loaded(tmp_path, (DEVICE.parent / "xy_lever_stage.toml").read_text())
    free = movable(device)
    thickness = next(path for path in free if path.endswith("thickness"))
    model = build_model(device, free=free)
    pose = ca.Function(
        "pose", [model.z, model.p], [model.signals["pose"].expr, ca.jacobian(model.signals["pose"].expr, model.p)]
    )
    z, k = np.array([1e-5, 2e-5]), free.index(thickness)
    fixed = build_model(device)
    fixed_pose = ca.Function("pose", [fixed.z], [fixed.signals["pose"].expr])
    # The pose is 70 um: rounding, another order of sums
    assert np.abs((pose(z, model.p_nominal)[0] - fixed_pose(z)).full()).max() < 1e-16
    step = 1e-6 * model.p_nominal[k]
    ends = []
    for side in (-1, 1):
        p = model.p_nominal.copy()
        p[k] += side * step
        ends.append(pose(z, p)[0].full())
    slope = pose(z, model.p_nominal)[1].full()[:, [k]]
    assert np.abs((ends[1] - ends[0]) / (2 * step) - slope).max() < 1e-4 * np.abs(slope).max()


@pytest.mark.long
def test_check_describes_and_draws_a_mechanism(tmp_path):
    said = run_command("check", DEVICE.parent / "tip_tilt_mirror.toml", "--figure", tmp_path / "mirror.svg")
    assert (
        said.returncode == 0
        and "4 bodies, 6 flexures, 3 actuators" in said.stdout
        and "natural frequencies" in said.stdout
    )
    drawn = (tmp_path / "mirror.svg").read_text()
    assert all(name in drawn for name in ("wire_2", "stack_3", "head_1", "leg_3", "output point"))
    refused = run_command("check", DEVICE, "--figure", tmp_path / "hexapod.svg")
    assert refused.returncode == 1 and 'only kind = "mechanism" is drawn' in refused.stderr
    assert not (tmp_path / "hexapod.svg").exists()


def test_a_mechanism_read_twice_is_the_same_device_and_both_build_a_model(tmp_path):
    text = (DEVICE.parent / "xy_lever_stage.toml").read_text()
    first = loaded(tmp_path, text)
    build_model(first)
    second = loaded(tmp_path, text)
    assert first == second and hash(first) == hash(second)
    assert build_model(second).signals["pose"].channels == ("delta_x", "delta_y")
    assert loaded(tmp_path, text.replace("25 N/um", "26 N/um")) != first


OUTPUT_B = '[output]\nbody = "b"\nat = ["10 mm", "0 mm", "0 mm"]\nchannels = ["delta_x"]\n'


def test_a_force_between_two_bodies_loads_the_flexure_between_them_alone(tmp_path):
    """F on b and -F on a: a stays, b moves by F/k_b, and so do they relative to each other."""
    push = (
        '[[actuator]]\nname = "stack"\nkind = "force"\non = "b"\nagainst = "a"\nat = ["10 mm", "0 mm", "0 mm"]\nalong = [1, 0, 0]\n'
        'gain = "1 N/V"\nlow = "0 V"\nhigh = "1 V"\ntravel = "50 um"\n'
    )
    c = Condensed(*with_values(loaded(tmp_path, TWO_BODIES + push + OUTPUT_B)))
    assert dm(c.stiffness)[0, 0] == pytest.approx(1 / 0.2e-6, rel=1e-9)
    assert dm(c.jacobian)[0, 0] == pytest.approx(1.0, rel=1e-9)
    assert np.abs(dm(c.twists[0])).max() < 1e-12


def test_a_displacement_between_two_bodies_is_shared_by_the_springs_at_both(tmp_path):
    """The element stretches by d without load: b moves by k_b d/(k_b + k_c + k_b k_c/k_a), a by k_c/k_a of that, the other way."""
    grounded = SPRING.format(name="k_c", first="ground", to="b", x=20, c=0.1)
    move = (
        '[[actuator]]\nname = "stroke"\nkind = "displacement"\non = "k_b"\nalong = [1, 0, 0]\ngain = "1 um/V"\nlow = "0 V"\n'
        'high = "50 V"\ntravel = "50 um"\n'
    )
    c = Condensed(*with_values(loaded(tmp_path, TWO_BODIES + grounded + move + OUTPUT_B)))
    k_a, k_b, k_c = 1 / 0.5e-6, 1 / 0.2e-6, 1 / 0.1e-6
    b = k_b / (k_b + k_c + k_b * k_c / k_a)
    assert dm(c.twists[1])[3, 0] == pytest.approx(b, rel=1e-9)
    assert dm(c.twists[0])[3, 0] == pytest.approx(-b * k_c / k_a, rel=1e-9)


def test_the_stress_at_a_clamped_end_is_that_of_both_bendings_tension_and_torsion(tmp_path):
    """A force (1, 1, 1) N 3 mm above the tip of a cantilever 20 mm long: at its root M = (-3, 3 - 20, 20) mN m, N = 1 N."""
    device = """[[body]]
name = "plate"
[[element]]
kind = "{kind}"
name = "beam"
from = "ground"
to = "plate"
at = ["20 mm", "0 mm", "0 mm"]
length = "20 mm"
{section}
material = "silicon"
"""
    push = REST.replace(
        'at = ["0 mm", "0 mm", "0 mm"]\nalong = [1, 0, 0]', 'at = ["20 mm", "0 mm", "3 mm"]\nalong = [1, 1, 1]', 1
    )
    text = HEAD + SILICON + device + push
    T, M_y, M_z = -3e-3, 3e-3 - 20e-3, 20e-3
    t, w = 1e-3, 4e-3
    corner = abs(M_y) * 6 / (t * w**2) + M_z * 6 / (w * t**2) + 1 / (t * w)
    tau = abs(T) / (0.282 * w * t**2)  # Timoshenko's table of torsion of bars: 0.282 at w/t = 4
    r = 0.5e-3
    round_bending = 4 * np.hypot(M_y, M_z) / (np.pi * r**3) + 1 / (np.pi * r**2)
    for kind, section, wanted in (
        ("blade", 'thickness = "1 mm"\nwidth = "4 mm"', np.hypot(corner, np.sqrt(3) * tau)),
        ("wire", 'diameter = "1 mm"', np.hypot(round_bending, np.sqrt(3) * 2 * T / (np.pi * r**3))),
    ):
        c = Condensed(*with_values(loaded(tmp_path, text.format(kind=kind, section=section))))
        d = np.sqrt(3) / dm(c.stiffness)[0, 0]
        names, stress = c.stress("silicon", ca.DM(d), 0.3)
        assert dm(stress)[names.index("beam_fixed_end"), 0] == pytest.approx(wanted, rel=1e-3)  # digits of the table


@pytest.mark.parametrize(("r", "factor"), [(1.0, 0.208), (0.5, 0.246), (0.25, 0.282), (0.1, 0.313)])
def test_the_torsion_modulus_of_a_rectangle_is_that_of_timoshenkos_table(r, factor):
    assert rectangular_section(r, 1.0)[3] / r**2 == pytest.approx(factor, abs=0.001)  # three digits are given


def test_a_channel_has_the_same_scale_whether_numbers_are_free_or_not(tmp_path):
    device = loaded(tmp_path, (DEVICE.parent / "tip_tilt_mirror.toml").read_text())
    fixed, free = build_model(device), build_model(device, free=movable(device))
    assert fixed.signals["pose"].scale == free.signals["pose"].scale == device.channel_scale
    J = dm(Condensed(*with_values(device)).jacobian)
    travel = max(a.travel.si for a in device.actuator)
    assert device.channel_scale == pytest.approx(np.abs(J).sum(axis=1) * travel)


def test_a_mirrored_half_is_the_same_as_both_halves_written_out(tmp_path):
    """A body on two slanted blades and two matrices without symmetry, image of each other in the plane x = 0."""
    skew = np.diag([1.0, 2.0, 3.0, 1e-6, 2e-6, 3e-6]) + 0.1 * np.diag([1e-3, 1e-3], 4) + 0.1 * np.diag([1e-3, 1e-3], -4)
    C = skew[[0, 1, 2, 3, 4, 5]][:, [3, 4, 5, 0, 1, 2]]  # twist per (F; M)

    def element(name, x, along, across, matrix, extra=""):
        rows = ", ".join(vector(row) for row in matrix)
        return (
            f'[[element]]\nkind = "matrix"\nname = "{name}"\n{extra}from = "ground"\nto = "plate"\nat = ["{x} mm", "3 mm", "1 mm"]\n'
            f"along = {along}\nacross = {across}\ncompliance_si = [{rows}]\n"
        )

    flip_T, flip_W = np.diag([-1, -1, 1, 1, 1, -1]), np.diag([1, 1, -1, -1, -1, 1])  # z of its own frame turned round
    head = HEAD + SILICON + '[[body]]\nname = "plate"\n'
    rest = REST.replace("along = [1, 0, 0]", "along = [0, 1, 0]").replace("delta_x", "delta_y")
    half = '[[pattern]]\nname = "both"\nmirror = "x"\n' + element(
        "m", 10, [1, 2, 3], [0, 1, 0], C, 'pattern = "both"\n'
    )
    whole = element("m1", 10, [1, 2, 3], [0, 1, 0], C) + element("m2", -10, [-1, 2, 3], [0, 1, 0], flip_T @ C @ flip_W)
    found = [
        dm(Condensed(*with_values(loaded(tmp_path, head + text + rest))).output_compliance) for text in (half, whole)
    ]
    assert np.abs(found[0] - found[1]).max() < 1e-12 * np.abs(found[1]).max()
    image_T, image_W = np.diag([1, -1, -1, -1, 1, 1]), np.diag([-1, 1, 1, 1, -1, -1])
    symmetric = image_T @ found[0] @ image_W
    assert np.abs(symmetric - found[0]).max() < 1e-9 * np.abs(found[0]).max()  # the whole is its own image
    with pytest.raises(InputError) as caught:
        loaded(tmp_path, head + half.replace('mirror = "x"', 'mirror = "x"\ntimes = 3') + rest)
    assert "mirror: makes two copies; leave out times and angles" in str(caught.value)
