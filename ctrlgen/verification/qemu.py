"""The package's own test of reference vectors on emulated boards: arm-none-eabi-gcc and qemu-system-arm."""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

from ctrlgen.core.errors import ToolError
from ctrlgen.firmware.c.real import Arithmetic
from ctrlgen.firmware.c.templates import write
from ctrlgen.firmware.folder import CFolder
from ctrlgen.verification.check import Check, error_in, finished, not_run, run_tool, version_of
from ctrlgen.verification.cores import CORES, INSTALL, Architecture, Core, cross_compile

TOOL = "qemu-system-arm"
REMEDY = "apt-get install qemu-system-arm"
WORDS = ("-nographic", "-monitor", "none", "-serial", "none", "-chardev", "stdio,id=sh")
SEMIHOSTING = ("-semihosting-config", "enable=on,target=native,chardev=sh")
OUTCOME = re.compile(r"^(\d+) of (\d+) disagree$", re.M)


def check_on_boards(folder: CFolder, progress: Callable[[str], None] = lambda _: None) -> tuple[Check, ...]:
    """The selftest of every arithmetic on every core's board; passed where every vector agrees."""
    compiler = Architecture.ARM_M.value
    missing = [remedy for tool, remedy in ((compiler, INSTALL[compiler]), (TOOL, REMEDY)) if not shutil.which(tool)]
    subjects = tuple((folder.selftest[real], real) for real in folder.arithmetics)
    if missing:
        return (not_run(TOOL, subjects, "; ".join(missing)),)
    checks = []
    with tempfile.TemporaryDirectory(prefix="ctrlgen-") as scratch:
        for core, board in ((core, core.board) for core in CORES if core.board is not None):
            for real in core.tried(folder.arithmetics):
                progress(f"{board}, {real.value}")
                checks.append(_run(folder, core, board, real, compiler, Path(scratch)))
    return tuple(checks)


def _run(folder: CFolder, core: Core, board: str, real: Arithmetic, compiler: str, scratch: Path) -> Check:
    subject = ((folder.selftest[real], real),)
    tool, version = f"{TOOL} -M {board} ({core.name}, {real.value})", version_of(TOOL) or ""
    for name in ("board.c", "board.ld"):
        write(name, {"selftest": folder.selftest[real]}, scratch / name)
    program = scratch / f"{board}_{real.suffix}.elf"
    sources = [*folder.sources(real), scratch / "board.c"]
    try:
        cross_compile(compiler, core, sources, folder.path, "reset", program, ("-T", str(scratch / "board.ld"), "-lc"))
    except ToolError as error:
        return finished(tool, version, subject, [error_in(sources[0].name, 1, "build", str(error))])
    done = run_tool([TOOL, "-M", board, *WORDS, *SEMIHOSTING, "-kernel", str(program)])
    outcome = OUTCOME.search(done.stdout)
    if outcome and outcome[1] == "0" and done.returncode == 0:
        return finished(tool, version, subject, (), f"{outcome[2]} of {outcome[2]} reference vectors agree")
    text = done.stdout.strip() or done.stderr.strip()[:500] or f"ended with status {done.returncode} without output"
    return finished(tool, version, subject, [error_in(f"{subject[0][0]}.c", 1, "vectors", text)])
