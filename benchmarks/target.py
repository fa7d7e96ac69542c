"""Instructions a sample on emulated microcontrollers: the generated C against CasADi's C for the same sample."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np

from benchmarks import casadi_c, table
from benchmarks.measure import Count, Note
from benchmarks.samples import NEAR, NEAR_FLOAT, Disagreement, Samples
from ctrlgen.controller.controller_step import ControllerStatus
from ctrlgen.controller.fixed_point import fixed_point
from ctrlgen.controller.fixed_step import FixedController
from ctrlgen.core.errors import ToolError
from ctrlgen.firmware.c.real import Arithmetic, Integers, Real
from ctrlgen.firmware.folder import CFolder, generate
from ctrlgen.verification.cores import (
    BASE,
    INSTALL,
    M0_PLUS,
    M3,
    M4F,
    M7,
    RV32IMC,
    Core,
    cross_compile,
    cross_compilers,
)
from ctrlgen.verification.emulation import MISSING, Machine, available
from ctrlgen.verification.in_loop import WORDS_BEHIND
from ctrlgen.verification.integer_comparison import numbers_of

COMPILER = "arm-none-eabi-gcc"  # CasADi's C calls sqrt, which needs a library
TOLERANCE = {Real.DOUBLE: casadi_c.TOLERANCE, Real.FLOAT: 2e-5}  # of scaled residuals: what single precision can meet
OFF = {Real.DOUBLE: NEAR, Real.FLOAT: 10 * NEAR_FLOAT}  # m: a peer's answer may be; ours is held to less by `online`
PEERS = {casadi_c.NEWTON: casadi_c.newton, casadi_c.SQP: casadi_c.sqp}
# What makes single precision of CasADi's C with casadi_real = float: as generated it computes in double.
REPAIRED = "#include <math.h>\n" + "".join(f"#define {f} {f}f\n" for f in ("sqrt", "fabs", "fmin", "fmax"))
LIBRARIES = ("-Wl,--start-group", "-lm", "-lc", "-lnosys", "-lgcc", "-Wl,--end-group")
WITHIN, AT_WORST = 700, 6000  # instructions of ours in float on a Cortex-M4F
WITHIN_INTEGERS = 12_000  # in integers on a Cortex-M0+: a quarter of 1 kHz at 48 MHz


def run(repeat: int) -> list[Count | Note]:
    """The longest call on the circle, and of ours on jumps beyond every limit. Counts are exact: `repeat` changes nothing."""
    if not available() or COMPILER not in cross_compilers():
        return [Note(f"target: not run; {MISSING}; {INSTALL[COMPILER]}")]
    samples = Samples()
    found: list[Count | Note] = []
    with tempfile.TemporaryDirectory(prefix="ctrlgen-bench-") as name:
        scratch = Path(name)
        c = generate(samples.scenario, samples.model, scratch / "c", samples.solution)
        for core, real in ((M4F, Real.FLOAT), (M7, Real.DOUBLE)):
            where, single = f"{core.name}, {real.value}", real is Real.FLOAT
            circle, jumps = _ours(samples, c, core, real, scratch)
            for title, make in PEERS.items():
                for repaired in (True, False) if single else (False,):
                    how = f"{title}, {'repaired' if repaired else 'as generated'}" if single else title
                    try:
                        theirs = _peer(samples, make, core, real, repaired, scratch)
                    except (RuntimeError, ToolError, Disagreement) as error:
                        found.append(Note(f"{where}: {how}: not available: {' '.join(str(error).split())[:300]}"))
                    else:
                        aim = WITHIN if single else None
                        found.append(Count(f"online C, circle, {where}", circle, how, theirs, aim))
            by_hand = _table(samples, core, real, scratch)
            found.append(Count(f"online C, circle, {where}", circle, f"{table.NAME}; {table.KEEPS}", by_hand))
            aim = AT_WORST if single else None
            found.append(Count(f"online C, jumps beyond limits, {where}", jumps, "online C, circle", circle, aim))
        found += _in_integers(samples, scratch / "integers")
    return found


def _in_integers(samples: Samples, into: Path) -> list[Count | Note]:
    """The controller in integers on cores without a floating-point unit, beside that in emulated float: the longest step of the first
    samples of the circle, as many as `ctrlgen verify` counts there, and of as many jumps."""
    asked = samples.scenario.file.model_copy(update={"fixed_point": True})
    c = generate(replace(samples.scenario, file=asked), samples.model, into, samples.solution)
    counter = FixedController(fixed_point(samples.controller))
    before, rest = samples.command[-1], samples.controller.rest()
    settled = samples.controller.step(rest, before, settle=True).state
    at = counter.at(counter.counts(before[None])[0])
    found: list[Count | Note] = []
    for core in (M3, M0_PLUS, RV32IMC):
        compiler = core.architecture.value
        if compiler not in cross_compilers():
            found.append(Note(f"target: {core.name} not run; {INSTALL[compiler]}"))
            continue
        counts: dict[tuple[str, Arithmetic], int] = {}
        for where, targets in (("circle", samples.command), ("jumps beyond limits", samples.jumps())):
            targets = targets[: core.calls]
            start = settled if where == "circle" else rest
            counts[where, Real.FLOAT] = _longest(c, core, Real.FLOAT, targets, np.concatenate(start))
            numbers = np.concatenate(numbers_of(at if where == "circle" else counter.rest()))
            counts[where, Integers.Q31] = _longest(c, core, Integers.Q31, counter.counts(targets), numbers)
            ours = f"online C in integers, {where}, {core.name}"
            within = WITHIN_INTEGERS if core is M0_PLUS and where == "circle" else None
            by_float = counts[where, Real.FLOAT]
            found.append(Count(ours, counts[where, Integers.Q31], "online C, float in software", by_float, within))
    return found


def _longest(c: CFolder, core: Core, real: Arithmetic, targets: np.ndarray, start: np.ndarray) -> int:
    """Instructions of the longest step over `targets` from the state `start`."""
    name, compiler = c.online[real], core.architecture.value
    program = c.path / f"{name}_{core.name}.elf"
    if not program.exists():
        cross_compile(compiler, core, [c.path / f"{name}.c"], c.path, c.init[real], program)
    machine = Machine(core, program)
    words = max(c.state_words, WORDS_BEHIND)
    state, target, out = (machine.reserve(n, real) for n in (len(start) + words, targets.shape[1], 3 * len(start)))
    machine.call(c.init[real], state)
    machine.write(state, start, real)
    counted = []
    for wanted in targets:
        machine.write(target, wanted, real)
        status, count = machine.call(f"{name}_step", state, target, out)
        if status & (ControllerStatus.LOST | ControllerStatus.INPUT):
            raise Disagreement(f"{name} is lost on the emulated {core.name}")
        counted.append(count)
    return max(counted)


def _ours(samples: Samples, c: CFolder, core: Core, real: Real, scratch: Path) -> tuple[int, int]:
    """Instructions of the longest step on the circle, and on the jumps."""
    name, n = c.online[real], samples.axes
    program = scratch / f"{name}.elf"
    cross_compile(COMPILER, core, [c.path / f"{name}.c"], c.path, c.init[real], program)
    machine = Machine(core, program)
    numbers = (2 * n + c.state_words + c.given_numbers, samples.command.shape[1], 3 * n)
    state, target, out = (machine.reserve(count, real) for count in numbers)

    def call(function: str, wanted: np.ndarray) -> tuple[int, int]:
        machine.write(target, wanted, real)
        return machine.call(f"{name}_{function}", state, target, out)

    machine.call(c.init[real], state)
    while call("settle", samples.command[-1])[0] & ControllerStatus.UNSURE:
        pass  # held until it knows that the device is there
    circle = [call("step", t) for t in samples.command]
    jumps = [call("step", t) for t in samples.jumps()]
    lost = ControllerStatus.LOST | ControllerStatus.INPUT
    if any(status for status, _ in circle) or any(status & lost for status, _ in jumps):
        raise Disagreement("the circle meets a limit, or the controller is lost, on the emulated core")
    return max(count for _, count in circle), max(count for _, count in jumps)


def _table(samples: Samples, core: Core, real: Real, scratch: Path) -> int:
    """Instructions of the table's longest call on the circle."""
    source = table.write(samples, real, scratch / "table")
    name, program, n = source.stem, scratch / f"{source.stem}.elf", samples.axes
    cross_compile(COMPILER, core, [source], source.parent, f"{name}_step", program)
    machine = Machine(core, program)
    state, target, out = (machine.reserve(count, real) for count in (n, n, 3 * n))
    machine.write(state, samples.model.rest, real)
    counted = []
    for wanted in samples.command:
        machine.write(target, wanted, real)
        counted.append(machine.call(f"{name}_step", state, target, out)[1])
    return max(counted)


def _peer(
    samples: Samples, make: Callable[..., ca.Function], core: Core, real: Real, repaired: bool, scratch: Path
) -> int:
    """Instructions of the longest call on the circle, answers checked. Raises what it raises where it cannot be built or run."""
    function = make(samples, TOLERANCE[real])
    folder = scratch / f"{function.name()}_{real.suffix}_{repaired}"
    folder.mkdir()
    text = casadi_c.contender(function, samples, folder, real).replace("LINKAGE", "")
    source, program = folder / "contender.c", folder / "contender.elf"
    source.write_text(
        text + "const real *displacement(int i);\nconst real *displacement(int i) { return &y[now][i]; }\n"
    )
    (folder / "repaired.h").write_text(REPAIRED)
    single = ("-fsingle-precision-constant", "-include", str(folder / "repaired.h")) if repaired else ()
    more = (*single, "-w", f"-Wl,-Ttext={BASE:#x}", *LIBRARIES)
    cross_compile(COMPILER, core, [source, folder / f"{function.name()}.c"], folder, "answer_to", program, more)
    machine = Machine(core, program)
    target = machine.reserve(samples.command.shape[1], real)
    model, n = samples.model, samples.axes
    pose = ca.Function("pose", [model.x, model.z], [model.signals[samples.scenario.file.follow].expr])
    machine.write(target, samples.command[-1], real)
    machine.call("start", target)
    longest = 0
    for k, wanted in enumerate(samples.command):
        machine.write(target, wanted, real)
        longest = max(longest, machine.call("answer_to", target)[1])
        if k % 100 == 0:
            y = machine.read(machine.call("displacement", 0)[0], n, real).astype(float)
            off = np.abs(pose(model.rest, y * model.z_scale).full().ravel() - wanted)[3:].max()
            if not off <= OFF[real]:
                raise Disagreement(f"{1e9 * off:.3g} nm off its target")
    return longest
