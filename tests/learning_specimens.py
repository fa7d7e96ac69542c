"""Specimens of the independent plant on benches that are wrong somewhere; what is true is known here alone.

Numbers of the chip, friction and hysteresis, noise and drift, scale of the sensor are drawn by a seed; every fourth specimen has a fault in
its second run, which is of another path, or another run's readings, and must be refused; others are late there or have another zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from learning_bench import write
from scipy.interpolate import CubicSpline

from ctrlgen import InputError
from ctrlgen.budget.sensor_statement import Known, SensorStatement
from ctrlgen.learning.learn import learn_recorded
from ctrlgen.learning.lifted import Lifted
from plants.cases import Case
from plants.imperfect import Imperfect
from plants.loop_report import measure
from plants.mems_hexapod import MemsHexapod

EVERY = 10  # one pose in so many samples is solved for; between them readings and truth are on one periodic cubic
PERIODS = 25  # with 200 samples as many rows as five periods at 1 kHz
RUNS = 3  # learnt, at most
UNITS = np.repeat([1.0, 1e-6], 3)  # of the plant's poses
NOISE = np.repeat([1e-5, 2e-8], 3)
FAULTS = ("", "late", "path", "zero", "", "", "reading", "")
CALIBRATED = SensorStatement(Known(1e-5, "0.001 %", "calibrated"), clock=Known(1e-9, "1 ns", "one trigger"))


@dataclass
class Outcome:
    """What became of a specimen: its true errors run by run, S1's mean of three translations [%]; its `fault`, whether that was refused,
    and what else was; whether its sensor was stated as `calibrated`, and which friction it has [N] and
    which `noise`, times `NOISE`."""

    seed: int
    errors: list[float]
    fault: str
    refused: bool
    wrongly_refused: str
    calibrated: bool
    friction: float
    noise: float


class Specimen:
    """One chip on one bench, drawn by `seed`."""

    def __init__(self, seed: int) -> None:
        self.rng = rng = np.random.default_rng([seed, 31])
        self.seed, self.fault, self.calibrated = seed, FAULTS[seed % len(FAULTS)], bool(seed // len(FAULTS) % 2)
        plant = MemsHexapod()
        a = plant.numbers.actuator
        a.thermal_resistance *= 1 + 0.02 * rng.standard_normal()
        a.expansion *= 1 + 0.01 * rng.standard_normal()
        a.time_constant *= 1 + 0.05 * rng.standard_normal()
        friction, hysteresis = float(rng.choice([0.0, 0.0, 5e-5, 2e-4])), float(rng.choice([0.0, 0.02]))
        self.plant = Imperfect(plant, friction=friction, hysteresis=hysteresis)
        self.scale = 1 + (1e-5 if self.calibrated else 5e-3) * np.clip(rng.standard_normal(6), -2, 2)
        self.drift = np.where(rng.random() < 0.3, 1.0, 0.0) * rng.normal(0, [0, 0, 0, 6e-9, 6e-9, 6e-9])
        self.noise = float(rng.choice([0.3, 1.0, 3.0]))
        self.zero = rng.normal(0, [1e-4, 1e-4, 1e-4, 3e-7, 3e-7, 3e-7])
        self.late = int(rng.integers(1, 4))

    def poses(self, drive: np.ndarray, rate: float) -> np.ndarray:
        """(n, 6) [rad, m] the true poses of one period, once they repeat."""
        n, found = len(drive), self.plant.poses(drive, rate, EVERY) * UNITS
        return CubicSpline(np.arange(0, n + 1, EVERY), np.vstack([found, found[:1]]), bc_type="periodic")(np.arange(n))

    def reading(self, poses: np.ndarray, fault: str) -> np.ndarray:
        """(PERIODS n, 6) what the sensor makes of the true poses (n, 6) of a period."""
        n, rng = len(poses), self.rng
        y = np.tile(poses * self.scale, (PERIODS, 1))
        if fault == "reading":  # of a run of another path: turned about, and smaller
            y = np.tile((0.75 * poses[::-1] + 0.25 * poses.mean(axis=0)) * self.scale, (PERIODS, 1))
        if fault == "late":
            y = np.roll(y, self.late, axis=0)
        if fault == "zero":
            y = y + self.zero
        y = y + np.arange(PERIODS * n)[:, None] / n * self.drift
        return y + self.noise * NOISE * rng.standard_normal(y.shape)

    def learnt(self, lifted: Lifted, other: np.ndarray, folder: Path) -> Outcome:
        """Learns the path of `lifted`; `other` (n, n_u) are drives of another path. A run that is refused is left out and run again."""
        rate, command = 1 / lifted.sample_time, lifted.solution.command
        stated = CALIBRATED if self.calibrated else SensorStatement()
        out = Outcome(self.seed, [], self.fault, False, "", self.calibrated, self.plant.friction, self.noise)
        drive, recordings, tries = lifted.solution.drive, list[Path](), 0
        for k in range(RUNS + 1):
            poses = self.poses(drive, rate)
            out.errors.append(measure(Case(command / UNITS, poses / UNITS)).overall)
            if k == RUNS:
                break
            fault = self.fault if k == 1 else ""
            while True:
                played = other if fault == "path" else drive
                seen = self.reading(self.poses(other, rate) if fault == "path" else poses, fault)
                folder_of = write(folder / f"{tries}", lifted.solution, np.tile(played, (PERIODS, 1)), seen)
                tries += 1
                try:
                    found = learn_recorded(lifted, stated, [*recordings, folder_of])
                    break
                except InputError as refusal:
                    if fault not in ("path", "reading"):
                        out.wrongly_refused = str(refusal)
                        return out
                    out.refused, fault = True, ""
            recordings.append(folder_of)
            if found.stop:
                if found.next.drive is not drive:
                    out.errors.append(
                        measure(Case(command / UNITS, self.poses(found.next.drive, rate) / UNITS)).overall
                    )
                break
            drive = found.next.drive
        return out


def battery(seeds: Sequence[int], lifted: Lifted, other: np.ndarray, folder: Path) -> list[Outcome]:
    """The outcomes of all specimens."""
    return [Specimen(seed).learnt(lifted, other, folder / f"{seed}") for seed in seeds]
