"""The published poses of S0 as arrays in SI, from the files of scenarios/nist_hexapod."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.files import read_text
from ctrlgen.core.shipped_files import shipped
from ctrlgen.core.units import parse
from ctrlgen.devices import load_device
from ctrlgen.devices.meso_hexapod import MesoHexapod
from ctrlgen.physics import meso_hexapod_kinematics as meso_hexapod
from ctrlgen.recordings.pose_errors import CHANNELS
from ctrlgen.trajectory.frame import Frame, read_poses

SCENARIOS = shipped("scenarios")
FRAME = Frame(CHANNELS, ("rad",) * 3 + ("um",) * 3)


@dataclass(frozen=True)
class PaperRecordings:
    """54 poses, rows (theta, delta) [rad, m], and the actuator inputs U_j = [J^c]^-1 T_j [m], (54, 6).

    `J_cube` and `J_c` = [Ad] [J_cube] (6, 6) [rad/m, 1] are the paper's calibrated Jacobians of cube and platform.
    """

    commanded: np.ndarray
    kinematic: np.ndarray
    measured: np.ndarray
    J_cube: np.ndarray
    J_c: np.ndarray
    inputs: np.ndarray


def load_paper_recordings(device: MesoHexapod, folder: Path = SCENARIOS / "nist_hexapod") -> PaperRecordings:
    """The data in the four files of `folder`; the depth of the cube is the device's. Raises InputError."""
    commanded, kinematic, measured = (
        read_poses(folder / f"{name}.csv", FRAME) for name in ("commanded", "kinematic_model", "measured")
    )
    J_cube = read_jacobian(folder / "J_cube.csv", device.axes)
    J_c = ca.DM(meso_hexapod.cube_to_platform(device.cube.depth.si)).full() @ J_cube
    inputs = meso_hexapod.commands(ca.DM(J_c), ca.DM(commanded.T)).full().T
    return PaperRecordings(commanded, kinematic, measured, J_cube, J_c, inputs)


def read_jacobian(path: Path, axes: tuple[str, ...]) -> np.ndarray:
    """A CSV with a header of actuators and a first column of components with units, such as 'theta_x [rad/mm]'."""
    rows = list(csv.reader(io.StringIO(read_text(path))))
    if not rows or tuple(rows[0][1:]) != tuple(axes):
        raise InputError(path, [Fault("line 1", f"must name the actuators {', '.join(axes)} in this order")])
    values, faults = [], []
    for line, (row, channel, unit) in enumerate(zip(rows[1:], CHANNELS, FRAME.units, strict=False), start=2):
        name, _, written = row[0].partition("[")
        written, wanted = written.rstrip("] "), "rad/m" if unit == "rad" else "1"
        try:
            if name.strip() != channel or len(row) != 7:
                raise ValueError(f"must hold {channel} and six numbers")
            values.append([parse(f"{cell} {written}", wanted) for cell in row[1:]])
        except ValueError as error:
            faults.append(Fault(f"line {line}", str(error)))
    if faults or len(values) != 6:
        raise InputError(path, faults or [Fault("file", "must hold six rows, one a component")])
    return np.array(values)


def load_s0(scenarios: Path = SCENARIOS) -> tuple[MesoHexapod, MesoHexapod, PaperRecordings]:
    """The device as printed, the device as the authors calculated, and the paper's data."""
    printed, calculated = (
        load_device(scenarios / "devices" / f"{name}.toml") for name in ("meso_hexapod", "meso_hexapod_as_calculated")
    )
    assert isinstance(printed, MesoHexapod) and isinstance(calculated, MesoHexapod)
    return printed, calculated, load_paper_recordings(printed, scenarios / "nist_hexapod")
