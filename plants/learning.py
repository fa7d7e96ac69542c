"""Learns the circle on the plant: generated C -> plant -> recorded run -> ctrlgen learn -> the next C -> plant, and so on.

ctrlgen gets the recorded runs and nothing else, no diagnosis; everything goes through files and the command line.
`python -m plants.learning --out out/learning`; some minutes.
"""

from __future__ import annotations

import argparse
import csv
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

try:
    from plants.bench import DEVICE, ctrlgen, played, scenario_of
    from plants.cases import CHANNELS, CIRCLE, Case, table
    from plants.excitation import AXES, NOISE
    from plants.frame import Array
    from plants.imperfect import Imperfect
    from plants.loop_report import Measured, measure
except ModuleNotFoundError as missing:
    if missing.name not in (None, "exudyn", "exudyn.itemInterface"):
        raise
    raise SystemExit(str(missing)) from None

# One pose in so many samples is solved for; those between are on the periodic cubic through them, to a few pm
EVERY = 5
# The bench's readings are right but for their noise, and it says so
SENSOR = """title = "a calibrated bench"
[sensor]
scale = { sd = "0.001 %", source = "simulated" }
clock = { sd = "1 ns", source = "simulated" }
"""
PERIODS = 5  # of the circle in a recording
MOST_RUNS = 3
BENCHES = {
    "as described": Imperfect,
    "friction and hysteresis": lambda: Imperfect(friction=2e-4, hysteresis=0.05),
    "an actuator reversed": lambda: Imperfect(reversed=(0,)),
    "two actuators exchanged": lambda: Imperfect(exchanged=(2, 3)),
}


@dataclass(frozen=True)
class Learnt:
    """What the plant did in each run, and what ctrlgen said at the end where it refused; empty where it did not."""

    runs: tuple[Measured, ...]
    refused: str


def solved(out: Path, device: Path = DEVICE) -> Path:
    """The folder of the circle's scenario for `device`; `run` in it holds trajectory.csv and the player's C. Raises RuntimeError."""
    scenario = scenario_of(out, device)
    (scenario / "uncertainty.toml").write_text(SENSOR, encoding="utf-8")
    ctrlgen("solve", str(scenario), "--out", str(scenario / "run"))
    ctrlgen("generate", str(scenario), "--player", "--out", str(scenario / "c"))
    return scenario


def learn(bench: Imperfect, scenario: Path, out: Path, runs: int = MOST_RUNS) -> Learnt:
    """Runs the circle of a `solved` scenario, then as often as `runs` says with the drives that were learnt, into the folder `out`. Raises
    RuntimeError with what a command said was wrong, but for a refusal to learn after a first step."""
    columns = table(scenario / "run" / "trajectory.csv")
    command = np.column_stack([columns[name] for name in CHANNELS])[::EVERY]
    player, found, recordings = scenario / "c", list[Measured](), list[str]()
    for k in range(runs + 1):
        powers, rate = played(player)
        poses = bench.poses(powers, rate, EVERY)
        found.append(measure(Case(command, poses)))
        recordings.append(str(write_run(out / f"run{k}", powers, rate, poses, seed=k)))
        if k == runs:
            break
        try:
            ctrlgen("learn", str(scenario), *recordings, "--out", str(out / f"learning{k}"))
        except RuntimeError as refusal:
            if k == 0:
                raise
            return Learnt(tuple(found), str(refusal))
        player = out / f"learning{k}" / "c"
    return Learnt(tuple(found), "")


def write_run(folder: Path, powers: Array, rate: float, poses: Array, seed: int) -> Path:
    """A recording of `PERIODS` periods: every power and every pose with the noise of the sensor; its folder."""
    folder.mkdir(parents=True, exist_ok=True)
    rng, n = np.random.default_rng([seed, 17]), len(powers)
    through = CubicSpline(np.arange(0, n + 1, EVERY), np.vstack([poses, poses[:1]]), bc_type="periodic")
    read = np.tile(through(np.arange(n)), (PERIODS, 1))
    read = read + rng.standard_normal(read.shape) * np.repeat(NOISE, 3)
    with open(folder / "run.csv", "w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow([*(f"P_{axis}" for axis in AXES), *CHANNELS])
        rows.writerows([f"{v:.12g}" for v in row] for row in np.hstack([np.tile(powers, (PERIODS, 1)), read]))
    lines = [
        'title  = "the circle on the independent plant"',
        'device = "mems_hexapod"',
        'kind   = "series"',
        "",
        "[[record]]",
    ]
    lines += [
        'file = "run.csv"',
        'role = "fit"',
        f'sample_rate = "{rate:g} Hz"',
        'between_samples = "held"',
        "",
        "[columns]",
    ]
    lines += [f'"drive.{axis}" = {{ column = "P_{axis}", unit = "W" }}' for axis in AXES]
    lines += [f'"reading.{c}" = {{ column = "{c}", unit = "{("rad", "um")[k // 3]}" }}' for k, c in enumerate(CHANNELS)]
    (folder / "recording.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder


def main(arguments: list[str] | None = None) -> int:
    """Exit 0 when every bench was run, 1 when a command failed."""
    parser = argparse.ArgumentParser(prog="python -m plants.learning", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/learning"), help="folder of everything written")
    parser.add_argument("--bench", choices=list(BENCHES), help="this one alone")
    given = parser.parse_args(arguments)
    try:
        scenario = solved(given.out.resolve())
    except RuntimeError as failure:
        print(failure, file=sys.stderr)
        return 1
    for name in [given.bench] if given.bench else BENCHES:
        print(name, file=sys.stderr, flush=True)
        try:
            learnt = learn(BENCHES[name](), scenario, (given.out / name.replace(" ", "_")).resolve())
        except RuntimeError as failure:
            print(failure, file=sys.stderr)
            return 1
        print(f"{name:28}" + "".join(f"{m.overall:10.4f} %" for m in learnt.runs))
        for k, m in enumerate(learnt.runs):
            print(f"  run {k}: largest error " + ", ".join(f"{c} {1e3 * m.largest[c]:.1f} nm" for c in CIRCLE))
        if learnt.refused:
            print(f"  refused: {learnt.refused}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
