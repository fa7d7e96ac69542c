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
from ctrlgen.numerics.kept_libraries import KeptLibraries

FLAGS = ("-Og", "-fPIC", "-shared", "-ffp-contract=off", "-w", *(("-nostdlib",) if sys.platform == "linux" else ()))
# Of generated C, for the compiler: measured with gcc 12 on steps of an axis and a hexapod.
SECONDS, SECONDS_PER_CHARACTER = 0.02, 4e-6
# Samples that the virtual machine runs in the time that writing the C takes: on the same 120 to 600 of an axis, 400 to 1 300 of a hexapod.
SAMPLES_TO_WRITE = 1000
# Characters of generated C above which it is compiled in parts: the time of one function grows faster than its length. Plays before
# creep, gcc 12: 0.6 instead of 1.0 s of 118,000 and 1.5 instead of 3.6 s of 270,000, and about the same time of a sample.
LARGE = 100_000
PART = 250  # statements of a part
FUNCTION = re.compile(
    r"^static int (?P<name>casadi_f\d+)\((?P<arguments>[^)]*)\) \{\n(?P<body>.*?)  return 0;\n\}\n", re.M | re.S
)
IN_WORK_VECTOR = re.compile(r"  (w\[\d+\]=|if \(res\[\d+\]!=0\) )")
PLACE = re.compile(r"w\[(\d+)\]")
LONGEST = 6_000_000  # characters of generated C: beyond, the compiler takes longer than the diagnosis

INTERFACE = re.compile(r"^CASADI_SYMBOL_EXPORT int \w+\(.*\{\n  return (?P<main>casadi_f\d+)\(", re.M)
KEEPS_NO_MEMORY = re.compile(r"_checkout\(void\) \{\n  return 0;\n\}")
CONFIGURATION = re.compile(
    r"^CASADI_SYMBOL_EXPORT \w+ \w*casadi_(version|int_size|real_size)\(.*\{(.*\}|[^}]*\n\})\n", re.M
)
# what CasADi calls for one or two numbers
HELPER = re.compile(r"^(?=casadi_real casadi_\w+\(casadi_real \w+(, casadi_real \w+)?\) ?\{)", re.M)
# <math.h> without what a header takes: what CasADi calls, and the two numbers
UNARY = "acos acosh asin asinh atan atanh cbrt ceil cos cosh erf exp expm1 fabs floor log log10 log1p sin sinh sqrt tan tanh"
BINARY = "atan2 copysign fmax fmin fmod hypot pow remainder"
DECLARED = (
    "".join(f"double {name}(double);\n" for name in UNARY.split())
    + "".join(f"double {name}(double, double);\n" for name in BINARY.split())
    + '#define INFINITY __builtin_inf()\n#define NAN __builtin_nan("")\n'
)

# A recursion as one call, sample after sample on the caller's memory: CasADi copies what goes in and out of every sample, which takes
# as long as the equations of an axis. What a fast lag remembers of its beginning decays below the least normal number, which slows a
# processor down: it is flushed to zero while the loop runs (slopes of a lag of 10 ms along 20,000 samples: 0.6 instead of 1.0 s).
# `by`: numbers from one sample of an argument to the next, 0 for one that is constant.
LOOP = """
CASADI_SYMBOL_EXPORT int run(casadi_int n, const casadi_real** given, const casadi_int* by, casadi_int n_given,
                             const casadi_real* state, casadi_real* states, casadi_int n_s, casadi_real* results, casadi_int n_r,
                             const casadi_real** arg, casadi_real** res, casadi_int* iw, casadi_real* w) {{
  casadi_int k, i, failed = 0;
#ifdef __SSE2__
  const unsigned mode = __builtin_ia32_stmxcsr();
  __builtin_ia32_ldmxcsr(mode | 0x8040);
#endif
  for (k = 0; k < n && !failed; ++k) {{
    arg[0] = state;
    for (i = 0; i < n_given; ++i) arg[i + 1] = given[i] + k*by[i];
    res[0] = states + k*n_s;
    res[1] = results + k*n_r;
    failed = {main}(arg, res, iw, w, 0) != 0;
    state = states + k*n_s;
  }}
#ifdef __SSE2__
  __builtin_ia32_ldmxcsr(mode);
#endif
  return (int) failed;
}}
"""

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


def c_code(function: ca.Function) -> str:
    """C of the recursion `function` in a loop over samples, in parts where it is long. Raises ValueError for a function that keeps memory
    from one call to the next."""
    code = casadi_c(function)
    interface = INTERFACE.search(code)
    if interface is None or not KEEPS_NO_MEMORY.search(code):
        raise ValueError(f"{function.name()} keeps memory from one call to the next")
    code = CONFIGURATION.sub("", code[: interface.start()]).replace("#include <math.h>\n", DECLARED)
    return HELPER.sub("static inline __attribute__((always_inline)) ", code) + LOOP.format(main=interface["main"])


def casadi_c(function: ca.Function) -> str:
    """C of any `function` with CasADi's interface, in parts where it is long."""
    code = _generated(function, avoid_stack=False)
    return code if len(code) < LARGE else _in_parts(_generated(function, avoid_stack=True))


def _generated(function: ca.Function, avoid_stack: bool) -> str:
    generator = ca.CodeGenerator("step.c", {"avoid_stack": avoid_stack})
    generator.add(function)
    return generator.dump()


def _in_parts(code: str) -> str:
    """The generated C with long functions that only compute in the work vector cut into functions of `PART` statements, as a compiler's
    time grows faster than the length of a function. What no other part reads is a local variable, as every access to the work vector
    is a memory access to the compiler too: in all half of the time."""

    def parts(match: re.Match[str]) -> str:
        name, body = match["name"], match["body"].splitlines(keepends=True)
        if len(body) <= PART or not all(IN_WORK_VECTOR.match(line) for line in body):
            return match[0]
        pieces = _with_locals([body[k : k + PART] for k in range(0, len(body), PART)])
        head = "(const casadi_real** arg, casadi_real** res, casadi_real* w)"
        defined = "".join(
            f"__attribute__((noinline)) static void {name}_{k}{head} {{\n{piece}}}\n\n"
            for k, piece in enumerate(pieces)
        )
        calls = "".join(f"  {name}_{k}(arg, res, w);\n" for k in range(len(pieces)))
        return f"{defined}static int {name}({match['arguments']}) {{\n{calls}  return 0;\n}}\n"

    return FUNCTION.sub(parts, code)


def _with_locals(parts: list[list[str]]) -> list[str]:
    """The parts, in each a local variable for every value, which ends in the work vector where a later part reads it."""
    read: set[str] = set()  # places that the parts after this one read before they write them
    pieces = []
    for part in reversed(parts):
        now: dict[str, str] = {}  # place -> the local variable that holds it
        before: set[str] = set()
        lines = []

        def local(match: re.Match[str], now: dict[str, str] = now, before: set[str] = before) -> str:
            if match[1] not in now:
                before.add(match[1])
            return now.get(match[1], match[0])

        for statement in part:
            place = PLACE.match(statement, 2)
            if place is None:
                lines.append(PLACE.sub(local, statement))
                continue
            value = PLACE.sub(local, statement[place.end() :])
            now[place[1]] = f"a{len(lines)}"
            lines.append(f"  const casadi_real a{len(lines)}{value}")
        lines += [f"  w[{place}]={name};\n" for place, name in now.items() if place in read]
        read = (read - now.keys()) | before
        pieces.append("".join(lines))
    return pieces[::-1]


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
