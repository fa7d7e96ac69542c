"""A reset in the middle of a motion with memory that survives, and what late calls cost: docs/howto/reset.md."""

from __future__ import annotations

import ctypes
import shutil
from dataclasses import dataclass

import numpy as np
import pytest
from reset_storm import CLOCK, UNSURE, Compiled, Heaters, N, compiled, poses

from ctrlgen import generate
from ctrlgen.controller.estimate import EXACT
from ctrlgen.firmware.c.real import Real
from ctrlgen.verification.cores import M4F, cross_compile, cross_compilers
from ctrlgen.verification.emulation import Machine, available

WRONG = 0.05  # K: a belief that is off by more is none that rounding made


@pytest.fixture(scope="module")
def c(tmp_path_factory) -> Compiled:
    if not shutil.which("gcc"):
        pytest.skip("gcc is missing: resets were not tried")
    return compiled(tmp_path_factory.mktemp("warm"))[Real.FLOAT]


@dataclass
class Copies:
    """What a firmware keeps: bytes of state and output, copied each time that a drive was put out."""

    state: bytes = b""
    out: bytes = b""

    def take(self, c: Compiled) -> None:
        self.state, self.out = bytes(c.state), bytes(c.out)

    def give(self, c: Compiled) -> None:
        ctypes.memmove(c.at, self.state, len(self.state))
        ctypes.memmove(c.output, self.out, len(self.out))


def after_resets(c: Compiled, rng: np.random.Generator, resets: int, *, copied: bool) -> tuple[np.ndarray, int]:
    """(errors [K] of the temperatures that calls without UNSURE believed, resets after which the copy was taken). Resets come in the middle
    of a call, before its drive is put out, before that is copied, and behind; the hardware holds its drive and counts samples meanwhile."""
    off, taken = [], 0
    for _ in range(resets):
        heaters, copies, held, tick = Heaters(), Copies(), np.zeros(N), 0
        c.c_init(c.at)
        targets = poses(c, rng, rng.integers(3, 12))
        where = rng.choice(["torn", "not put out", "not copied", "copied"])
        for tick, target in enumerate(targets):
            before, last = bytes(c.state), tick == len(targets) - 1
            c.step_at(tick, target)
            if not (last and where in ("torn", "not put out")):
                held = np.array(c.out.drive)
                if not (last and where == "not copied"):
                    copies.take(c)
            heaters.hold(held)
        if where == "torn":
            cut = 4 * int(rng.integers(1, 6))
            ctypes.memmove(c.at, bytes(c.state)[:cut] + before[cut:], ctypes.sizeof(c.state))
        missed = int(rng.integers(0, 4))
        heaters.hold(held, missed)
        if copied:
            copies.give(c)
            if np.array_equal(np.array(c.out.drive), held):
                taken += 1
            else:
                c.c_init(c.at)
                c.c_forget(c.at)
        for later, target in enumerate(poses(c, rng, 8), tick + 1 + missed):
            status = c.step_at(later, target)
            heaters.hold(np.array(c.out.drive))
            if not status & UNSURE:
                off.append(np.max(np.abs(heaters.T - np.array(c.out.state))))
    return np.array(off), taken


def test_a_copy_whose_drive_the_hardware_holds_is_gone_on_with(c, rng):
    off, taken = after_resets(c, rng, 400, copied=True)
    assert 200 < taken < 400 and len(off) > 1000 and off.max() < WRONG


def test_memory_that_a_reset_left_as_it_was_is_believed_and_wrong(c, rng):
    """Half of one call and half of the next, or a drive that was never put out: no status tells."""
    off, _ = after_resets(c, rng, 400, copied=False)
    assert np.mean(off > WRONG) > 0.1 and off.max() > 20


def test_to_make_up_for_missed_calls_costs_less_than_they_would_have(circle, tmp_path):
    """Else a loop that is late is later at each call: 64 missed samples took 83,352 instructions, as many as 200 calls."""
    compiler = "arm-none-eabi-gcc"
    if not available() or compiler not in cross_compilers():
        pytest.skip(f"{compiler} or unicorn is missing: nothing was counted")
    folder = generate(circle.scenario, circle.model, tmp_path / "c")
    name, init = folder.online[Real.FLOAT], folder.init[Real.FLOAT]
    cross_compile(compiler, M4F, [folder.path / f"{name}.c"], folder.path, init, tmp_path / "m.elf")
    machine = Machine(M4F, tmp_path / "m.elf")
    state, target, out = (machine.reserve(count, Real.FLOAT) for count in (20, N, 18))
    machine.call(init, state)
    machine.write(target, np.array([0, 0, 0, 1e-5, 0, 2e-5]), Real.FLOAT)
    for function in ("settle", "step"):
        _, each = machine.call(f"{name}_{function}", state, target, out)
    machine.call(f"{name}_step_at", state, 1, target, out)
    status, late = machine.call(f"{name}_step_at", state, 1 + 2 * EXACT, target, out)
    assert status & CLOCK and late < EXACT * each / 2
    told = int((folder.path / "README.md").read_text().split("missed with ")[1].split()[0])  # operations
    assert told + folder.operations < late < 2 * (told + folder.operations)
