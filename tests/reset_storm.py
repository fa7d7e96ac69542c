"""A controller's C and its Python twin under resets, late and double calls; a device that goes on by itself meanwhile."""

from __future__ import annotations

import ctypes
import subprocess
from dataclasses import dataclass, field, replace
from pathlib import Path

import casadi as ca
import numpy as np
from conftest import SCENARIOS

from ctrlgen import Controller, build_model, generate, load_scenario
from ctrlgen.controller.controller_step import ControllerStatus
from ctrlgen.controller.estimate import Estimator
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.folder import CFolder

UNSURE, CLOCK, INPUT, LOST = (int(ControllerStatus[name]) for name in ("UNSURE", "CLOCK", "INPUT", "LOST"))
N = 6


class Compiled:
    """The C of circle20's controller in one arithmetic, called as a firmware does; its state and output are C's own structures."""

    def __init__(self, real: Real, made: CFolder, controller: Controller):
        self.twin, self.model = Estimator(controller), controller.kernels.model
        name, library = made.online[real], made.path / f"{real.suffix}.so"
        command = [
            "gcc",
            "-O2",
            "-std=c99",
            "-ffp-contract=off",
            "-shared",
            "-fPIC",
            f"-I{made.path}",
            "-o",
            str(library),
        ]
        subprocess.run([*command, str(made.path / f"{name}.c")], check=True)
        c, number = ctypes.CDLL(str(library)), ctypes.c_float if real is Real.FLOAT else ctypes.c_double
        six, varies = number * N, controller.kernels.times is not None

        class State(ctypes.Structure):
            _fields_ = [
                ("x", six),
                ("z", six),
                *((("x_begun", six), ("z_begun", six), ("h", number)) if varies else ()),
                *((word, ctypes.c_uint32) for word in ("ready", "unsure", "ticking", "tick")),
                *((("stepping", ctypes.c_uint32),) if varies else ()),
            ]

        class Output(ctypes.Structure):
            _fields_ = [("drive", six), ("displacement", six), ("state", six)]

        self.state, self.out, self.six = State(), Output(), six
        self.at, self.output = ctypes.byref(self.state), ctypes.byref(self.out)
        self.c_init, call = getattr(c, made.init[real]), lambda what: getattr(c, f"{name}_{what}")
        self.c_step, self.c_settle, self.c_step_at = call("step"), call("settle"), call("step_at")
        self.c_elapsed, self.c_observe, self.c_forget = call("elapsed"), call("observe"), call("forget")
        if varies:
            self.c_step_after = call("step_after")
            self.c_step_after.argtypes = [ctypes.c_void_p, number, number, ctypes.c_void_p, ctypes.c_void_p]
        self.c_observe.argtypes = [ctypes.c_void_p, ctypes.c_void_p, number]

    def vector(self, values: np.ndarray) -> ctypes.Array:
        return self.six(*values)

    def step_at(self, tick: int, target: np.ndarray) -> int:
        return int(self.c_step_at(self.at, ctypes.c_uint32(tick), self.vector(target), self.output))

    def step(self, target: np.ndarray) -> int:
        return int(self.c_step(self.at, self.vector(target), self.output))

    def step_after(self, since: float, ahead: float, target: np.ndarray) -> int:
        return int(self.c_step_after(self.at, since, ahead, self.vector(target), self.output))

    def settle(self, target: np.ndarray) -> int:
        return int(self.c_settle(self.at, self.vector(target), self.output))

    def elapsed(self, ticks: int, drive: np.ndarray) -> int:
        return int(self.c_elapsed(self.at, ctypes.c_uint32(ticks), self.vector(drive)))

    def observe(self, measured: np.ndarray, error: float) -> int:
        return int(self.c_observe(self.at, self.vector(measured), error))


def compiled(folder: Path, times: tuple[str, str] | None = None) -> dict[Real, Compiled]:
    """The controller of circle20, generated once, in each arithmetic; with sample times that vary between `times`."""
    scenario = load_scenario(SCENARIOS / "circle20")
    if times is not None:
        file = scenario.file.model_dump() | {"sample_times": times}
        scenario = replace(scenario, file=type(scenario.file).model_validate(file))
    model = build_model(scenario.device)
    controller = controller_of(model, scenario.file.follow, scenario.sample_time, times=scenario.sample_times)
    made = generate(scenario, model, folder)
    return {real: Compiled(real, made, controller) for real in Real}


@dataclass
class Heaters:
    """Six temperatures [K] of the device itself, by T' = (T_rest + R P - T)/tau, whatever a controller believes."""

    rest: float = 295.15
    per_watt: float = 550.0
    decay: float = float(np.exp(-1e-3 / 5e-3))
    T: np.ndarray = field(default_factory=lambda: np.full(N, 295.15))

    def hold(self, power: np.ndarray, samples: int = 1) -> None:
        steady = self.rest + self.per_watt * power
        self.T = steady + (self.T - steady) * self.decay**samples


@dataclass
class Storm:
    """What came of a storm: of every call with status 0 the temperatures one sample on and the displacement that was promised."""

    calls: int = 0
    resets: int = 0
    late: int = 0
    double: int = 0
    untimed: int = 0
    told: int = 0  # calls with UNSURE
    promised: list[np.ndarray] = field(default_factory=list)
    hot: list[np.ndarray] = field(default_factory=list)


def poses(c: Compiled, rng: np.random.Generator, count: int) -> np.ndarray:
    """Poses of displacements within their range, and some a little beyond."""
    m = c.model
    low, high = m.z_bounds
    followed = ca.Function("pose", [m.x, m.z, m.u], [m.signals["pose"].expr])
    z = low + (high - low) * rng.uniform(-0.02, 1.02, (count, N))
    return followed.map(count)(np.tile(m.rest[:, None], count), z.T, np.zeros((N, count))).full().T


def storm(c: Compiled, calls: int, seed: int, forgets: bool = True) -> Storm:
    """`calls` calls, between them resets with memory that is lost, calls that are late and that come twice, temperatures that are measured.
    Without `forgets` a reset is taken for a cold start, as a firmware does that knows no better."""
    rng, device, found = np.random.default_rng(seed), Heaters(), Storm()
    targets = poses(c, rng, 512)
    c.c_init(c.at)
    drive, tick, target = np.zeros(N), int(rng.integers(2**32)), targets[0]
    settling = c.twin.bounds.settling
    while found.calls < calls:
        event = rng.random()
        if event < 0.02:  # memory is lost, drives are held or fall to zero, for so long
            found.resets += 1
            down, dropped = int(rng.choice([0, 1, 10, 100])), rng.random() < 0.5
            drive = np.zeros(N) if dropped else drive
            device.hold(drive, down)
            ctypes.memmove(c.at, rng.bytes(ctypes.sizeof(c.state)), ctypes.sizeof(c.state))
            c.c_init(c.at)
            if forgets and not (dropped and down >= settling):
                c.c_forget(c.at)
            if rng.random() < 0.3:
                error = float(rng.choice([0.0, 0.5, 20.0]))
                c.observe(device.T + error * rng.uniform(-1, 1, N), error + 1e-3)
            tick = int(rng.integers(2**32))
        elif event < 0.06:  # calls are missed
            found.late += 1
            missed = int(rng.choice([1, 2, 5, 30, 90, 300]))
            device.hold(drive, missed)
            tick += missed
        if rng.random() < 0.1:
            target = targets[rng.integers(len(targets))]
        if event > 0.99:  # the equilibrium is asked for, and the path goes on at once or after some time
            c.settle(target)
            waited = int(rng.choice([0, 1, 20, 100]))
            drive = np.array(c.out.drive)
            device.hold(drive, 1 + waited)
            if rng.random() < 0.5:  # told, or found by the clock
                c.elapsed(waited, drive)
            tick += 1 + waited
        tick = (tick + 1) % 2**32
        untimed = 0.96 < event < 0.98  # a call without the clock, which counts it as a sample
        status = c.step(target) if untimed else c.step_at(tick, target)
        found.untimed += untimed
        found.calls += 1
        if status == CLOCK:  # late, and made up for
            status = 0
        drive = np.array(c.out.drive)
        if 0.95 < event < 0.96:  # the same sample again, for another target: refused
            found.double += 1
            found.calls += 1
            assert c.step_at(tick, targets[0]) == CLOCK | (UNSURE if c.state.unsure else 0)
            assert np.array_equal(drive, c.out.drive)
        device.hold(drive)
        if status == 0:
            found.promised.append(np.array(c.out.displacement))
            found.hot.append(device.T)
        else:
            found.told += bool(status & UNSURE)
    return found


def displacements(c: Compiled, temperatures: np.ndarray) -> np.ndarray:
    """(n, 6) [m] where the stage stands at `temperatures` (n, 6) [K]: Newton's method, in double, from the middle of the range."""
    count = len(temperatures)
    start = np.tile(np.mean(c.model.z_bounds, axis=0)[:, None], count)
    settle = c.twin.controller.kernels.static.settle.map(count)
    z = start
    for _ in range(2):
        z = settle(temperatures.T, z, np.zeros((N, count))).full()
    return z.T
