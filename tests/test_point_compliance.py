"""Compliance at a point, its centres, and redundant constraints by name."""

from __future__ import annotations

import numpy as np
import pytest
from command_line import ctrlgen as run_command
from held_blades import EI, E, L, T, W
from mechanism_files import PARALLELOGRAM, loaded

from ctrlgen.devices.mechanism.constraints import redundant_constraints
from ctrlgen.devices.mechanism.point_compliance import point_compliance


def test_a_parallelogram_has_its_centre_in_the_middle_of_its_blades(tmp_path):
    """There, and only there, a force across turns nothing; its compliance is l^3/24 EI, the moment is held by both blades at 10 mm."""
    device = loaded(tmp_path, PARALLELOGRAM)
    away = point_compliance(device, np.array([3e-3, 7e-3, 1e-3]))
    middle = np.array([0, -L / 2, 0])
    assert away.centre_of_compliance == pytest.approx(middle, abs=1e-9)
    assert away.centre_of_stiffness == pytest.approx(middle, abs=1e-9)
    there = point_compliance(device, middle)
    assert np.abs(there.compliance[:3, :3]).max() < 1e-12 * np.abs(away.compliance[:3, :3]).max() + 1e-9
    assert there.compliance[3, 0] == pytest.approx(L**3 / (24 * EI), rel=1e-9)
    assert there.stiffness[5, 2] == pytest.approx(2 * (E * T * W / L * 0.01**2 + EI / L), rel=1e-9)
    assert away.compliance @ away.stiffness == pytest.approx(np.eye(6), abs=1e-6)
    twist = away.compliance @ [0, 1, 0, 0, 0, 0]  # 3 mm beside the middle: a moment 3 mm times a force
    assert twist[2] == pytest.approx(3e-3 * there.compliance[2, 5], rel=1e-9)


def test_the_redundant_constraint_of_a_parallelogram_is_named(tmp_path):
    """Both blades hold the turn of the stage about the blades' length and its displacement along z at 20 mm from one another."""
    device = loaded(tmp_path, PARALLELOGRAM)
    assert set(redundant_constraints(device)) == {"left", "right"}
    assert all("theta_y" in held and "delta_x" not in held for held in redundant_constraints(device).values())
    one = PARALLELOGRAM[: PARALLELOGRAM.rindex("[[element]]")] + PARALLELOGRAM[PARALLELOGRAM.index("[[actuator]]") :]
    assert redundant_constraints(loaded(tmp_path, one.replace('travel = "300', 'travel = "10'))) == {}


@pytest.mark.long
def test_check_prints_them(tmp_path):
    loaded(tmp_path, PARALLELOGRAM)
    shown = run_command("check", tmp_path / "device.toml", "--point", "0 mm, -10 mm, 0 mm").stdout
    wanted = (
        "1 among these are redundant: left",
        "centre of compliance: (0 mm, -10 mm, 0 mm)",
        "M_z: 0 N*m/rad",
        "centre of stiff",
    )
    for part in wanted:
        assert part in shown
    assert "no point" in run_command("check", tmp_path / "device.toml", "--point", "1 mm, 2 mm").stderr
