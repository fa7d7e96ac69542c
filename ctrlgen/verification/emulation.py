"""An emulated microcontroller (Unicorn): calls functions of a linked program and counts what they execute.

It counts executed instructions exactly, those skipped by an IT block included. It does not model cycles.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np

from ctrlgen.core.errors import ToolError
from ctrlgen.firmware.c.real import Real
from ctrlgen.verification.cores import Core

PAGE = 0x1000
RAM, RAM_SIZE = 0x20000000, 0x40000
RETURN = 0x0F000000  # where a call returns to
STACK = RAM + RAM_SIZE // 2  # grows downward from here; data stands above
PATTERN = 0xA5  # of stack that nothing has touched
MOST = 20_000_000  # instructions of a call that may still return; a longer one hangs
FPU_ON = 0xF << 20  # coprocessors 10 and 11 in CPACR
MISSING = "pip install unicorn pyelftools"


def available() -> bool:
    """Whether the packages that emulate are installed."""
    return all(importlib.util.find_spec(name) for name in ("unicorn", "elftools"))


class Machine:
    """One core with a program in its memory. Raises ToolError where the program does something the core cannot."""

    def __init__(self, core: Core, program: Path) -> None:
        import unicorn
        from elftools.elf.elffile import ELFFile
        from unicorn import arm_const

        self._arm, self._error = arm_const, unicorn.UcError
        model = arm_const.UC_CPU_ARM_MAX if core.unicorn is None else getattr(arm_const, core.unicorn)
        mode = unicorn.UC_MODE_THUMB | (unicorn.UC_MODE_MCLASS if core.unicorn else 0)
        self.emulator = unicorn.Uc(unicorn.UC_ARCH_ARM, mode)
        self.emulator.ctl_set_cpu_model(model)
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
        self.emulator.reg_write(
            arm_const.UC_ARM_REG_C1_C0_2, self.emulator.reg_read(arm_const.UC_ARM_REG_C1_C0_2) | FPU_ON
        )
        self.emulator.reg_write(arm_const.UC_ARM_REG_FPEXC, 0x40000000)
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
        """A block of Thumb code is about to run: instructions whose first half word is 0xE800 or more have four bytes."""
        if (address, size) not in self._lengths:
            words = np.frombuffer(self.emulator.mem_read(address, size), dtype="<u2")
            at, count = 0, 0
            while at < len(words):
                at += 2 if words[at] >= 0xE800 else 1
                count += 1
            self._lengths[address, size] = count
        self._executed += self._lengths[address, size]
        if self._executed > MOST:
            self.emulator.emu_stop()

    def reserve(self, count: int, real: Real) -> int:
        """The address in RAM of space for `count` numbers."""
        address = self._next
        self._next += -(-count * real.bytes // 16) * 16
        return address

    def write(self, address: int, values: np.ndarray, real: Real) -> None:
        """Writes the numbers `values` into RAM from `address` on."""
        self.emulator.mem_write(address, np.asarray(values, dtype=_dtype(real)).tobytes())

    def read(self, address: int, count: int, real: Real) -> np.ndarray:
        """Numbers from RAM, as they are there."""
        return np.frombuffer(self.emulator.mem_read(address, count * real.bytes), dtype=_dtype(real))

    def call(self, function: str, *arguments: int) -> tuple[int, int]:
        """(returned integer, instructions executed) of a call with addresses or integers as arguments."""
        arm, self._executed = self._arm, 0
        for i, argument in enumerate(arguments):
            self.emulator.reg_write(arm.UC_ARM_REG_R0 + i, argument)
        self.emulator.reg_write(arm.UC_ARM_REG_SP, STACK)
        self.emulator.reg_write(arm.UC_ARM_REG_LR, RETURN | 1)
        try:
            self.emulator.emu_start(self.symbols[function] | 1, RETURN)
        except self._error as error:
            place = self.emulator.reg_read(arm.UC_ARM_REG_PC)
            raise ToolError(f"the emulated core stopped in {function} at {place:#x}: {error}") from error
        if self.emulator.reg_read(arm.UC_ARM_REG_PC) != RETURN:
            raise ToolError(
                f"{function} did not return within {MOST // 1000000} million instructions on the emulated core"
            )
        returned = self.emulator.reg_read(arm.UC_ARM_REG_R0)
        return returned - (1 << 32) if returned >> 31 else returned, self._executed

    @property
    def stack(self) -> int:
        """Bytes of stack that the calls so far have touched at most, in whole double words."""
        memory = np.frombuffer(self.emulator.mem_read(RAM, STACK - RAM), dtype=np.uint8)
        touched = np.flatnonzero(memory != PATTERN)
        return -(-int(len(memory) - touched[0]) // 8) * 8 if len(touched) else 0


def _dtype(real: Real) -> str:
    return "<f4" if real is Real.FLOAT else "<f8"
