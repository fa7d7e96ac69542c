"""Whole diagnoses of 20 000 samples to fit and as many held out: one axis with one cause and with three, six channels of a hexapod.

Each runs in a process of its own without forks, so that processor time and peak memory are its own; a cache of compiled code is not
used.
"""

from __future__ import annotations

import os
import resource
import tempfile
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from battery.axis_cases import Bench, Take, draw_noise, write_bench
from battery.hexapod_cases import SD, PoseBench, device_text, write_poses
from battery.plant_axis import Axis, Planted, Scene
from battery.plant_hexapod import AXES, Faults, Hexapod, changed
from benchmarks.measure import Note, peak_memory
from benchmarks.samples import Disagreement
from ctrlgen import build_model, diagnose, load_device
from ctrlgen.recordings.reader import load_recordings
from plants.numbers import read

H, SAMPLES, NOISE = 1e-3, 20_000, 5e-9
MEMORY_AIM = 1536.0  # MB
STIFFENING = Planted("stiffening", 2e4, {"scale": 6e-5, "quintic": 0.0})
FRICTION = Planted("coulomb", 0.2, {"presliding": 6e-8})
CREEP = Planted("creep", 0.02, {"tau": 0.6, "second": 3.0})


@dataclass(frozen=True)
class Goal:
    """A case with what writes its files, the effects that each planted cause may be named, and the processor time [s] it may take."""

    name: str
    write: Callable[[Path], None]
    effects: tuple[frozenset[str], ...]
    aim: float


def _axis(folder: Path, planted: tuple[Planted, ...]) -> None:
    """An axis whose numbers are stated a per cent or three off."""
    axis, t, rng = Axis(0.5, 30.0, 2e5, 10.0, 1e-4, 3.0), H * np.arange(SAMPLES), np.random.default_rng(5)
    stated = replace(axis, mass=0.495, damping=31.0, stiffness=2.03e5, force_constant=9.95)
    takes = []
    for k, (role, slow, fast) in enumerate((("fit", 2.3, 13.1), ("hold_out", 1.7, 9.7))):
        u = 1.4 * np.sin(2 * np.pi * slow * t) + 0.3 * np.sin(2 * np.pi * fast * t + 1)
        u *= 0.7 + 0.3 * np.sin(2 * np.pi * 0.11 * t)
        takes.append(Take(role, u, draw_noise(rng, NOISE, 0.0, SAMPLES), None, 20.5 * k))
    bench = Bench(axis, stated, Scene(axis, noise=NOISE, sample_time=H), tuple(takes), False, True)
    write_bench(folder, bench, list(planted))


def _hexapod(folder: Path) -> None:
    """The MEMS hexapod, one stage of which moves with its other axis."""
    rng, sd, t = np.random.default_rng(5), (2e-6, 0.02), H * np.arange(SAMPLES)[:, None]
    shares = {path: s * float(np.clip(rng.standard_normal(), -1.5, 1.5)) for path, s in SD.items()}
    drives, axes = {}, np.arange(6)
    for k, role in enumerate(("fit", "hold_out")):
        slow, fast = 0.3 + 0.07 * axes + 0.02 * k, 4.0 + 1.3 * axes - 0.3 * k
        drives[role] = 0.28 + 0.14 * np.sin(2 * np.pi * slow * t + k) + 0.07 * np.sin(2 * np.pi * fast * t)
    noise = {role: rng.standard_normal((SAMPLES, 6)) * np.repeat(sd, 3) for role in drives}
    plant = Hexapod(changed(read(), shares), Faults(coupling=np.array([0, 0, 0.02, 0, 0, 0])))
    readings = {role: plant.series(u, H, linear=True) + noise[role] for role, u in drives.items()}
    columns = {f"P_{axis}": axis for axis in AXES}
    bench = PoseBench(drives, noise, shares, sd, True)
    write_poses(folder, device_text(), "mems_hexapod", columns, "W", bench, readings, period=H)


GOALS = (
    Goal("20 000 x 1, one cause", lambda folder: _axis(folder, (STIFFENING,)), (frozenset({"stiffening"}),), 40.0),
    Goal("20 000 x 6, one cause", _hexapod, (frozenset({"coupling"}),), 90.0),
    Goal(
        "20 000 x 1, three causes",
        lambda folder: _axis(folder, (FRICTION, replace(STIFFENING, amplitude=1e4), CREEP)),
        (frozenset({"coulomb", "stribeck"}), frozenset({"stiffening"}), frozenset({"creep", "log_creep"})),
        180.0,
    ),
)


def measured(k: int) -> tuple[float, float, list[str]]:
    """Processor time [s] of one goal with the compilers it called, peak memory [MB], and the effects found."""
    os.environ["CTRLGEN_JOBS"] = "1"
    with tempfile.TemporaryDirectory() as folder:
        os.environ["XDG_CACHE_HOME"] = f"{folder}/cache"
        case = Path(folder, "case")
        GOALS[k].write(case)
        device = load_device(case / "device.toml")
        recording = load_recordings([case / "recording.toml"], build_model(device))
        begin = _processor_time()
        found = diagnose(device, recording, jobs=0)
        seconds = _processor_time() - begin
    peak = peak_memory()
    return seconds, peak, [cause.effect for cause in found.search.chosen.fit.structure.causes]


def _processor_time() -> float:
    usages = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


def goals() -> list[Note]:
    """A line for each goal: processor time and peak memory, with their aims."""
    notes = []
    for k, goal in enumerate(GOALS):
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
            seconds, peak, effects = pool.submit(measured, k).result()
        if not all(named & set(effects) for named in goal.effects):
            raise Disagreement(f"{goal.name}: the diagnosis says {', '.join(effects) or 'nothing'}")
        told = f"{seconds:.0f} s of processor time (aim: < {goal.aim:.0f} s), peak {peak:.0f} MB (aim: < {MEMORY_AIM:.0f} MB)"
        notes.append(Note(f"diagnosis, {goal.name}: {told}; {', '.join(effects)}"))
    return notes
