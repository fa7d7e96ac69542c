"""C compilers: finding them, their flags, calling them."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

from ctrlgen.core.errors import ToolError

# Without fused products and sums, so that the bits are those on targets.
FLAGS = (
    "-std=c99",
    "-Wall",
    "-Wextra",
    "-Wpedantic",
    "-Wconversion",
    "-Wdouble-promotion",
    "-Werror",
    "-O2",
    "-ffp-contract=off",
)
COMPILERS = ("gcc", "clang")


def find_compilers() -> dict[str, str]:
    """C compilers found -> version line: gcc and clang, or else $CC or cc. Raises ToolError when there is none."""
    present = [name for name in COMPILERS if shutil.which(name)]
    others = [name for name in (os.environ.get("CC", ""), "cc") if name and shutil.which(name)]
    versions = {}
    for name in present or others[:1]:
        done = subprocess.run([name, "--version"], capture_output=True, text=True, check=False, start_new_session=True)
        if done.returncode != 0:
            raise ToolError(f"{name} --version ends with status {done.returncode}; repair or remove that compiler")
        versions[name] = (done.stdout.splitlines() or [name])[0]
    if not versions:
        raise ToolError(
            f"no C compiler found (looked for {', '.join(COMPILERS)}, $CC, cc); install one, on Debian: apt-get install gcc. "
            "`ctrlgen generate` writes the C without it"
        )
    return versions


def compile_c(compiler: str, include: Path, words: list[str]) -> None:
    """Raises ToolError with the compiler's words, KeyboardInterrupt when it was killed."""
    command = [compiler, *FLAGS, "-I", str(include), *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False, start_new_session=True)
    if done.returncode < 0:
        raise KeyboardInterrupt
    if done.returncode != 0:
        output = done.stderr.strip()[:2000] or f"(no output; status {done.returncode} for: {' '.join(command)})"
        raise ToolError(f"{compiler} refuses the C:\n{output}")
