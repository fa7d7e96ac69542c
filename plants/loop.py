"""Closes the loop on the plant: generated C -> plant -> recording -> ctrlgen diagnose -> corrected device -> generated C -> plant.

The plant's maker knows what ctrlgen's model leaves out; ctrlgen gets the recording and nothing else. Everything goes
through files and the command line. `python -m plants.loop --out out/loop`; some minutes.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import sys
import time
from dataclasses import dataclass
from pathlib import Path

try:
    from plants.bench import ctrlgen, driven
    from plants.cases import CIRCLE, ROOT, Case
    from plants.excitation import record
    from plants.loop_report import Measured, measure, report, rows
    from plants.mems_hexapod import MemsHexapod
except ModuleNotFoundError as missing:
    if missing.name not in (None, "exudyn", "exudyn.itemInterface"):
        raise
    raise SystemExit(str(missing)) from None

SCENARIO = ROOT / "scenarios" / "circle20"
DEVICE = ROOT / "scenarios" / "devices" / "mems_hexapod.toml"
PRINTED = sum(CIRCLE.values()) / len(CIRCLE)


@dataclass(frozen=True)
class Loop:
    """What came out: the circle `before` and `after` the correction, and diagnosis.json."""

    before: Measured
    after: Measured
    diagnosis: dict


class Steps:
    """One line a step on stderr, with the time since the start."""

    COUNT = 7

    def __init__(self) -> None:
        self.began, self.done = time.monotonic(), 0

    def __call__(self, text: str) -> None:
        """Says what begins."""
        self.done += 1
        print(f"[{self.done}/{self.COUNT}] {time.monotonic() - self.began:4.0f} s  {text}", file=sys.stderr, flush=True)


def close(out: Path, seed: int = 0) -> Loop:
    """The whole loop into the folder `out`. Raises RuntimeError with what a command said was wrong."""
    out = out.resolve()  # commands run elsewhere
    step = Steps()
    out.mkdir(parents=True, exist_ok=True)
    plant = MemsHexapod()
    step("solve the circle and generate its C from the device file as printed")
    scenario = scenario_of(out / "before", DEVICE)
    ctrlgen("run", str(scenario), "--out", str(out / "before" / "run"))
    step("that C drives the plant")
    before = _measured(plant, out / "before" / "run")
    step("record poses of the plant")
    poses = record(plant, out / "recording")
    step(f"diagnose {poses} poses")
    words = ["diagnose", str(DEVICE), str(out / "recording"), "--out", str(out / "diagnosis"), "--seed", str(seed)]
    ctrlgen(*words, progress=sys.stderr.isatty())
    diagnosis = json.loads((out / "diagnosis" / "diagnosis.json").read_text(encoding="utf-8"))
    step("solve and generate again from device.next.toml")
    scenario = scenario_of(out / "after", out / "diagnosis" / "device.next.toml")
    ctrlgen("run", str(scenario), "--out", str(out / "after" / "run"))
    step("the new C drives the plant")
    after = _measured(plant, out / "after" / "run")
    step("report")
    loop = Loop(before, after, diagnosis)
    report(loop.before, loop.after, diagnosis, out)
    return loop


def _measured(plant: MemsHexapod, run: Path) -> Measured:
    case: Case = driven(plant, run / "c", run / "trajectory.csv")
    return measure(case)


def scenario_of(folder: Path, device: Path) -> Path:
    """The circle's scenario with a copy of `device` beside it; without its [[expect]], which the printed device alone meets."""
    text = (SCENARIO / "scenario.toml").read_text(encoding="utf-8").partition("# What must come out")[0]
    here = folder / SCENARIO.name
    here.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(device, here / "device.toml")
    (here / "scenario.toml").write_text(re.sub(r"(?m)^device = .*$", 'device = "device.toml"', text), encoding="utf-8")
    return here


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
    for name, *cells in rows(loop.before, loop.after):
        print(f"{name:28}" + "".join(f"{cell:>14}" for cell in cells))
    print(f"verdict: {loop.diagnosis['verdict']}")
    for found in loop.diagnosis["findings"]:
        numbers = ", ".join(f"{k} = {v['value']:.4g} {v['unit']}" for k, v in found["parameters"].items())
        print(f"  {found['effect']} at {found['location']}: {numbers}")
    print(f"the paper, against its finite elements: {PRINTED:.2f} %\nreport  {given.out / 'report.html'}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
