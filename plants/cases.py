"""The two case studies of S1 section 6.3 on the plant: ctrlgen's forces in, the plant's poses out, errors by S1 eq. (20).

The forces come from `ctrlgen solve` as a user gets them, from the trajectory.csv it writes; nothing of it is imported.
"""

from __future__ import annotations

import csv
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from plants.frame import Array
from plants.mems_hexapod import MemsHexapod
from plants.numbers import UNITS, number
from plants.paper import error

ROOT = Path(__file__).resolve().parent.parent
CHANNELS = ("theta_x", "theta_y", "theta_z", "delta_x", "delta_y", "delta_z")
# S1 Table 3: what each pose is commanded in besides delta_z = 30 um, and the printed error [%].
COUPLED = (
    ("delta_z", 2.39),
    ("delta_x", 4.12),
    ("delta_y", 4.25),
    ("theta_x", 2.34),
    ("theta_y", 4.69),
    ("theta_z", 4.56),
)
CIRCLE = {"delta_x": 3.94, "delta_y": 3.65, "delta_z": 2.55}  # S1 section 6.3, printed mean errors [%]
PARASITIC = {"theta_x": 5.28e-6, "theta_y": 1.395e-5, "theta_z": 4.23e-6}  # the same, mean of the absolute value [rad]
NEAR_ZERO = 0.5  # um; a commanded coordinate smaller than this has no meaningful error in percent


@dataclass(frozen=True)
class Case:
    """Commanded and reached poses (n, 6), (theta; delta) [rad, um]."""

    command: Array
    reached: Array

    def coupled_errors(self) -> dict[str, float]:
        """Error [%] of each row of S1 Table 3 in its own channel."""
        places = ((k, CHANNELS.index(name)) for k, (name, _) in enumerate(COUPLED))
        return {CHANNELS[i]: float(error(self.command[k, i], self.reached[k, i])) for k, i in places}

    def mean_errors(self) -> dict[str, float]:
        """Mean error [%] of each translation along the path, where its command is not near zero."""
        means = {}
        for name in CIRCLE:
            c, p = (values[:, CHANNELS.index(name)] for values in (self.command, self.reached))
            means[name] = float(error(c, p)[np.abs(c) > NEAR_ZERO].mean())
        return means

    def parasitic(self) -> dict[str, float]:
        """Mean absolute difference of each rotation from its command [rad]."""
        return {
            name: float(np.abs((self.reached - self.command)[:, CHANNELS.index(name)]).mean()) for name in PARASITIC
        }


def coupled_poses(plant: MemsHexapod) -> Case:
    """The six poses of S1 Table 3."""
    command, forces = _solved("coupled_dof")
    return Case(command, np.array([plant.pose(plant.solve(force)) for force in forces]))


def circle(plant: MemsHexapod, every: int = 10) -> Case:
    """The circle of 20 um, `every` tenth of its 1000 samples."""
    command, forces = _solved("circle20")
    return Case(command[::every], np.array([plant.pose(state) for state in plant.path(forces[::every])]))


def _solved(scenario: str) -> tuple[Array, Array]:
    """The poses (n, 6) and bar forces (n, 6) [N] that ctrlgen finds for a scenario of this repository."""
    with tempfile.TemporaryDirectory(prefix="plants-") as scratch:
        out = Path(scratch) / scenario
        words = [sys.executable, "-m", "ctrlgen", "solve", str(ROOT / "scenarios" / scenario), "--out", str(out)]
        done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"ctrlgen solve {scenario} failed: {done.stderr.strip()}")
        columns = table(out / "trajectory.csv")
    axes = [f"F_{stage}{direction}" for stage in (1, 2, 3) for direction in "XY"]
    return tuple(np.column_stack([columns[name] for name in names]) for names in (CHANNELS, axes))


def table(path: Path) -> dict[str, Array]:
    """The columns of a trajectory.csv by name, in the units of this folder."""
    with open(path, newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    columns = {}
    for column, values in zip(header, np.array(rows, dtype=float).T, strict=True):
        name, _, unit = column.partition(" [")
        columns[name] = values * (number(f"1 {unit.rstrip(']')}") if unit.rstrip("]") in UNITS else np.nan)
    return columns
