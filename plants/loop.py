"""The whole story on the plant: the C as described, error budget, diagnosis, calibration of another chip, learning, the fastest circle.

The plant's maker knows what ctrlgen's model leaves out, and how the second chip differs from the first; ctrlgen gets recordings and
nothing else. Everything goes through files and the command line. `python -m plants.loop --out out/loop`; some minutes.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

try:
    from plants.bench import DEVICE, commanded, controlled, ctrlgen, driven, played, scenario_of
    from plants.cases import CIRCLE
    from plants.excitation import record
    from plants.learning import EVERY, SENSOR, write_run
    from plants.loop_report import Expected, Measured, Stage, Story, measure, report, rows
    from plants.mems_hexapod import MemsHexapod
    from plants.numbers import read
except ModuleNotFoundError as missing:
    if missing.name not in (None, "exudyn", "exudyn.itemInterface"):
        raise
    raise SystemExit(str(missing)) from None

PRINTED = sum(CIRCLE.values()) / len(CIRCLE)
FIRST, SECOND = "first chip", "second chip"
# Thermal resistances of the second chip over the first's
HEATERS = 1.04 * np.array([1.005, 0.997, 1.002, 0.996, 1.003, 0.999])
RUN_TIME = '\n[run_time]\nconstants = ["actuator.thermal_resistance"]\n'
SHORT = 12  # poses to fit in the recording that a chip is calibrated with
RUNS = 2  # of learning
KEPT = 0.010  # um, by which the fastest circle may leave the path
FAST_RATE = 10_000  # Hz, of its set-points
SLOWER = 1.1  # by which its period is lengthened where it leaves the path by more
MOST_TRIES = 8


@dataclass(frozen=True)
class Loop:
    """What came out: the `story` told on the page, and the period [s] of the `fastest` circle that kept `KEPT`; None where none did."""

    story: Story
    fastest: float | None

    def stage(self, name: str) -> Measured:
        """What came out of the stage with this name."""
        return next(stage.measured for stage in self.story.stages if stage.name == name)


class Steps:
    """Writes one line a step to stderr, with the time since the start."""

    COUNT = 12

    def __init__(self) -> None:
        self.began, self.done = time.monotonic(), 0

    def __call__(self, text: str) -> None:
        """Says what begins."""
        self.done += 1
        print(f"[{self.done}/{self.COUNT}] {time.monotonic() - self.began:4.0f} s  {text}", file=sys.stderr, flush=True)


def second_chip() -> MemsHexapod:
    """A plant whose heaters have other thermal resistances, which ctrlgen is not told."""
    numbers = read()
    numbers.actuator.thermal_resistance = numbers.actuator.thermal_resistance * HEATERS
    return MemsHexapod(numbers=numbers)


def close(out: Path, seed: int = 0) -> Loop:
    """The whole loop into the folder `out`. Raises RuntimeError with what a command said was wrong."""
    out = out.resolve()  # commands run elsewhere
    step, stages, facts = Steps(), list[Stage](), dict[str, str]()
    out.mkdir(parents=True, exist_ok=True)
    chip = MemsHexapod()

    step("solve the circle and generate its C from the device file as printed")
    before = _run(out / "before", DEVICE)
    step("what the error budget expects")
    ctrlgen(
        "budget", str(before.parent / "circle20"), "--uncertainty", str(_uncertainty()), "--out", str(out / "budget")
    )
    expected = _expected(out / "budget" / "budget.json")
    facts["Error budget"] = (
        f"95 % of such chips keep within {1e3 * expected.translation:.0f} nm of the path in each translation."
    )
    step("that C drives the plant")
    stages.append(Stage("as described", FIRST, "C from the device file as printed.", _played(chip, before)))
    step("record poses of the plant")
    poses = record(chip, out / "recording")
    step(f"diagnose {poses} poses")
    words = ["diagnose", str(DEVICE), str(out / "recording"), "--out", str(out / "diagnosis"), "--seed", str(seed)]
    ctrlgen(*words, progress=sys.stderr.isatty())
    diagnosis = json.loads((out / "diagnosis" / "diagnosis.json").read_text(encoding="utf-8"))
    step("solve and generate again from device.next.toml, for constants that are given when it starts")
    device = out / "device.toml"
    device.write_text((out / "diagnosis" / "device.next.toml").read_text(encoding="utf-8") + RUN_TIME, encoding="utf-8")
    after = _run(out / "after", device)
    step("the new C drives the plant")
    about = f"C from device.next.toml, which the diagnosis of {poses} settled poses wrote."
    stages.append(Stage("diagnosed", FIRST, about, _played(chip, after)))

    chip = second_chip()
    step("the same C drives a second chip")
    stages.append(Stage("another chip", SECOND, "The same C; the heaters of this chip differ.", _played(chip, after)))
    step("calibrate it from a short recording, and start the same C with its constants")
    record(chip, out / "short", seed=2, drawn=SHORT)
    ctrlgen("calibrate", str(device), str(out / "short"), "--out", str(out / "calibration"))
    constants = json.loads((out / "calibration" / "constants.json").read_text(encoding="utf-8"))
    facts["Calibration"] = "; ".join(_constant(row) for row in constants["constants"]) + "."
    command = commanded(after / "trajectory.csv")
    powers = controlled(after / "c", out / "calibration" / "constants.h", command)
    case = driven(chip, powers, len(command), command)
    about = f"The same C, started with the constants that {SHORT} settled poses gave."
    stages.append(Stage("calibrated", SECOND, about, measure(case)))

    calibrated = out / "calibration" / "device.calibrated.toml"
    step(f"learn from {RUNS} recorded runs of the circle")
    learnt = _learn(chip, scenario_of(out / "learning", calibrated), out / "learning")[-1]
    about = f"Drives that were learnt from {RUNS} recorded runs, beginning with the calibrated device's."
    stages.append(Stage("learnt", SECOND, about, learnt))

    step("the fastest circle")
    words = [
        "fastest",
        str(out / "learning" / "circle20"),
        "--sample-rate",
        f"{FAST_RATE} Hz",
        "--out",
        str(out / "fastest"),
    ]
    ctrlgen(*words)
    times = json.loads((out / "fastest" / "fastest.json").read_text(encoding="utf-8"))["times"]
    facts["Fastest circle"] = (
        f"within all limits {1e3 * times['even_speed']:.1f} ms at even speed, {1e3 * times['fastest']:.1f} ms by the fastest law of time."
    )
    period, measured = _fastest_kept(chip, calibrated, times["even_speed"], out / "fastest")
    if measured is not None:
        about = f"{1e3 * period:.1f} ms a turn ({1 / period:.1f} Hz), drives learnt from {RUNS} runs."
        stages.append(Stage("fast", SECOND, about, measured))
    step("report")
    story = Story(expected, tuple(stages), diagnosis, facts)
    report(story, out)
    return Loop(story, period if measured is not None else None)


def _run(folder: Path, device: Path) -> Path:
    """The circle for `device` solved, its C in the folder that is returned."""
    scenario = scenario_of(folder, device)
    ctrlgen("run", str(scenario), "--out", str(folder / "run"))
    return folder / "run"


def _uncertainty() -> Path:
    return DEVICE.parent.parent / "circle20" / "uncertainty.toml"


def _expected(path: Path) -> Expected:
    """Half widths of the 95 % band where it is widest, from budget.json."""
    groups = {group["name"]: group for group in json.loads(path.read_text(encoding="utf-8"))["groups"]}
    band = {name: group["band95"] for name, group in groups.items()}
    return Expected(band["translation"] * 1e-3, band["rotation"] * 1e-6)


def _constant(row: dict) -> str:
    low, high = row["interval95"]
    return f"{row['path']} = {row['value']:.4g} {row['unit']} ({low:.4g} ... {high:.4g})"


def _played(chip: MemsHexapod, run: Path) -> Measured:
    return measure(driven(chip, *played(run / "c"), commanded(run / "trajectory.csv")))


def _learn(chip: MemsHexapod, scenario: Path, out: Path, every: int = 10) -> list[Measured]:
    """Runs of a scenario, the first with the drives that ctrlgen solves, the next with those it learns."""
    (scenario / "uncertainty.toml").write_text(SENSOR, encoding="utf-8")
    ctrlgen("solve", str(scenario), "--out", str(out / "solved"))
    ctrlgen("generate", str(scenario), "--player", "--out", str(out / "c0"))
    command = commanded(out / "solved" / "trajectory.csv")
    found, recordings = list[Measured](), list[str]()
    for k in range(RUNS + 1):
        powers, rate = played(out / f"c{k}" if k == 0 else out / f"next{k}" / "c")
        case = driven(chip, powers, rate, command, EVERY)
        found.append(measure(case))
        if k < RUNS:
            recordings.append(str(write_run(out / f"run{k}", powers, rate, case.reached, seed=k)))
            ctrlgen("learn", str(scenario), *recordings, "--out", str(out / f"next{k + 1}"))
    return found


def _fastest_kept(chip: MemsHexapod, device: Path, shortest: float, out: Path) -> tuple[float, Measured | None]:
    """The shortest period [s] tried of a circle at even speed that stays within `KEPT` of the path, and how it was followed."""
    period = shortest
    for k in range(MOST_TRIES):
        samples = EVERY * -(-round(period * FAST_RATE) // EVERY)
        period = samples / FAST_RATE
        scenario = scenario_of(out / f"try{k}", device, f"{period:.6g} s", f"{FAST_RATE} Hz")
        measured = min(_learn(chip, scenario, out / f"try{k}"), key=lambda m: m.distance)
        print(f"    {1e3 * period:.1f} ms: {1e3 * measured.distance:.3g} nm", file=sys.stderr, flush=True)
        if measured.distance <= KEPT:
            return period, measured
        period *= SLOWER
    return period, None


def main(arguments: list[str] | None = None) -> int:
    """Exit 0 when the loop was closed, 1 when a command failed."""
    parser = argparse.ArgumentParser(prog="python -m plants.loop", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/loop"), help="folder of everything written")
    parser.add_argument("--seed", type=int, default=0, help="of the diagnosis")
    given = parser.parse_args(arguments)
    try:
        loop = close(given.out, given.seed)
    except RuntimeError as failure:
        print(failure, file=sys.stderr)
        return 1
    for name, *cells in rows(loop.story.stages):
        print(f"{name:30}" + "".join(f"{cell:>14}" for cell in cells))
    for name, text in loop.story.facts.items():
        print(f"{name}: {text}")
    print(f"verdict: {loop.story.diagnosis['verdict']}")
    for found in loop.story.diagnosis["findings"]:
        numbers = ", ".join(f"{k} = {v['value']:.4g} {v['unit']}" for k, v in found["parameters"].items())
        print(f"  {found['effect']} at {found['location']}: {numbers}")
    print(f"the paper, against its finite elements: {PRINTED:.2f} %\nreport  {given.out / 'report.html'}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
