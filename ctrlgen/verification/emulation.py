"""An emulated microcontroller (Unicorn): calls functions of a linked program and counts what they execute.

It counts executed instructions exactly, on an ARM those skipped by an IT block included. It does not model cycles.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ctrlgen.core.errors import ToolError
from ctrlgen.firmware.c.real import Arithmetic, Integers, Real
from ctrlgen.verification.cores import Architecture, Core

PAGE = 0x1000
RAM, RAM_SIZE = 0x20000000, 0x40000
RETURN = 0x0F000000  # where a call returns to
STACK = RAM + RAM_SIZE // 2  # grows downward from here; data stands above
PATTERN = 0xA5  # of stack that nothing has touched
MOST = 20_000_000  # instructions of a call that may still return; a longer one hangs
FPU_ON = 0xF << 20  # coprocessors 10 and 11 in CPACR
FPEXC_ON = 1 << 30
MISSING = "pip install unicorn pyelftools"


def available() -> bool:
    """Whether the packages that emulate are installed."""
    return all(importlib.util.find_spec(name) for name in ("unicorn", "elftools"))


@dataclass(frozen=True)
class _Processor:
    """An emulated core: the registers of the first argument, which holds the result too, of stack, return and place; the mark of an
    address of code; how many half words an instruction has, by its first one."""

    emulator: Any
    argument: int
    stack: int
    link: int
    place: int
    mark: int
    half_words: Callable[[int], int]


def _arm(core: Core) -> _Processor:
    import unicorn
    from unicorn import arm_const as arm

    model = arm.UC_CPU_ARM_MAX if core.unicorn is None else getattr(arm, core.unicorn)
    emulator = unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | (unicorn.UC_MODE_MCLASS if core.unicorn else 0))
    emulator.ctl_set_cpu_model(model)
    emulator.reg_write(arm.UC_ARM_REG_C1_C0_2, emulator.reg_read(arm.UC_ARM_REG_C1_C0_2) | FPU_ON)
    emulator.reg_write(arm.UC_ARM_REG_FPEXC, FPEXC_ON)
    registers = arm.UC_ARM_REG_R0, arm.UC_ARM_REG_SP, arm.UC_ARM_REG_LR, arm.UC_ARM_REG_PC
    return _Processor(emulator, *registers, 1, lambda first: 2 if first >= 0xE800 else 1)


def _riscv(core: Core) -> _Processor:
    import unicorn
    from unicorn import riscv_const as riscv

    emulator = unicorn.Uc(unicorn.UC_ARCH_RISCV, unicorn.UC_MODE_RISCV32)
    if core.unicorn is not None:
        emulator.ctl_set_cpu_model(getattr(riscv, core.unicorn))
    registers = riscv.UC_RISCV_REG_A0, riscv.UC_RISCV_REG_SP, riscv.UC_RISCV_REG_RA, riscv.UC_RISCV_REG_PC
    return _Processor(emulator, *registers, 0, lambda first: 2 if first & 3 == 3 else 1)


class Machine:
    """One core with a program in its memory. Raises ToolError where the program does something the core cannot."""

    def __init__(self, core: Core, program: Path) -> None:
        import unicorn
        from elftools.elf.elffile import ELFFile
        from unicorn import riscv_const

        self._error = unicorn.UcError
        self._core = _riscv(core) if core.architecture is Architecture.RISCV else _arm(core)
        self.emulator = self._core.emulator
        with program.open("rb") as stream:
            elf = ELFFile(stream)
            # typed as any section; that of symbols is there, nothing is stripped
            table: Any = elf.get_section_by_name(".symtab")
            self.symbols = {s.name: s["st_value"] for s in table.iter_symbols()}
            sections = [(s.name, s["sh_size"], s["sh_flags"], s["sh_type"]) for s in elf.iter_sections()]
            for segment in elf.iter_segments():
                if segment["p_type"] == "PT_LOAD" and segment["p_memsz"]:
                    self._load(segment["p_vaddr"], segment.data().ljust(segment["p_memsz"], b"\0"))
        loaded = [(name, size, flags) for name, size, flags, kind in sections if flags & 2 and kind != "SHT_NOBITS"]
        self.code = sum(size for _, size, flags in loaded if flags & 4)  # with the constants between instructions
        self.tables = sum(size for name, size, flags in loaded if not flags & 4 and not name.startswith(".ARM"))
        self.writable = sum(size for _, size, flags, _ in sections if flags & 1 and flags & 2)
        self.emulator.mem_map(RAM, RAM_SIZE)
        self.emulator.mem_map(RETURN, PAGE)
        self.emulator.mem_write(RAM, bytes([PATTERN]) * (STACK - RAM))
        if (
            middle := self.symbols.get("__global_pointer$")
        ) is not None:  # of the data that RISC-V reaches in one instruction
            self.emulator.reg_write(riscv_const.UC_RISCV_REG_GP, middle)
        self._lengths: dict[tuple[int, int], int] = {}
        self._executed = 0
        self.emulator.hook_add(unicorn.UC_HOOK_BLOCK, self._count)
        self._next = STACK

    def _load(self, address: int, data: bytes) -> None:
        first, last = address // PAGE * PAGE, -(-(address + len(data)) // PAGE) * PAGE
        mapped = [(begin, end + 1) for begin, end, _ in self.emulator.mem_regions()]
        for page in range(first, last, PAGE):
            if not any(begin <= page < end for begin, end in mapped):
                self.emulator.mem_map(page, PAGE)
        self.emulator.mem_write(address, data)

    def _count(self, machine: object, address: int, size: int, _: object) -> None:
        """A block is about to run: how many instructions it has."""
        if (address, size) not in self._lengths:
            words = np.frombuffer(self.emulator.mem_read(address, size), dtype="<u2")
            at, count = 0, 0
            while at < len(words):
                at += self._core.half_words(int(words[at]))
                count += 1
            self._lengths[address, size] = count
        self._executed += self._lengths[address, size]
        if self._executed > MOST:
            self.emulator.emu_stop()

    def reserve(self, count: int, real: Arithmetic) -> int:
        """The address in RAM of space for `count` numbers."""
        address = self._next
        self._next += -(-count * real.bytes // 16) * 16
        return address

    def write(self, address: int, values: np.ndarray, real: Arithmetic) -> None:
        """Writes the numbers `values` into RAM from `address` on."""
        self.emulator.mem_write(address, np.asarray(values, dtype=_dtype(real)).tobytes())

    def read(self, address: int, count: int, real: Arithmetic) -> np.ndarray:
        """Numbers from RAM, as they are there."""
        return np.frombuffer(self.emulator.mem_read(address, count * real.bytes), dtype=_dtype(real))

    def call(self, function: str, *arguments: int) -> tuple[int, int]:
        """(returned integer, instructions executed) of a call with addresses or integers as arguments."""
        core, self._executed = self._core, 0
        for i, argument in enumerate(arguments):
            self.emulator.reg_write(core.argument + i, argument)
        self.emulator.reg_write(core.stack, STACK)
        self.emulator.reg_write(core.link, RETURN | core.mark)
        try:
            self.emulator.emu_start(self.symbols[function] | core.mark, RETURN)
        except self._error as error:
            place = self.emulator.reg_read(core.place)
            raise ToolError(f"the emulated core stopped in {function} at {place:#x}: {error}") from error
        if self.emulator.reg_read(core.place) != RETURN:
            raise ToolError(
                f"{function} did not return within {MOST // 1000000} million instructions on the emulated core"
            )
        returned = self.emulator.reg_read(core.argument)
        return returned - (1 << 32) if returned >> 31 else returned, self._executed

    @property
    def stack(self) -> int:
        """Bytes of stack that the calls so far have touched at most, in whole double words."""
        memory = np.frombuffer(self.emulator.mem_read(RAM, STACK - RAM), dtype=np.uint8)
        touched = np.flatnonzero(memory != PATTERN)
        return -(-int(len(memory) - touched[0]) // 8) * 8 if len(touched) else 0


def _dtype(real: Arithmetic) -> str:
    if isinstance(real, Integers):
        return "<i4"
    return "<f4" if real is Real.FLOAT else "<f8"
