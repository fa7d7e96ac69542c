"""What the tests of the error budget share: uncertain numbers in words, and devices that are driven with other numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from conftest import SCENARIOS

from ctrlgen import build_model, load_scenario, simulate, solve, user_device
from ctrlgen.budget.uncertainty import Uncertainties, load_uncertainties
from ctrlgen.devices.changed_numbers import changed
from ctrlgen.trajectory.scenario import Scenario
from ctrlgen.trajectory.solution import Solution

FILE = SCENARIOS / "circle20" / "uncertainty.toml"
TRANSLATIONS = slice(3, 6)


def driven(
    solution: Solution, numbers: dict[str, float], u: np.ndarray | None = None, warmer: float = 0.0
) -> np.ndarray:
    """The pose (n, 6) in the second of two periods of a device with other `numbers` under the drives of the solution, by the simulator,
    minus that of the device as described; `warmer` [K] is what the heaters then cool to."""
    drives = solution.drive if u is None else u
    device, h, n = solution.model.device, solution.scenario.sample_time, len(drives)
    R = dict(device.quantities())["actuator.thermal_resistance"].si
    poses = []
    for model, given in (
        (build_model(changed(device, numbers)), drives + warmer / R),  # R P = T - T_amb: as much as `warmer` heats
        (solution.model, solution.drive),
    ):
        trace = simulate(model, np.vstack([given, given]), h, solution.trace.x[0])
        poses.append(trace.signals["pose"][n : 2 * n])
    return poses[0] - poses[1]


def stated(solution: Solution, text: str, folder: Path) -> Uncertainties:
    """What `text` says is uncertain."""
    (folder / "stated.toml").write_text(f'title = "stated"\n{text}')
    return load_uncertainties(solution.scenario, solution.model, folder / "stated.toml")


def number(solution: Solution, path: str) -> float:
    return dict(solution.model.device.quantities())[path].si


def largest_nm(deviation: np.ndarray) -> float:
    """The largest deviation of one of the three translations along the path."""
    return 1e9 * float(np.abs(deviation[:, TRANSLATIONS]).max())


def lagging(folder: Path, uncertain: str) -> tuple[Solution, Uncertainties]:
    """Two heaters a and b with a lag of 100 ms, x = g (A + B)/k and y = g (A - B)/k; both powers step from 0 to 10 W in the fifth sample
    of 1 ms and stay, so that each state is 10 W (1 - e^-t/tau)."""
    device = user_device(
        "pair",
        parameters={"g": "0.2 N/W", "k": "1 N/um", "tau": "100 ms"},
        drive={"a": "20 W", "b": "20 W"},
        axes={"x": "50 um", "y": "50 um"},
        state={"A": "20 W", "B": "20 W"},
        force=lambda x, p: [p.g * (x.A + x.B), p.g * (x.A - x.B)],
        restoring_force=lambda d, p: p.k * d.vector,
        rates=lambda u, x, p: [(u.a - x.A) / p.tau, (u.b - x.B) / p.tau],
    )
    risen = 10 * -np.expm1(-np.maximum(np.arange(40) - 4, 0) * 1e-3 / 0.1)
    points = ", ".join(f'{{ x = "{0.4 * float(v)!r} um" }}' for v in risen)
    (folder / "scenario.toml").write_text(
        f'title = "t"\ndevice = "pair"\nsample_rate = "1 kHz"\n[path]\nkind = "poses"\npoints = [{points}]\n'
    )
    (folder / "uncertainty.toml").write_text(f'title = "u"\n{uncertain}')
    scenario = load_scenario(folder, device)
    solution = solve(scenario, build_model(device))
    return solution, load_uncertainties(scenario, solution.model)


def pushed(folder: Path, uncertain: str, micrometres=(10.0, 20.0)) -> tuple[Solution, Uncertainties]:
    """One axis in balance, x = g u/k with 0.2 um/V and drives of -1000 to 1000 V, at some separate positions."""
    device = user_device(
        "axis",
        parameters={"g": "0.2 N/V", "k": "1 N/um"},
        drive={"a": "1000 V"},
        axes={"x": "100 um"},
        force=lambda u, p: [p.g * u.a],
        restoring_force=lambda d, p: p.k * d.vector,
    )
    points = ", ".join(f'{{ x = "{x} um" }}' for x in micrometres)
    (folder / "scenario.toml").write_text(
        f'title = "t"\ndevice = "axis"\n[path]\nkind = "poses"\npoints = [{points}]\n'
    )
    (folder / "uncertainty.toml").write_text(f'title = "u"\n{uncertain}')
    scenario = load_scenario(folder, device)
    solution = solve(scenario, build_model(device))
    return solution, load_uncertainties(scenario, solution.model)


def two_axes(folder: Path) -> Scenario:
    """Four poses round a circle of 10 um, of a stage of two equal axes whose gains are known to 4 %."""
    stage = user_device(
        "stage",
        parameters={"g_x": "0.2 N/V", "g_y": "0.2 N/V", "k": "1 N/um"},
        drive={"x": "1000 V", "y": "1000 V"},
        axes={"x": "50 um", "y": "50 um"},
        force=lambda u, p: [p.g_x * u.x, p.g_y * u.y],
        restoring_force=lambda d, p: p.k * d.vector,
    )
    (folder / "scenario.toml").write_text(
        'title = "round"\ndevice = "stage"\n[path]\nkind = "poses"\n'
        'points = [{ x = "10 um" }, { y = "10 um" }, { x = "-10 um" }, { y = "-10 um" }]\n'
    )
    (folder / "uncertainty.toml").write_text(
        'title = "t"\n[numbers]\n' + "".join(f'"mechanism.g_{a}" = {{ sd = "4 %", source = "s" }}\n' for a in "xy")
    )
    return load_scenario(folder, stage)
