"""Mechanisms from files: the papers' matrices, closed forms, one frame written twice, and what is refused."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from command_line import ctrlgen as run_command
from conftest import DEVICE
from mechanism_files import (
    HEAD,
    HINGE,
    PARALLELOGRAM,
    REST,
    SILICON,
    SPRING,
    TWO_BODIES,
    blade,
    dm,
    hinged,
    loaded,
    mems_hexapod_text,
    number,
    place,
    vector,
    with_values,
)
from scipy.integrate import quad

from ctrlgen import InputError, build_model, load_device, load_scenario, solve
from ctrlgen.devices.mechanism.condensed import Condensed
from ctrlgen.devices.mechanism.modes import freedoms, natural_frequencies
from ctrlgen.devices.mems_hexapod import matrices as hexapod_matrices
from ctrlgen.devices.meso_hexapod import matrices as meso_matrices
from ctrlgen.devices.rrr_stage import stage
from ctrlgen.model.assembly import movable
from ctrlgen.physics import meso_hexapod_kinematics as meso
from ctrlgen.physics import thermal_actuator, xy_stage
from ctrlgen.physics.flexure import rectangular_section


def test_the_mems_hexapod_as_a_mechanism_has_the_papers_jacobian(tmp_path):
    special = load_device(DEVICE)
    J = dm(Condensed(*with_values(loaded(tmp_path, mems_hexapod_text(special)))).jacobian)
    wanted = hexapod_matrices(special)["J"]
    assert np.abs((J - wanted) / np.abs(wanted).max(axis=1, keepdims=True)).max() < 1e-9


def rrr_text(device) -> str:
    """S3's 3-RRR stage: two links an arm, three hinges an arm, the arm copied by a pattern."""
    p, g = device.values(), device.values().lengths
    R3 = p.hinge3.R
    centre = np.array([g.l1 - g.l6, g.l4])  # of the platform, seen from Point 1
    point_3 = np.array([g.l1, g.l4 - g.l3])
    point_2 = point_3 - [0, 2 * R3 + g.l2]
    lines = [
        HEAD,
        f'[[material]]\nname = "sheet"\nyoung = {number(p.material.young, "Pa")}\npoisson = "{p.material.poisson!r}"\n',
        '[[pattern]]\nname = "arm"\ntimes = 3\nangles = ["0 deg", "-120 deg", "120 deg"]\n',
        '[[body]]\nname = "platform"\n',
    ]
    lines += [f'[[body]]\nname = "{name}"\npattern = "arm"\n' for name in ("lower", "upper")]
    for name, first, second, point, along in (
        ("hinge1", "ground", "lower", np.zeros(2), (1, 0, 0)),
        ("hinge2", "lower", "upper", point_2, (0, 1, 0)),
        ("hinge3", "upper", "platform", point_3, (0, 1, 0)),
    ):
        hinge, across = device.hinges[name], (0, 1, 0) if along[0] else (-1, 0, 0)
        equations = ", ".join(f'{key} = "{group}"' for key, group in hinge.equations.items())
        shear = "" if hinge.shear_factor is None else f', shear_factor = "{hinge.shear_factor.si!r}"'
        lines.append(
            f'[[element]]\nkind = "hinge"\nname = "{name}"\npattern = "arm"\nfrom = "{first}"\nto = "{second}"\nmaterial = "sheet"\n'
            f"at = {place([*(point - centre), 0.0])}\nalong = {vector(along)}\nacross = {vector(across)}\n"
            f'hinge = {{ kind = "circular", R = {number(hinge.R.si, "m")}, t = {number(hinge.t.si, "m")}, '
            f'b = {number(p.material.width, "m")}, equation = {{ {equations} }}, outside = "{hinge.outside}"{shear} }}\n'
        )
    lines.append(
        f'[[actuator]]\nname = "stack"\npattern = "arm"\nkind = "force"\non = "lower"\n'
        f"at = {place([*(np.array([g.l5, 0]) - centre), 0.0])}\n"
        'along = [0, -1, 0]\ngain = "1 N/V"\nlow = "0 V"\nhigh = "150 V"\ntravel = "50 um"\n'
    )
    lines.append(
        '[output]\nbody = "platform"\nat = ["0 m", "0 m", "0 m"]\nchannels = ["delta_x", "delta_y", "theta_z"]\n'
    )
    return "\n".join(lines)


@pytest.mark.parametrize("case", [1, 2])
def test_the_3_rrr_stage_as_a_mechanism_has_the_papers_matrices(tmp_path, case):
    special = load_device(DEVICE.parent / f"rrr_case{case}.toml")
    c = Condensed(*with_values(loaded(tmp_path, rrr_text(special))))
    k, angle = stage(special), special.values().frame_angle
    T = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )  # the paper's output frame
    for mine, paper in ((dm(c.stiffness), dm(k.input_stiffness)), (T @ dm(c.jacobian), dm(k.complete_J))):
        assert np.abs((mine - paper) / np.abs(paper).max(axis=1, keepdims=True)).max() < 1e-9
    C_o = dm(c.output_compliance)[np.ix_([3, 4, 2], [0, 1, 5])]  # (dx, dy, dalpha) per (F_x, F_y, M_z)
    paper = dm(k.C_oFo)
    assert np.abs(T @ C_o @ T.T - paper).max() < 1e-9 * np.abs(paper).max()


def xy_axis_text(s, a) -> str:
    """One axis of S1's X-Y stage: two driven arms with half an actuator each, two guides; notch, lever and notch in each arm."""
    notch = ca.DM(xy_stage.notch_compliance(s)).full()
    lever = ca.DM(xy_stage.lever_compliance(s, a)).full()
    half = 2 * np.linalg.inv(ca.DM(thermal_actuator.stiffness(a)).full())
    lines, r = [HEAD, '[[body]]\nname = "plate"\n'], s.notch_radius

    def element(name, first, second, at, along, C) -> None:
        across = np.cross([0, 0, 1], along)
        rows = ", ".join(vector(row) for row in C)
        lines.append(
            f'[[element]]\nkind = "matrix"\nname = "{name}"\nfrom = "{first}"\nto = "{second}"\nat = {place(at)}\n'
            f"along = {vector(along)}\nacross = {vector(across)}\ncompliance_si = [{rows}]\n"
        )

    for side in (1, -1):
        along, push = np.array([0.0, -side, 0.0]), np.array([1.0, 0.0, 0.0])  # toward the plate; as the bar pushes
        for x, driven in ((-s.plate_half_length, True), (s.plate_half_length, False)):
            k = f"{'drive' if driven else 'guide'}_{'plus' if side > 0 else 'minus'}"
            end = np.array([x, side * s.plate_half_width, 0.0])
            root = end - s.lever_long * along
            lines += [f'[[body]]\nname = "{k}_{part}"\n' for part in ("foot", "far", *(["bar"] if driven else []))]
            element(f"{k}_root", "ground", f"{k}_foot", root + r * along, along, notch)
            element(f"{k}_lever", f"{k}_foot", f"{k}_far", end - r * along, along, lever)
            element(f"{k}_end", f"{k}_far", "plate", end + r * along, along, notch)
            if driven:
                bar = root + s.lever_short * along
                element(f"{k}_half", "ground", f"{k}_bar", bar, push, half)
                element(f"{k}_notch", f"{k}_bar", f"{k}_foot", bar + r * push, push, notch)
    lines.append(
        '[[actuator]]\nname = "probe"\nkind = "force"\non = "plate"\nat = ["0 m", "0 m", "0 m"]\nalong = [1, 0, 0]\ngain = "1 N/V"\n'
        'low = "0 V"\nhigh = "1 V"\ntravel = "50 um"\n[output]\nbody = "plate"\nat = ["0 m", "0 m", "0 m"]\nchannels = ["delta_x"]\n'
    )
    return "\n".join(lines)


def test_an_axis_of_the_xy_stage_as_a_mechanism_has_the_papers_stiffness(tmp_path):
    p = load_device(DEVICE).values()
    device = loaded(tmp_path, xy_axis_text(p.stage, p.actuator))
    assert len(device.bodies) == 11 and len(device.placed_elements) == 16
    mine = dm(Condensed(*with_values(device)).output_compliance)
    paper = np.linalg.inv(ca.DM(xy_stage.axis_stiffness(p.stage, p.actuator)).full())
    size = np.sqrt(np.abs(np.outer(paper[range(6), [3, 4, 5, 0, 1, 2]], paper[range(6), [3, 4, 5, 0, 1, 2]])))[
        :, [3, 4, 5, 0, 1, 2]
    ]
    assert (
        np.abs((mine - paper) / size).max() < 1e-9
    )  # of each entry's own size: turns and displacements differ by thousands


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
        ('channels = ["delta_x"]', 'channels = ["delta_x", "theta_z"]', "2 channels, 1 actuators"),
        ('body = "stage"', 'body = "table"', "output.body: 'table' is no body"),
        ('[[body]]\nname = "stage"', '[[body]]\nname = "stage"\n[[body]]\nname = "free"', "nothing joins free to the ground"),
        ('width = "8 mm"', 'width = "0.1 mm"', "thickness = '0.2 mm' is above width = '0.1 mm'"),
        ('channels = ["delta_x"]', 'channels = ["delta_z"]', "no actuator moves delta_z"),
        ('name = "coil"', 'name = "coil"\npattern = "arm"', "actuator[0].pattern: 'arm' is no pattern"),
        ('travel = "300 um"', 'travel = "300 um"\ntime_constant = "1 ms"\n[[actuator]]\nname = "b"\nkind = "force"\non = "stage"\n'
         'at = ["0 mm", "0 mm", "0 mm"]\nalong = [0, 1, 0]\ngain = "2 N/A"\nlow = "-1 A"\nhigh = "1 A"\ntravel = "300 um"',
         "actuator: some have a time_constant and some do not"),
        ('to = "stage"\nat', 'too = "stage"\nat', "did you mean 'to'"),
        ('from = "ground"', 'form = "ground"', "did you mean 'from'"),
    ],
)  # fmt: skip
def test_what_does_not_fit_together_is_said(tmp_path, old, new, says):
    assert old in PARALLELOGRAM
    with pytest.raises(InputError) as caught:
        loaded(tmp_path, PARALLELOGRAM.replace(old, new))
    assert says in str(caught.value)


def test_the_first_natural_frequency_of_a_parallelogram_is_that_of_its_mass_on_its_blades(tmp_path):
    """sqrt(K/m)/(2 pi) of a mass that does not turn, pushed at the middle height of the blades."""
    text = PARALLELOGRAM.replace(
        '[[body]]\nname = "stage"',
        '[[body]]\nname = "stage"\nmass = "50 g"\ncentre = ["0 mm", "-10 mm", "0 mm"]\ninertia = ["9 kg*mm^2", "9 kg*mm^2", "9 kg*mm^2"]',
    )
    K = 24 * 130e9 * 8e-3 * 0.2e-3**3 / 12 / 20e-3**3
    modes = natural_frequencies(loaded(tmp_path, text))
    assert len(modes) == 6 and modes[0] == pytest.approx(np.sqrt(K / 0.05) / (2 * np.pi), rel=1e-9)
    assert modes[1] > 4 * modes[0]


def test_a_mechanism_without_an_actuator_is_refused(tmp_path):
    pushed = PARALLELOGRAM[PARALLELOGRAM.index("[[actuator]]") : PARALLELOGRAM.index("[output]")]
    text = PARALLELOGRAM.replace(pushed, "").replace('name = "m"', 'name = "m"\nactuator = []')
    with pytest.raises(InputError) as caught:
        loaded(tmp_path, text)
    assert "actuator: there is none; add a [[actuator]] table" in str(caught.value)


WIRE = (
    '[[element]]\nkind = "wire"\nname = "{name}"\nfrom = "ground"\nto = "plate"\nat = ["{x} mm", "{y} mm", "{z} mm"]\n'
)
WIRE += 'along = [{along}]\nlength = "10 mm"\ndiameter = "0.2 mm"\nmaterial = "silicon"\n'
SIX = [
    (0, 0, 0, "1, 0, 0"),
    (0, 20, 0, "1, 0, 0"),
    (0, 0, 20, "0, 1, 0"),
    (20, 0, 0, "0, 0, 1"),
    (0, 20, 0, "0, 0, 1"),
    (0, 0, 20, "1, 0, 0"),
]


@pytest.mark.parametrize(("wires", "free", "over"), [(1, 5, 0), (3, 3, 0), (6, 0, 0), (7, 0, 1)])
def test_degrees_of_freedom_are_those_of_exact_constraint(tmp_path, wires, free, over):
    """Each wire that is independent of the others takes one freedom; a seventh over-constrains."""
    text = HEAD + SILICON + '[[body]]\nname = "plate"\n'
    for k, (x, y, z, along) in enumerate([*SIX, (20, 20, 0, "0, 0, 1")][:wires]):
        text += WIRE.format(name=f"w{k}", x=x, y=y, z=z, along=along)
    assert freedoms(loaded(tmp_path, text + REST)) == (free, over)


def test_freedoms_of_known_guides(tmp_path):
    assert freedoms(loaded(tmp_path, PARALLELOGRAM)) == (1, 1)  # two leaf springs: one motion, over-constrained once
    one = PARALLELOGRAM.replace(blade("right", 10), "")
    assert freedoms(loaded(tmp_path, one)) == (3, 0)  # one leaf spring
    mirror = (DEVICE.parent / "tip_tilt_mirror.toml").read_text()
    assert freedoms(loaded(tmp_path, mirror)) == (3, 0)  # x, y and the turn about z: the wires are soft across


def test_bodies_without_mass_change_no_natural_frequency(tmp_path):
    """The levers' wires made of two halves with a body between: series of both is the whole wire."""
    whole = (DEVICE.parent / "xy_lever_stage.toml").read_text()
    old = 'name = "push_x"\nfrom = "lever_x"\nto = "block_1"\nat = ["65 mm", "0 mm", "0 mm"]\nalong = [-1, 0, 0]\nlength = "15 mm"'
    assert old in whole
    section = 'diameter = "1.2 mm"\nmaterial = "steel"\n'
    first = 'name = "push_x"\nfrom = "lever_x"\nto = "joint"\nat = ["72.5 mm", "0 mm", "0 mm"]\nalong = [-1, 0, 0]\nlength = "7.5 mm"\n'
    second = first.replace("push_x", "push_x2").replace("lever_x", "joint", 1).replace('to = "joint"', 'to = "block_1"')
    second = second.replace("72.5 mm", "65 mm")
    halves = (
        whole.replace(old, f'{first}{section}\n[[element]]\nkind = "wire"\n{second.rstrip()}')
        + '\n[[body]]\nname = "joint"\n'
    )
    modes = [natural_frequencies(loaded(tmp_path, text)) for text in (whole, halves)]
    assert modes[1] == pytest.approx(modes[0], rel=1e-7)
    c = [Condensed(*with_values(loaded(tmp_path, text))) for text in (whole, halves)]
    assert np.abs(dm(c[1].jacobian) - dm(c[0].jacobian)).max() < 1e-9 * np.abs(dm(c[0].jacobian)).max()


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
    assert (
        np.abs(turned @ C @ turned.T - C).max() < 1e-9 * np.abs(C).max()
    )  # three legs: the same after a third of a turn
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
    assert (
        np.abs((pose(z, model.p_nominal)[0] - fixed_pose(z)).full()).max() < 1e-16
    )  # of 70 um: rounding, another order of sums
    step = 1e-6 * model.p_nominal[k]
    ends = []
    for side in (-1, 1):
        p = model.p_nominal.copy()
        p[k] += side * step
        ends.append(pose(z, p)[0].full())
    slope = pose(z, model.p_nominal)[1].full()[:, [k]]
    assert np.abs((ends[1] - ends[0]) / (2 * step) - slope).max() < 1e-4 * np.abs(slope).max()


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


@pytest.mark.parametrize("ahead", [12.0, -12.0])
def test_a_mass_beside_the_end_of_a_beam_has_the_frequencies_of_deflection_and_turn(tmp_path, ahead):
    """K of the cantilever's end in its plane, M = [[m, m e], [m e, I + m e^2]] with the centre of mass e ahead of the end."""
    E, l, d, m, inertia, e = 130e9, 20e-3, 0.5e-3, 0.03, 4e-6, ahead * 1e-3
    wire = (
        '[[element]]\nkind = "wire"\nname = "w"\nfrom = "ground"\nto = "tip"\nat = ["20 mm", "0 mm", "0 mm"]\nlength = "20 mm"\n'
        'diameter = "0.5 mm"\nmaterial = "silicon"\n'
    )
    body = f'[[body]]\nname = "tip"\nmass = "30 g"\ncentre = ["{20 + ahead} mm", "0 mm", "0 mm"]\n'
    body += 'inertia = ["4 kg*mm^2", "4 kg*mm^2", "4 kg*mm^2"]\n'
    modes = natural_frequencies(loaded(tmp_path, HEAD + SILICON + body + wire + REST.replace("plate", "tip")))
    EI = E * np.pi * d**4 / 64
    K = np.linalg.inv([[l**3 / (3 * EI), l**2 / (2 * EI)], [l**2 / (2 * EI), l / EI]])
    M = np.array([[m, m * e], [m * e, inertia + m * e**2]])
    wanted = np.sqrt(np.linalg.eigvals(np.linalg.solve(M, K)).real) / (2 * np.pi)
    for f in wanted:
        assert np.abs(modes / f - 1).min() < 1e-9


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


def test_a_circular_hinge_is_that_of_its_equations_in_the_plane_and_of_beam_theory_out_of_it(tmp_path):
    """Against quadrature over the profile; the arm's stiffness is that of S2 C.1-C.4 about its end."""
    c = Condensed(*with_values(loaded(tmp_path, hinged(1.0))))
    C = dm(c.compliances[0])
    R, t, b, E, nu = 2e-3, 0.3e-3, 8e-3, 130e9, 0.28
    G = E / (2 * (1 + nu))
    I_0, I_2, I_3 = (
        quad(lambda x, f=f: f(x, t + 2 * R - 2 * np.sqrt(R * R - x * x)), -R, R, epsabs=0, epsrel=1e-12, limit=200)[0]
        for f in (lambda x, h: 1 / h, lambda x, h: x * x / h, lambda x, h: 1 / h**3)
    )
    alpha = 12 * I_3 / (E * b)
    assert C[2, 5] == pytest.approx(alpha, rel=1e-9) and C[4, 5] == C[2, 1] == pytest.approx(R * alpha, rel=1e-9)
    assert C[3, 0] == pytest.approx(I_0 / (E * b), rel=1e-9)
    assert C[1, 4] == pytest.approx(12 * I_0 / (E * b**3), rel=1e-9)
    assert C[5, 4] == C[1, 2] == pytest.approx(-R * 12 * I_0 / (E * b**3), rel=1e-9)
    assert C[5, 2] == pytest.approx(12 * (R**2 * I_0 + I_2) / (E * b**3) + 1.2 * I_0 / (G * b), rel=1e-9)
    assert C[0, 3] < min(3 * I_3 / (G * b), 12 * (C[4, 1] - R**2 * alpha) * 1.01 / b**2)  # either way of yielding alone
    assert C[0, 3] < 0.1 * alpha
    assert dm(c.stiffness)[0, 0] == pytest.approx(1 / (C[4, 1] + 2 * 30e-3 * C[4, 5] + (30e-3) ** 2 * alpha), rel=1e-9)


def test_a_hinges_rotation_and_the_stress_of_its_neck_are_limits(tmp_path):
    """1 mm at 32 mm from the neck turns it by very nearly 1/32; 6 M K/(b t^2) there, K = (1 + t/2R)^0.45."""
    device = loaded(tmp_path, hinged(1.0))
    assert freedoms(device) == (1, 0)
    c, model = Condensed(*with_values(device)), build_model(device)
    limits = {limit.name: limit for limit in model.limits}
    d = 1e-3
    force = dm(c.stiffness)[0, 0] * d
    values = dict(
        zip(
            (limit.name for limit in model.limits),
            model.evaluate_limits(model.rest, [d], [0.0], model.p_nominal),
            strict=True,
        )
    )
    turn = float(values["rotation_notch"][0])
    assert turn == pytest.approx(force * (dm(c.compliances[0])[2, 1] + 30e-3 * dm(c.compliances[0])[2, 5]), rel=1e-9)
    assert turn == pytest.approx(d / 32e-3, rel=0.02) and limits["rotation_notch"].upper == pytest.approx(np.radians(1))
    bending = 6 * force * 32e-3 / (8e-3 * 0.3e-3**2) * (1 + 0.3 / 4) ** 0.45
    assert float(values["stress_silicon"][0]) == pytest.approx(bending, rel=1e-6)
    assert limits["stress_silicon"].channels == ("notch_neck",)
    assert any("notch: alpha_z_per_M_z at t/R = 0.15 by C.1" in text for text in device.remarks())


def test_the_rotations_of_hinges_in_a_row_add_up(tmp_path):
    text = hinged(1.0).replace('[[body]]\nname = "plate"', '[[body]]\nname = "plate"\n[[body]]\nname = "link"')
    text = text.replace('to = "plate"\nat = ["2 mm"', 'to = "link"\nat = ["2 mm"')
    second = HINGE.format(name="second", first="link", to="plate", x=14, along="1, 0, 0", limit=1.0)
    device = loaded(tmp_path, text.replace("[[actuator]]", second + "[[actuator]]"))
    c = Condensed(*with_values(device))
    turns = [dm(c.rotation(k))[0, 0] for k in (0, 1)]
    assert min(turns) > 0 and sum(turns) == pytest.approx(dm(c.twists[device.bodies.index("plate")])[2, 0], rel=1e-9)


def test_two_hinges_on_one_line_leave_one_rotation_whichever_way_they_are_drawn(tmp_path):
    """Their necks stand one above the other at x = 0."""
    for x, along in ((2, "1, 0, 0"), (-2, "-1, 0, 0")):
        text = hinged(1.0).replace('"32 mm", "0 mm", "0 mm"', '"30 mm", "0 mm", "0 mm"')
        first = HINGE.format(name="notch", first="ground", to="plate", x=2, along="1, 0, 0", limit=1.0)
        assert first in text
        second = HINGE.format(name="above", first="ground", to="plate", x=x, along=along, limit=1.0)
        second = second.replace(f'at = ["{x} mm", "0 mm", "0 mm"]', f'at = ["{x} mm", "0 mm", "20 mm"]')
        assert freedoms(loaded(tmp_path, text.replace(first, first + second))) == (1, 5)


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


def meso_hexapod_text(device) -> str:
    """S0's hexapod: three stages moved by two actuators each, six struts that hold their length alone (1e-12 of it across)."""
    p = device.values()
    h, directions = p.hexapod, p.directions.jacobian
    A, B = (dm(points) for points in meso.geometry(h))
    lines = [HEAD, '[[body]]\nname = "platform"\n']
    along, across, turning = 1e-6, 1e6, 1e6  # m/N and rad/(N m)

    def entries(axial):
        return (
            f'theta_x_per_M_x = "{turning} rad/(N*m)"\ntheta_y_per_M_y = "{turning} rad/(N*m)"\ntheta_z_per_M_z = "{turning} rad/(N*m)"\n'
            f'delta_x_per_F_x = "{axial} m/N"\ndelta_y_per_F_y = "{across} m/N"\ndelta_z_per_F_z = "{across} m/N"\n'
        )

    for j in range(3):
        lines.append(f'[[body]]\nname = "stage{j + 1}"\n')
        stiff = np.diag([1e-9] * 6)[:, [3, 4, 5, 0, 1, 2]]
        rows = ", ".join(vector(row) for row in stiff)
        lines.append(
            f'[[element]]\nkind = "matrix"\nname = "xy{j + 1}"\nfrom = "ground"\nto = "stage{j + 1}"\nat = ["0 m", "0 m", "0 m"]\n'
            f"compliance_si = [{rows}]\n"
        )
    for i in range(6):
        span = A[:, i] - B[:, i]
        lines.append(
            f'[[element]]\nkind = "compliance"\nname = "strut{i + 1}"\nfrom = "stage{meso.STAGE_OF_STRUT[i] + 1}"\nto = "platform"\n'
            f"at = {place(A[:, i])}\nalong = {vector(span)}\nacross = [0, 0, 1]\n{entries(along)}"
        )
    for i, (axis, angle) in enumerate(zip(device.axes, directions, strict=True)):
        lines.append(
            f'[[actuator]]\nname = "a{axis}"\nkind = "displacement"\non = "xy{meso.STAGE_OF_ACTUATOR[i] + 1}"\n'
            f'along = {vector([np.cos(angle), np.sin(angle), 0.0])}\ngain = "1 um/V"\nlow = "-50 V"\nhigh = "50 V"\ntravel = "50 um"\n'
        )
    lines.append(
        '[output]\nbody = "platform"\nat = ["0 m", "0 m", "0 m"]\n'
        'channels = ["theta_x", "theta_y", "theta_z", "delta_x", "delta_y", "delta_z"]\n'
    )
    return "\n".join(lines)


def test_the_meso_scale_hexapod_as_a_mechanism_has_the_papers_jacobian(tmp_path):
    special = load_device(DEVICE.parent / "meso_hexapod.toml")
    J = dm(Condensed(*with_values(loaded(tmp_path, meso_hexapod_text(special)))).jacobian)
    wanted = meso_matrices(special)["J_k"]
    assert np.abs((J - wanted) / np.abs(wanted).max(axis=1, keepdims=True)).max() < 1e-9
