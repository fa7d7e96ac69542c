"""Mechanisms from files: the papers' matrices, closed forms, one frame written twice, and what is refused."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from conftest import DEVICE

from ctrlgen import InputError, build_model, load_device, load_scenario, solve
from ctrlgen.devices.mechanism import Condensed
from ctrlgen.devices.mems_hexapod import matrices as hexapod_matrices
from ctrlgen.devices.rrr_stage import hinge_compliance, stage
from ctrlgen.physics import hexapod, xy_stage

HEAD = 'kind = "mechanism"\nname = "m"\ntitle = "t"\nsource = "a test"\n'
SILICON = '[[material]]\nname = "silicon"\nyoung = "130 GPa"\npoisson = "0.28"\n'


def number(x: float, unit: str) -> str:
    return f'"{float(x)!r} {unit}"'


def place(point) -> str:
    return f"[{', '.join(number(v, 'm') for v in np.ravel(point))}]"


def vector(v) -> str:
    return f"[{', '.join(repr(float(x)) for x in np.ravel(v))}]"


def dm(matrix) -> np.ndarray:
    return ca.DM(ca.evalf(ca.SX(matrix))).full()


def loaded(folder, text: str):
    (folder / "device.toml").write_text(text)
    return load_device(folder / "device.toml")


def mems_hexapod_text(device) -> str:
    """S1's hexapod: three stages of [C^XY] whose strokes are prescribed, six struts, the platform."""
    p = device.values()
    h, g = p.hexapod, hexapod.geometry(p.hexapod)
    C = ca.DM(xy_stage.stage_compliance(p.stage, p.actuator)).full()
    lines = [HEAD, f'[[material]]\nname = "tungsten"\nyoung = {number(h.young, "Pa")}\npoisson = "{h.poisson}"\n']
    lines += [f'[[body]]\nname = "{name}"\n' for name in ("platform", "stage1", "stage2", "stage3")]
    for j in range(3):
        R = dm(g.rotation[j])
        rows = ", ".join(vector(row) for row in C)
        lines.append(
            f'[[element]]\nkind = "matrix"\nname = "xy{j + 1}"\nfrom = "ground"\nto = "stage{j + 1}"\nat = {place(dm(g.centre[j]))}\n'
            f"along = {vector(R[:, 0])}\nacross = {vector(R[:, 1])}\ncompliance_si = [{rows}]\n"
        )
    for i in range(6):
        span = dm(g.platform[i] - g.base[i]).ravel()
        lines.append(
            f'[[element]]\nkind = "strut"\nname = "strut{i + 1}"\nfrom = "stage{hexapod.STAGE_OF_STRUT[i] + 1}"\nto = "platform"\n'
            f"at = {place(dm(g.platform[i]))}\nalong = {vector(span)}\nacross = [0, 0, 1]\nlength = {number(np.linalg.norm(span), 'm')}\n"
            f"wire_length = {number(h.wire_length, 'm')}\nwire_diameter = {number(h.wire_diameter, 'm')}\n"
            f'rod_diameter = {number(h.rod_diameter, "m")}\nmaterial = "tungsten"\n'
        )
    for j in range(3):
        for c, axis in enumerate("XY"):
            lines.append(
                f'[[actuator]]\nname = "a{j + 1}{axis}"\nkind = "displacement"\non = "xy{j + 1}"\n'
                f"along = {vector(dm(g.rotation[j])[:, c])}\n"
                'gain = "1 um/V"\nlow = "0 V"\nhigh = "50 V"\ntravel = "50 um"\n'
            )
    lines.append(
        '[output]\nbody = "platform"\nat = ["0 m", "0 m", "0 m"]\n'
        'channels = ["theta_x", "theta_y", "theta_z", "delta_x", "delta_y", "delta_z"]\n'
    )
    return "\n".join(lines)


def test_the_mems_hexapod_as_a_mechanism_has_the_papers_jacobian(tmp_path):
    special = load_device(DEVICE)
    J = dm(Condensed(*with_values(loaded(tmp_path, mems_hexapod_text(special)))).jacobian)
    wanted = hexapod_matrices(special)["J"]
    assert np.abs((J - wanted) / np.abs(wanted).max(axis=1, keepdims=True)).max() < 1e-9


def with_values(device):
    return device, device.values()


def rrr_text(device) -> str:
    """S3's 3-RRR stage: two links an arm, three hinges an arm, the arm copied by a pattern; out of the plane anything stiff."""
    p, g = device.values(), device.values().lengths
    R3 = p.hinge3.R
    centre = np.array([g.l1 - g.l6, g.l4])  # of the platform, seen from Point 1
    point_3 = np.array([g.l1, g.l4 - g.l3])
    point_2 = point_3 - [0, 2 * R3 + g.l2]
    lines = [
        HEAD,
        '[[pattern]]\nname = "arm"\ntimes = 3\nangles = ["0 deg", "-120 deg", "120 deg"]\n',
        '[[body]]\nname = "platform"\n',
    ]
    lines += [f'[[body]]\nname = "{name}"\npattern = "arm"\n' for name in ("lower", "upper")]
    for name, first, second, point, along in (
        ("hinge1", "ground", "lower", np.zeros(2), (1, 0, 0)),
        ("hinge2", "lower", "upper", point_2, (0, 1, 0)),
        ("hinge3", "upper", "platform", point_3, (0, 1, 0)),
    ):
        C = dm(hinge_compliance(device, name, p))  # (dx, dy, dalpha) per (F_x, F_y, M_z)
        across = (0, 1, 0) if along[0] else (-1, 0, 0)
        lines.append(
            f'[[element]]\nkind = "compliance"\nname = "{name}"\npattern = "arm"\nfrom = "{first}"\nto = "{second}"\n'
            f"at = {place([*(point - centre), 0.0])}\nalong = {vector(along)}\nacross = {vector(across)}\n"
            f'theta_x_per_M_x = "0.1 rad/(N*m)"\ntheta_y_per_M_y = "0.1 rad/(N*m)"\ndelta_z_per_F_z = "1e-7 m/N"\n'
            f"theta_z_per_M_z = {number(C[2, 2], 'rad/(N*m)')}\ndelta_x_per_F_x = {number(C[0, 0], 'm/N')}\n"
            f"delta_y_per_F_y = {number(C[1, 1], 'm/N')}\ntheta_z_per_F_y = {number(C[1, 2], 'rad/N')}\n"
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


PARALLELOGRAM = f"""{HEAD}{SILICON.replace('poisson = "0.28"', 'poisson = "0.28"' + chr(10) + 'stress_limit = "300 MPa"')}
[[body]]
name = "stage"
[[element]]
kind = "blade"
name = "left"
from = "ground"
to = "stage"
at = ["-10 mm", "0 mm", "0 mm"]
along = [0, 1, 0]
across = [-1, 0, 0]
length = "20 mm"
thickness = "0.2 mm"
width = "8 mm"
material = "silicon"
[[element]]
kind = "blade"
name = "right"
from = "ground"
to = "stage"
at = ["10 mm", "0 mm", "0 mm"]
along = [0, 1, 0]
across = [-1, 0, 0]
length = "20 mm"
thickness = "0.2 mm"
width = "8 mm"
material = "silicon"
[[actuator]]
name = "coil"
kind = "force"
on = "stage"
at = ["0 mm", "-10 mm", "0 mm"]
along = [1, 0, 0]
gain = "2 N/A"
low = "-1 A"
high = "1 A"
travel = "300 um"
[output]
body = "stage"
at = ["0 mm", "0 mm", "0 mm"]
channels = ["delta_x"]
"""


def test_a_parallelogram_has_the_stiffness_and_stress_of_the_textbook(tmp_path):
    """Two clamped-guided blades, 12 E I / l^3 each, pushed at their middle height, where their axial stiffness is not asked for;
    M = 6 E I d / l^2 at the ends."""
    c = Condensed(*with_values(loaded(tmp_path, PARALLELOGRAM)))
    E, l, t, w = 130e9, 20e-3, 0.2e-3, 8e-3
    I = w * t**3 / 12
    assert dm(c.stiffness)[0, 0] == pytest.approx(24 * E * I / l**3, rel=1e-9)
    assert dm(c.jacobian)[0, 0] == pytest.approx(1.0, rel=1e-9)
    for _, _, about_z, about_y, tension in c.stresses():
        assert np.abs(dm(about_z)).ravel() == pytest.approx(np.full(2, 6 * E * I / l**2 / (w * t**2 / 6)), rel=1e-9)
        assert np.abs(dm(about_y)).max() < 1e-6 * np.abs(dm(about_z)).max() > np.abs(dm(tension)).max()


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
    stress = {m.limit.name: m.value for m in solution.margins}["stress_left"]
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
        ('name = "coil"', 'name = "coil"\npattern = "arm"', "actuator[0].pattern: 'arm' is no pattern"),
    ],
)  # fmt: skip
def test_what_does_not_fit_together_is_said(tmp_path, old, new, says):
    assert old in PARALLELOGRAM
    with pytest.raises(InputError) as caught:
        loaded(tmp_path, PARALLELOGRAM.replace(old, new))
    assert says in str(caught.value)
