"""A mass on its spring that goes on by itself, and the C of its controller under jumps, resets, late and double calls."""

from __future__ import annotations

import ctypes
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from conftest import AXIS_FILE
from inertial_stages import LINE, scenario
from scipy.linalg import expm

from ctrlgen import build_model
from ctrlgen.controller.controller_step import ControllerStatus
from ctrlgen.controller.motion_estimate import MotionEstimator
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.controller.ringing import TOLD
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.templates import render
from ctrlgen.firmware.online.online import online_context

UNSURE, CLOCK = int(ControllerStatus.UNSURE), int(ControllerStatus.CLOCK)
MASS, DAMPING, STIFFNESS, FORCE = 0.5, 200.0, 2e5, 10.0  # of the shipped axis, with more damping, that it rests sooner
H = 2e-4  # s
DAMPED = AXIS_FILE.read_text().replace('"30 N*s/m", sd = "6 N*s/m"', f'"{DAMPING:g} N*s/m", sd = "20 N*s/m"')


class Compiled:
    """The C of that axis in one arithmetic, and its twin in Python; its structures are C's own."""

    def __init__(self, folder: Path, real: Real, device: str = DAMPED, h: float = H):
        (folder / "device.toml").write_text(device)
        it = scenario(folder, "device.toml", LINE, rate=f"{1 / h!r} Hz")
        controller = controller_of(build_model(it.device), "pose", it.sample_time)
        self.twin, name = MotionEstimator(controller), f"axis{real.suffix}"
        context = online_context(it, controller, real, name)
        for end in ("c", "h"):
            (folder / f"{name}.{end}").write_text(render(f"online.{end}", context))
        self.header = (folder / f"{name}.h").read_text()
        library, source = folder / f"{name}.so", folder / f"{name}.c"
        words = [
            "gcc",
            "-O2",
            "-std=c99",
            "-ffp-contract=off",
            "-shared",
            "-fPIC",
            f"-I{folder}",
            "-o",
            library,
            source,
        ]
        subprocess.run(words, check=True)
        c, number = ctypes.CDLL(str(library)), ctypes.c_float if real is Real.FLOAT else ctypes.c_double

        class State(ctypes.Structure):
            _fields_ = [
                ("x", number),
                ("z", number),
                ("ahead", number * 2),
                ("ringing", number),
                *((word, ctypes.c_uint32) for word in ("ready", "ticking", "tick")),
            ]

        class Output(ctypes.Structure):
            _fields_ = [("drive", number), ("displacement", number)]

        self.state, self.out, self.number = State(), Output(), number
        self.at, self.output = ctypes.byref(self.state), ctypes.byref(self.out)
        self.c_init, call = getattr(c, f"{name}_init_{context['build']}"), lambda what: getattr(c, f"{name}_{what}")
        self.c_step, self.c_settle, self.c_step_at = call("step"), call("settle"), call("step_at")
        self.c_elapsed, self.c_observe, self.c_forget = call("elapsed"), call("observe"), call("forget")

    def step_at(self, tick: int, target: tuple[float, float, float]) -> int:
        return int(self.c_step_at(self.at, ctypes.c_uint32(tick), (self.number * 3)(*target), self.output))

    def step(self, target: tuple[float, float, float]) -> int:
        return int(self.c_step(self.at, (self.number * 3)(*target), self.output))

    def settle(self, target: tuple[float, float, float]) -> int:
        return int(self.c_settle(self.at, (self.number * 3)(*target), self.output))

    def elapsed(self, ticks: int, drive: float) -> int:
        return int(self.c_elapsed(self.at, ctypes.c_uint32(ticks), (self.number * 1)(drive)))

    def observe(self, v: float, z: float, v_error: float, z_error: float) -> int:
        return int(self.c_observe(self.at, *((self.number * 1)(value) for value in (v, z, v_error, z_error))))


@dataclass
class Mass:
    """m z'' + c z' + k z = f u of the device itself, exactly under a held drive; it has stops nowhere."""

    damping: float = DAMPING
    y: np.ndarray = field(default_factory=lambda: np.zeros(2))  # z [m], z' [m/s]
    steps: dict[float, np.ndarray] = field(default_factory=dict)

    def hold(self, drive: float, time: float) -> None:
        if time not in self.steps:
            self.steps[time] = expm(time * np.array([[0, 1], [-STIFFNESS / MASS, -self.damping / MASS]]))
        rest = np.array([FORCE * drive / STIFFNESS, 0.0])
        self.y = rest + self.steps[time] @ (self.y - rest)


@dataclass
class Motion:
    """Two sines whose sum reaches `PEAK`: a target with its derivatives at any time."""

    size: np.ndarray
    rate: np.ndarray
    phase: np.ndarray

    @staticmethod
    def drawn(rng: np.random.Generator) -> Motion:
        share = rng.uniform(0.2, 0.8)
        return Motion(
            rng.choice([0.3, 0.99999]) * 1e-4 * np.array([share, 1 - share]),
            2 * np.pi * rng.uniform(2, 30, 2),
            rng.uniform(0, 6, 2),
        )

    def at(self, t: float) -> tuple[float, float, float]:
        angle = self.rate * t + self.phase
        s, c = self.size * np.sin(angle), self.size * np.cos(angle)
        return float(s.sum()), float((self.rate * c).sum()), float(-(self.rate**2 * s).sum())


@dataclass
class Storm:
    """What came of a storm: of every call with status 0 where the device was in the middle of the sample, and what was promised."""

    calls: int = 0
    events: dict[str, int] = field(default_factory=dict)
    told: int = 0
    true: list[float] = field(default_factory=list)
    promised: list[float] = field(default_factory=list)


def storm(c: Compiled, calls: int, seed: int, tells: bool = True) -> Storm:
    """`calls` calls. Without `tells` a reset is taken for a start at rest, as by a firmware that knows no better."""
    rng, device, found = np.random.default_rng(seed), Mass(), Storm()
    c.c_init(c.at)
    motion, tick, drive, t = Motion(np.zeros(2), np.ones(2), np.zeros(2)), 0, 0.0, 0.0
    kinds = ("jump", "nudge", "reset", "late", "double", "settle", "pushed", "untimed")
    while found.calls < calls:
        event = str(rng.choice(kinds)) if rng.random() < 1 / 130 else ""
        found.events[event] = found.events.get(event, 0) + 1
        if event == "jump":
            motion = Motion.drawn(rng)
        elif event == "nudge":  # a path that goes on a little aside
            motion.phase = motion.phase + rng.normal(size=2) * 10 ** rng.uniform(-5, -1)
        elif event == "reset":  # memory is lost, drives are held or fall to zero, for so long
            drive = drive if rng.random() < 0.5 else 0.0
            down = int(rng.choice([0, 1, 10, 300]))
            for _ in range(down):
                device.hold(drive, H)
            t += down * H
            ctypes.memmove(c.at, rng.bytes(ctypes.sizeof(c.state)), ctypes.sizeof(c.state))
            c.c_init(c.at)
            if tells:
                c.c_forget(c.at)
            if tells and rng.random() < 0.3:  # something senses
                off = np.array([1e-9, 1e-6]) * rng.choice([1.0, 100.0])
                z, v = device.y + off * rng.uniform(-1, 1, 2)
                c.observe(v, z, off[1] * 1.01, off[0] * 1.01)
            tick = int(rng.integers(2**32))
            motion = (
                motion if rng.random() < 0.3 else Motion(np.zeros(2), np.ones(2), np.zeros(2))
            )  # a firmware that begins anew
        elif event == "late":
            missed = int(rng.choice([1, 2, 5, 30, 300]))
            for _ in range(missed):
                device.hold(drive, H)
            t, tick = t + missed * H, tick + missed
        elif event == "settle":
            c.settle(motion.at(t))
            drive, waited = float(c.out.drive), int(rng.choice([1, 20, 400]))
            for _ in range(waited):
                device.hold(drive, H)
            if tells:  # without the sample of settle itself
                c.elapsed(waited - 1, drive)
            t, tick = t + waited * H, tick + waited
        elif event == "pushed":  # asked for more than its drives can
            status = c.step_at(tick := (tick + 1) % 2**32, (0.0, 0.0, 500.0))
            drive, t = float(c.out.drive), t + H
            device.hold(drive, H)
        tick, target = (tick + 1) % 2**32, motion.at(t + H / 2)
        # "untimed": a call without the clock, which counts it as a sample
        status = c.step(target) if event == "untimed" else c.step_at(tick, target)
        found.calls += 1
        drive = float(c.out.drive)
        if event == "double":  # the same sample again, for another target: refused
            told = CLOCK | (UNSURE if c.state.ringing > TOLD else 0)
            twice = c.step_at(tick, (0.0, 0.0, 0.0))
            assert (twice, float(c.out.drive)) == (told, drive)
        device.hold(drive, H / 2)
        if status in (0, CLOCK):  # late, and made up for
            found.true.append(float(device.y[0]))
            found.promised.append(float(c.out.displacement))
        found.told += bool(status & UNSURE)
        device.hold(drive, H / 2)
        t += H
    return found
