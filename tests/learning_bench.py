"""Scenarios in few samples, and a bench that makes recordings of their runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import SCENARIOS

from ctrlgen import InputError, build_model, load_scenario, simulate, solve
from ctrlgen.core.units import base_unit
from ctrlgen.devices.changed_numbers import changed
from ctrlgen.trajectory.solution import Solution

NOISE = np.repeat([1e-5, 2e-8], 3)  # rad, m: of a sample
WRONG = {"actuator.expansion_slope": 3.6e-9}  # 20 % more: 3.6 % of the circle, as on the independent plant


# Of a bench whose readings are right
RIGHT = """title = "a calibrated bench"
[sensor]
scale = { sd = "0.001 %", source = "simulated" }
clock = { sd = "1 ns", source = "simulated" }
"""


def shortened(text: str, folder: Path, sensor: str = RIGHT, **keys: str) -> Path:
    """A shipped scenario with other lines, without what it expects, and with what is stated of its `sensor`."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = (SCENARIOS / text / "scenario.toml").read_text().partition("[[expect]]")[0].splitlines()
    lines = [next((f'{k} = "{v}"' for k, v in keys.items() if line.startswith(f"{k} =")), line) for line in lines]
    lines = [
        f'device = "{SCENARIOS / text / line.split(chr(34))[1]}"' if line.startswith("device =") else line
        for line in lines
    ]
    (folder / "scenario.toml").write_text("\n".join(lines) + "\n")
    if sensor:
        (folder / "uncertainty.toml").write_text(sensor)
    return folder


def solved(folder: Path) -> Solution:
    scenario = load_scenario(folder)
    return solve(scenario, build_model(scenario.device))


class Bench:
    """A simulated bench: the device with other numbers, and drives that reach it as `wired` says."""

    def __init__(
        self, solution: Solution, folder: Path, wired=lambda u: u, periods: int = 6, noise: float = 1.0
    ) -> None:
        self.solution, self.folder, self.wired, self.periods, self.noise = solution, folder, wired, periods, noise
        self.model = build_model(changed(solution.model.device, WRONG))
        self.runs: list[Path] = []

    def reached(self, u: np.ndarray) -> np.ndarray:
        """(n, 6) [rad, m] in the second of two periods."""
        s, h, u = self.solution, self.solution.scenario.sample_time, self.wired(u)
        trace = simulate(self.model, np.vstack([u, u]), h, s.trace.x[0], s.trace.z[0])
        return trace.signals["pose"][len(u) : 2 * len(u)]

    def run(self, u: np.ndarray, read=lambda y: y, **changes) -> Path:
        """A recording of `periods` periods, of which the sensor makes what `read` says; its folder."""
        y = read(np.tile(self.reached(u), (self.periods, 1)))
        y = y + self.noise * NOISE * np.random.default_rng(len(self.runs)).standard_normal(y.shape)
        folder = self.folder / f"run{len(self.runs)}"
        write(folder, self.solution, np.tile(u, (self.periods, 1)), y, **changes)
        self.runs.append(folder)
        return folder

    def error(self, u: np.ndarray) -> float:
        """[m] rms length of the error of translation, without noise."""
        e = (self.reached(u) - self.solution.command)[:, 3:]
        return float(np.sqrt(np.mean(np.sum(e**2, axis=1))))


def refused(call) -> list[str]:
    """The faults with which it is refused."""
    with pytest.raises(InputError) as error:
        call()
    return [str(fault) for fault in error.value.faults]


def write(
    folder: Path, solution: Solution, u: np.ndarray, y: np.ndarray, rate: float | None = None, **keys: str
) -> Path:
    """run.csv and recording.toml of drives and readings of what is followed [SI]; the folder."""
    folder.mkdir(parents=True)
    m, kind, follow = solution.model, keys.get("kind", "series"), solution.scenario.file.follow
    drive, signal = m.signals["drive"], m.signals[follow]
    header = ",".join([*(f"u_{d}" for d in drive.channels), *signal.channels])
    np.savetxt(folder / "run.csv", np.hstack([u, y]), delimiter=",", header=header, comments="", fmt="%.17g")
    lines = ['title = "a run"', f'device = "{m.device.name}"', f'kind = "{kind}"', "[[record]]"]
    lines += ['file = "run.csv"', 'role = "fit"', keys.get("record", "")]
    if kind == "series":
        lines.append(f'sample_rate = "{rate or 1 / solution.scenario.sample_time:.9g} Hz"')
    lines.append("[columns]")
    for channel, unit in zip(drive.channels, drive.units, strict=True):
        given = keys.get("drive_unit", base_unit(unit))
        lines.append(f'"drive.{channel}" = {{ column = "u_{channel}", unit = "{given}" }}')
    for channel, unit in zip(signal.channels, signal.units, strict=True):
        given = keys.get("length_unit", "m") if base_unit(unit) == "m" else base_unit(unit)
        role = "reading" if follow == "pose" else follow
        lines.append(f'"{role}.{channel}" = {{ column = "{channel}", unit = "{given}" }}')
    (folder / "recording.toml").write_text("\n".join(lines) + "\n")
    return folder
