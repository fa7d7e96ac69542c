"""CasADi functions compiled to machine code where a C compiler is there, and left to CasADi's virtual machine elsewhere.

Compiled libraries are kept in the user's cache folder under the SHA-256 of their code, so that another diagnosis of the same
device need not compile them again. The code is compiled without contraction of products and sums: its results are those of the
virtual machine to the last bit.
"""

from __future__ import annotations

import functools
import hashlib
import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

import casadi as ca

FLAGS = ("-O1", "-fPIC", "-shared", "-ffp-contract=off", "-w")
# Of generated C, for the compiler: measured with gcc 12 to 14 on steps of an axis and a hexapod.
SECONDS_PER_CHARACTER = 4e-6
# Characters of generated C above which it is compiled in parts: four seconds and not fifteen for a million.
LARGE = 400_000
PART = 250  # statements of a part
FUNCTION = re.compile(
    r"^static int (?P<name>casadi_f\d+)\((?P<arguments>[^)]*)\) \{\n(?P<body>.*?)  return 0;\n\}\n", re.M | re.S
)
IN_WORK_VECTOR = re.compile(r"  (w\[\d+\]=|if \(res\[\d+\]!=0\) )")
PLACE = re.compile(r"w\[(\d+)\]")
LONGEST = 6_000_000  # characters of generated C: beyond, the compiler takes longer than the diagnosis


class Compilable:
    """`function`, and the library that takes its place once it has run so long that compiling pays."""

    def __init__(self, function: ca.Function) -> None:
        self.function = function
        self.seconds = 0.0  # spent in the virtual machine so far
        self._code: str | None = None
        self._settled = compiler() is None

    def spent(self, seconds: float) -> bool:
        """Counts `seconds` of the virtual machine; whether `function` has been replaced by its library."""
        if self._settled:
            return False
        self.seconds += seconds
        if self._code is None:
            if self.seconds < 0.2:  # what hardly runs need not be written as C
                return False
            self._code = c_code(self.function)
        price = len(self._code) * SECONDS_PER_CHARACTER
        path = _library(self._code)
        if not path.exists() and (self.seconds < price or len(self._code) > LONGEST):
            return False
        self._settled = True
        if not path.exists() and not _compile(self._code, path):
            return False
        self.function, self._code = ca.external(self.function.name(), str(path)), ""
        return True


@functools.cache
def compiler() -> str | None:
    """The C compiler: $CC, cc or gcc; None where there is none or CTRLGEN_NO_COMPILER is set."""
    if os.environ.get("CTRLGEN_NO_COMPILER"):
        return None
    return next((path for name in (os.environ.get("CC"), "cc", "gcc") if name and (path := shutil.which(name))), None)


def c_code(function: ca.Function) -> str:
    """C of `function` with CasADi's interface, in parts where it is long."""
    code = _generated(function, avoid_stack=False)
    return code if len(code) < LARGE else _in_parts(_generated(function, avoid_stack=True))


def _generated(function: ca.Function, avoid_stack: bool) -> str:
    with tempfile.TemporaryDirectory() as folder:
        generator = ca.CodeGenerator("step.c", {"avoid_stack": avoid_stack})
        generator.add(function)
        generator.generate(f"{folder}/")
        return Path(folder, "step.c").read_text()


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


def _library(code: str) -> Path:
    digest = hashlib.sha256("\0".join((code, str(compiler()), *FLAGS)).encode()).hexdigest()[:32]
    root = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(root) / "ctrlgen" / f"{digest}.so"


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
        return True
    except (OSError, subprocess.SubprocessError):
        return False
