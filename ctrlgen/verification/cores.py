"""Microcontrollers the C is tried on, and how C is compiled for them: by Zig from PyPI, by Debian's arm-none-eabi-gcc."""

from __future__ import annotations

import importlib.util
import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ctrlgen.core.errors import ToolError
from ctrlgen.firmware.c.real import Real
from ctrlgen.verification.check import run_tool, version_of

# No fused multiply-add: the same bits as on the computer. No unwinding: C needs none.
FLAGS = (
    *("-std=c99", "-O2", "-ffreestanding", "-ffp-contract=off", "-fno-math-errno"),
    *("-fno-unwind-tables", "-fno-asynchronous-unwind-tables"),
)
INSTALL = {
    "zig": "pip install ziglang",
    "arm-none-eabi-gcc": "apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi",
}
BASE = 0x10000  # address of the program: flash


@dataclass(frozen=True)
class Core:
    """A processor: compiler flags, its name in Unicorn (None: the machine with every extension), the arithmetics it has
    instructions for, its board in QEMU."""

    name: str
    zig: str
    gcc: tuple[str, ...]
    unicorn: str | None
    reals: tuple[Real, ...]
    board: str


M4 = ("-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16")
M7 = ("-mcpu=cortex-m7", "-mfpu=fpv5-d16")
CORES = (
    Core("Cortex-M4F", "cortex_m4+vfp4d16sp", M4, "UC_CPU_ARM_CORTEX_M4", (Real.FLOAT,), "mps2-an386"),
    # Unicorn's M-class models refuse double precision
    Core("Cortex-M7", "cortex_m7+fp_armv8d16", M7, None, (Real.FLOAT, Real.DOUBLE), "mps2-an500"),
)


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
    if shutil.which("arm-none-eabi-gcc"):
        present["arm-none-eabi-gcc"] = version_of("arm-none-eabi-gcc") or "arm-none-eabi-gcc"
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
    """`sources` linked for `core` without a library, to be loaded at `BASE`, or where a script in `more` says.

    Raises ToolError with the compiler's words.
    """
    words = [*FLAGS, "-I", str(include), *map(str, sources), "-nostdlib", f"-Wl,-e,{entry}", "-Wl,--no-gc-sections"]
    if compiler == "zig":
        command = [*(zig() or []), "-target", "thumb-freestanding-eabihf", f"-mcpu={core.zig}", *words]
    else:
        place = ["-mthumb", "-mfloat-abi=hard", *(() if more else (f"-Wl,-Ttext={BASE:#x}",)), "-lgcc"]
        command = [compiler, *core.gcc, *words, *place]
    done = run_tool([*command, *more, "-o", str(program)])
    if done.returncode != 0:
        raise ToolError(f"{compiler} refuses the C for {core.name}:\n{done.stderr.strip()[:2000]}")
