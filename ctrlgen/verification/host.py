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

# Of the code that asks and compares, which `verify` compiles like the rest: without optimisation that takes a fifth of the time. What is
# asked is compiled at -O2 (`FLAGS`).
TEST_LEVEL = "-O0"
# What asks, as one source, each of the two programs under a name of its own: every start of a compiler takes as long as these files
ASKING = """{tests}
#define main harness
#include "{harness}"
#undef main
#define main shipped_test
#include "{runner}"
#undef main
int main(int count, char **words)
{{
    return ((count == 2) && (strcmp(words[1], "test") == 0)) ? shipped_test() : harness(count, words);
}}
"""


@dataclass(frozen=True)
class HostBuild:
    """With what the C is built: a compiler of this computer, in one arithmetic."""

    compiler: str
    real: Arithmetic

    def __str__(self) -> str:
        return f"{self.compiler} {self.real.value}"


def build_host(build: HostBuild, folder: CFolder, scratch: Path, test_level: str = TEST_LEVEL) -> Path:
    """The harness (`harness_{real}.c` in `scratch`) and the shipped test in one program, linked with the same objects of what computes;
    `test_level`: what of the compiler's optimisation the code that only asks and compares gets. Raises ToolError with the compiler's words.
    """
    compiler, real = build.compiler, build.real
    program = scratch / f"{compiler}_{real.suffix}"
    sources = folder.sources(real)
    computing = [source for source in sources if source.stem not in {folder.selftest[real], folder.vectors[real]}]
    objects = [scratch / f"{compiler}_{source.stem}.o" for source in computing]
    for source, target in zip(computing, objects, strict=True):
        compile_c(compiler, folder.path, ["-c", str(source), "-o", str(target)])
    asking = scratch / f"{compiler}_asking_{real.suffix}.c"
    tests = [source for source in sources if source not in computing]
    included = "\n".join(f'#include "{source.resolve().as_posix()}"' for source in tests)
    files = {"harness": scratch / f"harness_{real.suffix}.c", "runner": folder.runner(real)}
    asking.write_text(
        ASKING.format(tests=included, **{name: path.resolve().as_posix() for name, path in files.items()})
    )
    compile_c(compiler, folder.path, [test_level, str(asking), *map(str, objects), "-o", str(program)])
    return program


def passes_shipped_test(program: Path) -> bool:
    """Whether the test that the package contains passes, in a program of `build_host`."""
    words = [str(program), "test"]
    return subprocess.run(words, capture_output=True, text=True, check=False, start_new_session=True).returncode == 0


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
