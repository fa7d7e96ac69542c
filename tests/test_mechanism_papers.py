"""The papers' devices written as mechanism files have the papers' matrices."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from conftest import DEVICE
from mechanism_files import HEAD, dm, loaded, mems_hexapod_text, number, place, vector, with_values

from ctrlgen import load_device
from ctrlgen.devices.mechanism.condensed import Condensed
from ctrlgen.devices.mems_hexapod import matrices as hexapod_matrices
from ctrlgen.devices.meso_hexapod import matrices as meso_matrices
from ctrlgen.devices.rrr_stage import stage
from ctrlgen.physics import meso_hexapod_kinematics as meso
from ctrlgen.physics import thermal_actuator, xy_stage


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
    # The paper's output frame
    T = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
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
    # The difference is of each entry's own size: turns and displacements differ by thousands
    assert np.abs((mine - paper) / size).max() < 1e-9


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
