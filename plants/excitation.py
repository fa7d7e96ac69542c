"""An identification recording of the plant: settled poses under chosen heater powers, written as ctrlgen's recording.toml asks.

To fit: each actuator alone at a few powers, then all six at powers drawn at random. Held out: another class, the six
together along a closed figure. The readings carry the noise of a bench: 20 nm of a capacitive probe
and 10 urad (two seconds of arc) of an autocollimator.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from plants.cases import CHANNELS
from plants.frame import Array
from plants.mems_hexapod import MemsHexapod

POWER = 0.29  # W, the most given; some 180 degC and 36 um
NOISE = (1e-5, 0.02)  # rad, um
ALONE, DRAWN, HELD = 5, 36, 24  # levels of each actuator alone, poses drawn, poses held out
AXES = ("1X", "1Y", "2X", "2Y", "3X", "3Y")
TURNS = (1, 2, 1, 3, 2, 1)  # of each actuator along the figure held out
ABOUT = "settled poses of the independent plant (Exudyn beams): python -m plants.loop"


def powers_to_fit(rng: np.random.Generator) -> Array:
    """(ALONE x 6 + DRAWN, 6) [W]."""
    alone = [level * np.eye(6)[k] for k in range(6) for level in POWER * np.arange(1, ALONE + 1) / ALONE]
    return np.vstack([*alone, rng.uniform(0.0, POWER, (DRAWN, 6))])


def powers_held_out() -> Array:
    """(HELD, 6) [W]: sines of one to three turns about half the power, each actuator with its own phase."""
    turn = 2 * np.pi * np.arange(HELD)[:, None] / HELD
    return POWER / 2 * (1 + 0.8 * np.sin(turn * np.array(TURNS) + np.pi / 3 * np.arange(6)))


def record(plant: MemsHexapod, folder: Path, seed: int = 1, drawn: int | None = None) -> int:
    """Writes fit.csv and hold_out.csv with recording.toml into `folder`; the number of poses. Of a short recording `drawn` poses at random
    are all that there is to fit, and every third of the others is held out. Raises RuntimeError."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    sets = {"fit": powers_to_fit(rng), "hold_out": powers_held_out()}
    if drawn is not None:
        sets = {"fit": rng.uniform(0.0, POWER, (drawn, 6)), "hold_out": powers_held_out()[::3]}
    for k, (role, powers) in enumerate(sets.items()):
        seen = plant.record(powers, 1.0, heat="steady", noise=NOISE, seed=seed + k)
        _within_limits(plant, seen.force, seen.temperature)
        with open(folder / f"{role}.csv", "w", newline="", encoding="utf-8") as file:
            rows = csv.writer(file)
            rows.writerow([*(f"P_{axis}" for axis in AXES), *CHANNELS])
            rows.writerows([f"{value:.12g}" for value in row] for row in np.hstack([powers, seen.measured]))
    (folder / "recording.toml").write_text(_description(), encoding="utf-8")
    return sum(map(len, sets.values()))


def _within_limits(plant: MemsHexapod, forces: Array, temperatures: Array) -> None:
    """No bench would drive its device beyond what its data sheet allows."""
    n = plant.numbers
    states = plant.path(forces)
    largest = {
        "wire stress": (max(plant.stress(s).max() for s in states), n.hexapod.stress_limit),
        "stage displacement": (max(plant.stage_displacements(s).max() for s in states), n.stage.stroke),
        "temperature": (temperatures.max(), n.actuator.temperature_limit),
    }
    over = [name for name, (value, limit) in largest.items() if value > limit]
    if over:
        raise RuntimeError(f"the recording would go beyond the device's {', '.join(over)}; lower POWER")


def _description() -> str:
    lines = ['title  = "settled poses, one actuator and six"', 'device = "mems_hexapod"', f'source = "{ABOUT}"']
    lines += ['kind   = "poses"']
    for role, about in (("fit", "each actuator alone, then six at random"), ("hold_out", "six along a closed figure")):
        lines += ["", f"[[record]] # {about}", f'file = "{role}.csv"', f'role = "{role}"']
    lines += ["", "[columns]"]
    lines += [f'"drive.{axis}" = {{ column = "P_{axis}", unit = "W" }}' for axis in AXES]
    for k, name in enumerate(CHANNELS):
        noise, unit = NOISE[k // 3], ("rad", "um")[k // 3]
        lines.append(f'"reading.{name}" = {{ column = "{name}", unit = "{unit}", noise = "{noise:g} {unit}" }}')
    return "\n".join(lines) + "\n"
