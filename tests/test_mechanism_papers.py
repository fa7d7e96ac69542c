"""The papers' devices written as mechanism files have the papers' matrices."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from conftest import DEVICE
from mechanism_files import HEAD, dm, loaded, mems_hexapod_text, place, vector, with_values
from paper_mechanisms import meso_hexapod_text, rrr_text

from ctrlgen import load_device
from ctrlgen.devices.mechanism.condensed import Condensed
from ctrlgen.devices.mems_hexapod import matrices as hexapod_matrices
from ctrlgen.devices.meso_hexapod import matrices as meso_matrices
from ctrlgen.devices.rrr_stage import stage
from ctrlgen.physics import thermal_actuator, xy_stage


def test_the_mems_hexapod_as_a_mechanism_has_the_papers_jacobian(tmp_path):
    special = load_device(DEVICE)
    J = dm(Condensed(*with_values(loaded(tmp_path, mems_hexapod_text(special)))).jacobian)
    wanted = hexapod_matrices(special)["J"]
    assert np.abs((J - wanted) / np.abs(wanted).max(axis=1, keepdims=True)).max() < 1e-9


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


def test_the_meso_scale_hexapod_as_a_mechanism_has_the_papers_jacobian(tmp_path):
    special = load_device(DEVICE.parent / "meso_hexapod.toml")
    J = dm(Condensed(*with_values(loaded(tmp_path, meso_hexapod_text(special)))).jacobian)
    wanted = meso_matrices(special)["J_k"]
    assert np.abs((J - wanted) / np.abs(wanted).max(axis=1, keepdims=True)).max() < 1e-9
