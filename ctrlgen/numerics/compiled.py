"""Recursions compiled to machine code where a C compiler is there, and left to CasADi's virtual machine elsewhere.

Compiled libraries are kept in the user's cache folder under the SHA-256 of their code, so that another diagnosis of the same
device need not compile them again; those used longest ago go (`kept_libraries.py`). The code is compiled without contraction of
products and sums: its results are those of the virtual machine to the last bit, but for numbers below the least normal one, which are
zero. A diagnosis compiles some hundred of them, most of them short: headers, CasADi's interface and the C library's start-up files,
which nothing here needs, would take two thirds of the time of a short one.
"""

from __future__ import annotations

import ctypes
import functools
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import casadi as ca
import numpy as np

from ctrlgen.core.compiled_templates import cache_folder
from ctrlgen.core.counts import number_of
from ctrlgen.numerics.generated_c import c_code
from ctrlgen.numerics.kept_libraries import KeptLibraries


def _of_processor() -> tuple[str, ...]:
    """The option with which the compiler uses the wide registers that this processor is known to have. A library of other options has
    another name, so that a cache folder may be shared by several machines."""
    try:
        known = Path("/proc/cpuinfo").read_text()
    except OSError:
        return ()
    return ("-mavx2",) if re.search(r"^flags\b.*\bavx2\b", known, re.M) else ()


FLAGS = (
    *("-Og", *_of_processor(), "-fPIC", "-shared", "-ffp-contract=off", "-w"),
    *(("-nostdlib",) if sys.platform == "linux" else ()),
)
# Of generated C, for the compiler: measured with gcc 12 on steps of an axis and a hexapod.
SECONDS, SECONDS_PER_CHARACTER = 0.02, 4e-6
# Samples that the virtual machine runs in the time that writing the C takes: on the same 120 to 600 of an axis, 400 to 1 300 of a hexapod.
SAMPLES_TO_WRITE = 1000
LONGEST = 6_000_000  # characters of generated C: beyond, the compiler takes longer than the diagnosis

# what this process has added and used
KEPT = KeptLibraries()


class Compilable:
    """The recursion `function`, (state, input ...) -> (next state, result), and the library that takes its place once it has run so long
    that compiling pays."""

    def __init__(self, function: ca.Function) -> None:
        self.function = function
        self.seconds, self.samples = 0.0, 0  # spent in the virtual machine so far
        self._code: str | None = None
        self._folder = cache_folder()
        self.settled = compiler() is None  # whether it is known already if the library takes the place
        self._loop: Callable[..., int] | None = None

    def spent(self, seconds: float, samples: int, to_come: int = 0) -> bool:
        """Counts `samples` that took the virtual machine `seconds`, where as many are likely `to_come`; whether the library is there from
        now on."""
        if self.settled or self._folder is None:
            return False
        self.seconds += seconds
        self.samples += samples
        expected = seconds / samples * to_come
        if self._code is None:
            # what hardly runs need not be written as C, nor what runs in less than that takes, whether it was compiled before or not
            if self.seconds + expected < 0.1 or self.samples + to_come < SAMPLES_TO_WRITE:
                return False
            try:
                self._code = c_code(self.function)
            except ValueError:  # it stays with the virtual machine
                self.settled = True
                return False
        price = SECONDS + len(self._code) * SECONDS_PER_CHARACTER
        path = self._folder / library_name(self._code)
        kept = os.access(path, os.R_OK)  # where a folder above is another user's, `exists` is an error
        if not kept and (self.seconds + expected < price or len(self._code) > LONGEST):
            return False
        self.settled = True
        if not kept and not _compile(self._code, path):
            return False
        self._code = ""
        try:
            self._loop = ctypes.CDLL(str(path)).run
        except OSError:  # a folder from which nothing may be run, a damaged file
            return False
        KEPT.used(path)
        return True

    @property
    def is_compiled(self) -> bool:
        """Whether the library is there."""
        return self._loop is not None

    def run(self, state: np.ndarray, inputs: Sequence[np.ndarray], n: int) -> tuple[np.ndarray, np.ndarray]:
        """States (n, n_s) and results (n, n_r) of a recursion from `state` (n_s,), all in the library; inputs (n, .), or (1, .) of what is
        constant. Raises ValueError for an input of the wrong size, RuntimeError where there is no library or a sample fails."""
        one, rows = self.function, [np.ascontiguousarray(x, float) for x in (state, *inputs)]
        for i, x in enumerate(rows):
            wanted = one.nnz_in(i) * (1 if i == 0 else len(x))
            if x.size != wanted or (i and len(x) not in (1, n)):
                raise ValueError(f"argument {one.name_in(i)} has {number_of(x.size, 'number')} instead of {wanted}")
        states, results = np.empty((n, one.nnz_out(0))), np.empty((n, one.nnz_out(1)))
        given = (ctypes.c_void_p * len(inputs))(*(x.ctypes.data for x in rows[1:]))
        by = (ctypes.c_longlong * len(inputs))(*(x.shape[1] if len(x) == n else 0 for x in rows[1:]))
        at = [ctypes.c_void_p(x.ctypes.data) for x in (rows[0], states, results)]
        n_s, n_r, count, samples = (ctypes.c_longlong(k) for k in (states.shape[1], results.shape[1], len(inputs), n))
        # pointers, integers and numbers, all of eight bytes
        work = [np.empty(size + 1) for size in (one.sz_arg(), one.sz_res(), one.sz_iw(), one.sz_w())]
        memory = (ctypes.c_void_p(x.ctypes.data) for x in work)
        if self._loop is None or self._loop(samples, given, by, count, at[0], at[1], n_s, at[2], n_r, *memory):
            raise RuntimeError(f"{one.name()} could not be evaluated")
        return states, results


@functools.cache
def compiler() -> str | None:
    """The C compiler: $CC, cc or gcc; None where there is none or CTRLGEN_NO_COMPILER is set."""
    if os.environ.get("CTRLGEN_NO_COMPILER"):
        return None
    return next((path for name in (os.environ.get("CC"), "cc", "gcc") if name and (path := shutil.which(name))), None)


def library_name(code: str) -> str:
    """The file of the library in the cache folder: other code, another compiler or other options have another one."""
    digest = hashlib.sha256("\0".join((code, str(compiler()), *FLAGS)).encode()).hexdigest()[:32]
    return f"{digest}.so"


def _compile(code: str, path: Path) -> bool:
    """Compiles to `path`, which appears as a whole or not at all; whether that was possible."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=path.parent) as folder:
            source, library = Path(folder, "step.c"), Path(folder, "step.so")
            source.write_text(code)
            command = [str(compiler()), *FLAGS, str(source), "-o", str(library), "-lm"]
            subprocess.run(command, check=True, capture_output=True, timeout=300)
            library.replace(path)
        KEPT.added(path.parent)
        return True
    except (OSError, subprocess.SubprocessError):
        return False
