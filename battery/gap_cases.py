"""The class `gaps`: a case with memory four times over: whole, and with rows missing in three ways."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np

from battery import axis_cases, messy, rough_cases, servo_cases
from battery.axis_cases import Bench, Rng

WAYS = ("none", "single", "runs", "long")  # rows missing: none, 1 % one by one, 1 % in runs, one long gap
LAWS = ("hysteresis", "play_stack", "bouc_wen_motion", "three_relaxations", "log_creep", "free_play", "thermal_lag")
NEEDS_FORCE = ("hysteresis",)  # not where the axis has no mass
SECONDS = 4.0
SIZE = (10.0, 300.0)
MISSING, RUNS, LONG = 0.01, (2, 8), 0.05


def plan(rng: Rng, count: int) -> list[tuple[str, ...]]:
    """Device, law, way, and the seed that the four of a set have in common."""
    rooms = [(d, n) for d, n in product(("axis", "servo"), LAWS) if d == "axis" or n not in NEEDS_FORCE]
    order, out = rng.permutation(len(rooms)).tolist(), []
    for k in range(-(-count // len(WAYS))):
        seed = str(int(rng.integers(2**31)))
        out += [(*rooms[order[k % len(rooms)]], way, seed) for way in WAYS]
    return out[:count]


def make(wanted: tuple[str, ...], _: Rng) -> rough_cases.Made:
    """One of a set, drawn from the seed of the set."""
    device, law, way, seed = wanted
    rng = np.random.default_rng(int(seed))

    def once() -> rough_cases.Made:
        servo = device == "servo"
        bench = servo_cases.draw_bench(rng, 10 * SECONDS) if servo else smooth(rng, axis_cases.draw_bench(rng, SECONDS))
        bench, planted, answer = rough_cases.on_axis(bench, device, (law,), rng, SIZE)

        def write(folder: Path) -> None:
            messy.write(folder, bench, planted)
            for k, path in enumerate(sorted(folder.glob("record_*.csv"))):
                cut(path, way, np.random.default_rng([int(seed), WAYS.index(way), k]))

        return write, answer | {"set": seed, "way": way}

    return rough_cases.until(once, wanted)


def smooth(rng: Rng, bench: Bench) -> Bench:
    """The same bench under drives that a few samples tell between: moves from level to level."""
    dt, level = bench.scene.sample_time, float(np.abs(bench.fit.drive).max())
    takes = []
    for take in bench.takes:
        reach, pace = (0.9, 6.0) if take.role == "fit" else (0.75, 9.0)
        drive = axis_cases.moves(rng, len(take.drive), dt, reach * level, pace * level)
        takes.append(take if take.role == "rest" else replace(take, drive=drive))
    scene = axis_cases.scene_of(bench.axis, takes[-2].drive, bench.scene.noise, bench.scene.span, dt)
    return replace(bench, takes=tuple(takes), scene=scene)


def missing(n: int, way: str, rng: Rng) -> np.ndarray:
    """(n,) which rows are missing; the first and the last ten never are."""
    gone = np.zeros(n, bool)
    if way == "long":
        begin = int(n * rng.uniform(0.3, 0.6))
        gone[begin : begin + round(LONG * n)] = True
    if way == "single":
        gone[rng.choice(np.arange(10, n - 10), round(MISSING * n), replace=False)] = True
    while way == "runs" and gone.sum() < round(MISSING * n):
        begin = int(rng.integers(10, n - 10 - RUNS[1]))
        gone[begin : begin + int(rng.integers(*RUNS))] = True
    return gone


def cut(path: Path, way: str, rng: Rng) -> None:
    """Takes rows out of a CSV."""
    header, *rows = path.read_text().splitlines(keepends=True)
    gone = missing(len(rows), way, rng)
    path.write_text("".join([header, *(row for row, out in zip(rows, gone.tolist(), strict=True) if not out)]))
