"""The checksum over the controller's state: every flipped bit is told and answered with the safe drive, and nothing else changes."""

from __future__ import annotations

import ctypes
import subprocess
import zlib
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from conftest import SCENARIOS

from ctrlgen import build_model, generate, load_scenario
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.folder import CFolder
from ctrlgen.firmware.online.checksum import crc_table
from ctrlgen.verification import emulation
from ctrlgen.verification.cores import M4F, cross_compile, cross_compilers
from ctrlgen.verification.emulation import Machine, available
from ctrlgen.verification.rules import check_rules

LOST, INPUT, CHECKSUM = 32, 16, 1024
KIND = {Real.FLOAT: np.float32, Real.DOUBLE: np.float64}


CONSTANTS = """
[run_time]
constants = ["actuator.thermal_resistance", { number = "actuator.ambient", low = "10 degC", high = "40 degC" }]
input = "actuator.ambient"
"""


def folder_of(path: Path | str, into: Path, *, checksum: bool = True) -> CFolder:
    scenario = load_scenario(SCENARIOS / path)
    scenario = replace(scenario, file=scenario.file.model_copy(update={"checksum": checksum}))
    return generate(scenario, build_model(scenario.device), into)


@dataclass
class Checked:
    """The compiled functions `{name}_...` on a state of so many bytes, the checksum behind them."""

    c: ctypes.CDLL
    name: str
    state: np.ndarray
    out: np.ndarray
    size: int

    def __call__(self, function: str, *arguments: object) -> int:
        call = getattr(self.c, f"{self.name}_{function}")
        call.restype = ctypes.c_uint32
        return call(ctypes.c_void_p(self.state.ctypes.data), *arguments)

    def to(self, function: str, target: np.ndarray | None) -> int:
        at = ctypes.c_void_p(None if target is None else target.ctypes.data)
        return self(function, at, ctypes.c_void_p(self.out.ctypes.data))


def built(folder: CFolder, real: Real, into: Path, compiler: str) -> Checked:
    online, checked = folder.online[real], folder.checked[real]
    probe = into / "probe.c"
    probe.write_text(
        f'#include "{checked}.h"\nunsigned size(int whole);\n'
        f"unsigned size(int whole) {{ return whole ? sizeof({checked}_state) : sizeof({online}_state); }}\n"
        f"void {checked}_begin({checked}_state *state);\nvoid {checked}_begin({checked}_state *state) {{ {checked}_init(state); }}\n"
    )
    library = into / f"{checked}.so"
    sources = [folder.path / f"{online}.c", folder.path / f"{checked}.c", probe]
    words = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror", "-O1", "-shared", "-fPIC"]
    command = [compiler, *words, "-I", str(folder.path), *map(str, sources), "-o", str(library)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    c = ctypes.CDLL(str(library))
    state = np.full(c.size(1), 0xA5, np.uint8)
    return Checked(c, checked, state, np.full(64, np.nan, KIND[real]), c.size(0))


def every_flip_is_told(checked: Checked, drives: int, target: np.ndarray) -> None:
    """In the state, its constants and the checksum itself; the state is left as it is, and goes on once it is right again."""
    assert checked.to("settle", target) & (LOST | CHECKSUM) == 0
    good, answer = checked.state.copy(), checked.out.copy()
    assert good[checked.size : checked.size + 4].view(np.uint32)[0] == zlib.crc32(good[: checked.size].tobytes())
    for bit in range(8 * (checked.size + 4)):
        checked.state[bit // 8] ^= 1 << bit % 8
        spoiled = checked.state.copy()
        for function in ("settle", "step"):
            checked.out[:] = np.nan
            assert checked.to(function, target) == LOST | CHECKSUM, bit
            assert np.all(checked.out[:drives] == 0)
        assert np.array_equal(checked.state, spoiled)
        checked.state[:] = good
    assert checked.to("settle", target) & (LOST | CHECKSUM) == 0 and np.array_equal(checked.out, answer, equal_nan=True)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> CFolder:
    return folder_of("rrr_circle", tmp_path_factory.mktemp("checked"))


@pytest.mark.parametrize("real", list(Real))
def test_a_bit_that_flips_anywhere_in_the_state_is_told_and_the_drive_is_safe(folder, real, compiler, tmp_path):
    checked, target = built(folder, real, tmp_path, compiler), np.zeros(3, KIND[real])
    assert checked.to("step", target) == LOST | CHECKSUM  # never initialised
    assert getattr(checked.c, f"{checked.name}_step")(None, None, None) == INPUT
    checked("begin")
    assert checked.to("step", None) & (INPUT | LOST | CHECKSUM) == INPUT
    every_flip_is_told(checked, 3, target)


def test_a_state_that_is_half_of_one_call_and_half_of_the_next_is_told(compiler, tmp_path):
    """As a reset in the middle of a call leaves it, or of a copy to memory that no reset clears: without the checksum nothing tells."""
    real, jump = Real.FLOAT, np.array([0, 0, 0, 2e-6, 0, 3e-5], np.float32)
    checked = built(folder_of("circle20", tmp_path / "c"), real, tmp_path, compiler)
    checked("begin")
    checked.to("settle", jump / 10)
    states = [checked.state.copy()]
    for _ in range(2):
        assert checked.to("step", jump) & (LOST | CHECKSUM) == 0
        states.append(checked.state.copy())
    torn = 0
    for old, new in pairwise(states):
        for k in range(0, checked.size + 4, 4):
            checked.state[:] = np.concatenate([new[:k], old[k:]])
            if not any(np.array_equal(checked.state, whole) for whole in (old, new)):
                assert checked.to("step", jump) == LOST | CHECKSUM, k
                torn += 1
    assert torn > 20


@pytest.mark.long
def test_the_checksum_changes_no_answer_and_nothing_where_it_is_off(folder, compiler, tmp_path, rng):
    plain = folder_of("rrr_circle", tmp_path / "c", checksum=False)
    assert not plain.checked and not list(plain.path.glob("*checked*"))
    for real, name in plain.online.items():
        for kind in ("c", "h"):
            assert (plain.path / f"{name}.{kind}").read_bytes() == (folder.path / f"{name}.{kind}").read_bytes()
        checked = built(folder, real, tmp_path, compiler)
        without = replace(checked, name=name, state=checked.state.copy(), out=checked.out.copy())
        checked("begin")
        getattr(without.c, folder.init[real])(ctypes.c_void_p(without.state.ctypes.data))
        for target in rng.normal(size=(200, 3)).astype(KIND[real]) * 1e-5:
            assert checked.to("step", target) == without.to("step", target)
            assert np.array_equal(checked.out, without.out, equal_nan=True)


@pytest.mark.long
def test_constants_of_a_specimen_are_covered_too(compiler, tmp_path):
    device = (SCENARIOS / "devices" / "mems_hexapod.toml").read_text() + CONSTANTS
    (tmp_path / "device.toml").write_text(device)
    circle = (SCENARIOS / "circle20" / "scenario.toml").read_text()
    (tmp_path / "scenario.toml").write_text(circle.replace("../devices/mems_hexapod.toml", "device.toml"))
    folder = folder_of(tmp_path, tmp_path / "c")
    assert folder.given_numbers > 0
    for real in Real:
        checked = built(folder, real, tmp_path, compiler)
        checked("begin")
        assert checked.size >= folder.given_numbers * real.bytes
        every_flip_is_told(checked, 6, np.array([0, 0, 0, 0, 0, 1e-5], KIND[real]))
        set_ambient = getattr(checked.c, f"{checked.name}_set_ambient")
        set_ambient.restype = ctypes.c_uint32
        number = (ctypes.c_float if real is Real.FLOAT else ctypes.c_double)(300.0)
        at = ctypes.c_void_p(checked.state.ctypes.data)
        assert set_ambient(at, number) == 0
        checked.state[0] ^= 1
        assert set_ambient(at, number) == LOST | CHECKSUM


@pytest.mark.long
def test_it_breaks_no_rule(folder):
    checks = check_rules(folder)
    assert checks and all(check.state != "failed" for check in checks), [check.findings for check in checks]


@pytest.mark.long
def test_the_readme_says_what_the_checksum_costs(tmp_path):
    compiler, real = "arm-none-eabi-gcc", Real.FLOAT
    if not available() or compiler not in cross_compilers():
        pytest.skip(f"{emulation.MISSING}; {compiler}: not counted")
    folder = folder_of("circle20", tmp_path / "c")
    online, name = folder.online[real], folder.checked[real]
    sources = [folder.path / f"{online}.c", folder.path / f"{name}.c"]
    counts = {}
    for used, entry in ((online, folder.init[real]), (name, folder.init[real].replace(online, name))):
        cross_compile(compiler, M4F, sources, folder.path, entry, tmp_path / "m.elf")
        machine = Machine(M4F, tmp_path / "m.elf")
        state, target, out = (machine.reserve(count, real) for count in (20, 6, 18))
        machine.call(entry, state)
        machine.write(target, np.array([0, 0, 0, 0, 0, 1e-6]), real)
        counts[used] = machine.call(f"{used}_step", state, target, out)[1]
    told = int((folder.path / "README.md").read_text().split("It takes about ")[1].split()[0])
    assert 0.9 * told < counts[name] - counts[online] < 1.1 * told


def test_the_table_is_that_of_zlib():
    for text in (b"", b"\x00", b"flexure"):
        crc = 0xFFFFFFFF
        for byte in text:
            crc = crc_table()[(crc ^ byte) & 0xFF] ^ (crc >> 8)
        assert crc ^ 0xFFFFFFFF == zlib.crc32(text)
