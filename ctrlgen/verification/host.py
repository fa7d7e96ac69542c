"""The generated C on this computer: built into one program that reads records and writes answers."""

from __future__ import annotations

import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import ToolError
from ctrlgen.firmware.c.real import Arithmetic
from ctrlgen.firmware.c.toolchains import compile_c, find_compilers
from ctrlgen.firmware.folder import CFolder, write_harness
from ctrlgen.verification.reference import ReferenceAnswers


@dataclass(frozen=True)
class HostBuild:
    """With what the C is built: a compiler of this computer, in one arithmetic."""

    compiler: str
    real: Arithmetic

    def __str__(self) -> str:
        return f"{self.compiler} {self.real.value}"


def build_host(build: HostBuild, folder: CFolder, scratch: Path) -> Path:
    """The harness (`harness_{real}.c` in `scratch`) and the shipped test, linked with the same objects; returns the harness,
    the test beside it. Raises ToolError with the compiler's words."""
    compiler, real = build.compiler, build.real
    program = scratch / f"{compiler}_{real.suffix}"
    sources = folder.sources(real)
    objects = [scratch / f"{compiler}_{source.stem}.o" for source in sources]
    for source, target in zip(sources, objects, strict=True):
        compile_c(compiler, folder.path, ["-c", str(source), "-o", str(target)])
    linked = [*map(str, objects), "-o"]
    compile_c(compiler, folder.path, [str(scratch / f"harness_{real.suffix}.c"), *linked, str(program)])
    compile_c(compiler, folder.path, [str(folder.runner(real)), *linked, f"{program}_test"])
    return program


def run_host(
    program: Path, mode: str, records: np.ndarray, width: int, start: tuple[np.ndarray, ...] = ()
) -> np.ndarray:
    """Output records (n, 1 + width) of doubles; the first column is the status. `start` is read before the records.

    Raises ToolError where the program ends early.
    """
    sent = b"".join(np.ascontiguousarray(part, dtype=float).tobytes() for part in (*start, records))
    done = subprocess.run([str(program), mode], input=sent, capture_output=True, check=False, start_new_session=True)
    answer = np.frombuffer(done.stdout, dtype=float)
    if done.returncode != 0 or answer.size != len(records) * (1 + width):
        got = f"{answer.size // (1 + width)} of {number_of(len(records), 'record')}"
        raise ToolError(f"{program.name} stopped in mode '{mode}' with status {done.returncode} after {got}")
    return answer.reshape(len(records), 1 + width)


class Host:
    """One arithmetic built by the first compiler there is; answers (n, 1 + width) begin with the status."""

    def __init__(self, folder: CFolder, reference: ReferenceAnswers, real: Arithmetic, scratch: Path) -> None:
        self.real, model = real, reference.model
        write_harness(folder, reference.scenario, model, real, scratch / f"harness_{real.suffix}.c")
        self._program = build_host(HostBuild(next(iter(find_compilers())), real), folder, scratch)
        self._drives, self._width = model.u.numel(), reference.width

    def followed(self, targets: np.ndarray, start: tuple[np.ndarray, ...]) -> np.ndarray:
        """Status and answers (n, 1 + width) of steps from the state `start` (x, z)."""
        return run_host(self._program, "follow", targets, self._width, start)

    def settled(self, targets: np.ndarray) -> np.ndarray:
        """Status and answers (n, 1 + width) at equilibria of `targets`, from a device at rest."""
        return run_host(self._program, "settle", targets, self._width)

    def played(self, samples: np.ndarray) -> np.ndarray:
        """Status and drives (n, 1 + n_u) that the player gives for the `samples` (n,)."""
        return run_host(self._program, "sample", samples, self._drives)
