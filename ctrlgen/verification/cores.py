"""Microcontrollers the C is tried on, and how C is compiled for them: by Zig from PyPI, by Debian's cross compilers."""

from __future__ import annotations

import importlib.util
import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from ctrlgen.core.errors import ToolError
from ctrlgen.firmware.c.real import Arithmetic, Integers, Real
from ctrlgen.verification.check import run_tool, version_of

# No fused multiply-add: the same bits as on the computer. No unwinding: C needs none.
FLAGS = (
    *("-std=c99", "-O2", "-ffreestanding", "-ffp-contract=off", "-fno-math-errno"),
    *("-fno-unwind-tables", "-fno-asynchronous-unwind-tables"),
)
INSTALL = {
    "zig": "pip install ziglang",
    "arm-none-eabi-gcc": "apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi",
    "riscv64-unknown-elf-gcc": "apt-get install gcc-riscv64-unknown-elf",
}
BASE = 0x10000  # address of the program: flash
FEWER = 100  # calls of a kind where each takes tens of thousands of instructions: arithmetic in software


class Architecture(StrEnum):
    """A family of instruction sets; the value names the cross compiler of GNU."""

    ARM_M = "arm-none-eabi-gcc"
    RISCV = "riscv64-unknown-elf-gcc"


@dataclass(frozen=True)
class Core:
    """A processor: Zig's target and CPU, flags of GNU's cross compiler, its name in Unicorn (None: the machine with every extension), the
    arithmetics of real numbers that are tried on it, its board in QEMU (None: none is tried), the most calls of a kind that are counted
    (None: all)."""

    name: str
    architecture: Architecture
    zig: tuple[str, str]
    gcc: tuple[str, ...]
    unicorn: str | None
    reals: tuple[Real, ...]
    board: str | None
    calls: int | None = None

    @property
    def compilers(self) -> tuple[str, ...]:
        """The cross compilers that know it."""
        return "zig", self.architecture.value

    def tried(self, arithmetics: Sequence[Arithmetic]) -> list[Arithmetic]:
        """Of these arithmetics those that are tried on it: integers on every core."""
        return [real for real in arithmetics if isinstance(real, Integers) or real in self.reals]


_HARD, _SOFT, _RISCV = "thumb-freestanding-eabihf", "thumb-freestanding-eabi", "riscv32-freestanding-none"
_FPU = ("-mthumb", "-mfloat-abi=hard")
_NO_FPU = ("-mthumb", "-mfloat-abi=soft")
M4F = Core(
    name="Cortex-M4F",
    architecture=Architecture.ARM_M,
    zig=(_HARD, "cortex_m4+vfp4d16sp"),
    gcc=("-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", *_FPU),
    unicorn="UC_CPU_ARM_CORTEX_M4",
    reals=(Real.FLOAT,),
    board="mps2-an386",
)
M7 = Core(
    name="Cortex-M7",
    architecture=Architecture.ARM_M,
    zig=(_HARD, "cortex_m7+fp_armv8d16"),
    gcc=("-mcpu=cortex-m7", "-mfpu=fpv5-d16", *_FPU),
    unicorn=None,  # Unicorn's M-class models refuse double precision
    reals=(Real.FLOAT, Real.DOUBLE),
    board="mps2-an500",
)
M3 = Core(
    name="Cortex-M3",
    architecture=Architecture.ARM_M,
    zig=(_SOFT, "cortex_m3"),
    gcc=("-mcpu=cortex-m3", *_NO_FPU),
    unicorn="UC_CPU_ARM_CORTEX_M3",
    reals=(Real.FLOAT,),
    board="mps2-an385",
    calls=FEWER,
)
M0_PLUS = Core(
    name="Cortex-M0+",
    architecture=Architecture.ARM_M,
    zig=(_SOFT, "cortex_m0plus"),
    gcc=("-mcpu=cortex-m0plus", *_NO_FPU),
    unicorn="UC_CPU_ARM_CORTEX_M0",  # the same instructions
    reals=(Real.FLOAT,),
    board=None,
    calls=FEWER,
)
RV32IMC = Core(
    name="RV32IMC",
    architecture=Architecture.RISCV,
    zig=(_RISCV, "generic_rv32+m+c"),
    gcc=("-march=rv32imc", "-mabi=ilp32"),
    unicorn="UC_CPU_RISCV32_SIFIVE_E31",  # has the atomic instructions too, which the compilers do not use
    reals=(Real.FLOAT,),
    board=None,
    calls=FEWER,
)
CORES = (M4F, M7, M3, M0_PLUS, RV32IMC)


def zig() -> list[str] | None:
    """The words that call Zig's C compiler; None where the package is missing."""
    return [sys.executable, "-m", "ziglang", "cc"] if importlib.util.find_spec("ziglang") else None


def cross_compilers() -> dict[str, str]:
    """The cross compilers that are installed: name -> version."""
    present = {}
    if words := zig():
        done = run_tool([*words[:-1], "version"])
        if done.returncode == 0:
            present["zig"] = f"zig {done.stdout.strip()}"
    for architecture in Architecture:
        if shutil.which(architecture.value):
            present[architecture.value] = version_of(architecture.value) or architecture.value
    return present


def cross_compile(
    compiler: str,
    core: Core,
    sources: Sequence[Path],
    include: Path,
    entry: str,
    program: Path,
    more: Sequence[str] = (),
) -> None:
    """`sources` linked for `core` with nothing but the compiler's own arithmetic, to be loaded at `BASE`, or where a script in `more` says.

    Raises ToolError with the compiler's words.
    """
    # Sections that nothing calls are left out: of the sources, of which each is one, none; of Zig's arithmetic most.
    words = [*FLAGS, "-I", str(include), *map(str, sources), "-nostdlib", f"-Wl,-e,{entry}", "-Wl,--gc-sections"]
    if compiler == "zig":
        target, cpu = core.zig
        command = [*(zig() or []), "-target", target, f"-mcpu={cpu}", *words, "-rtlib=compiler-rt"]
    else:
        place = () if more else (f"-Wl,-Ttext={BASE:#x}",)
        command = [compiler, *core.gcc, *words, *place, "-lgcc"]
    done = run_tool([*command, *more, "-o", str(program)])
    if done.returncode != 0:
        raise ToolError(f"{compiler} refuses the C for {core.name}:\n{done.stderr.strip()[:2000]}")
