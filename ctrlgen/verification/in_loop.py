"""Processor in the loop, emulated: the generated C cross-compiled, run over the scenario and beyond, counted and compared.

The answers of the core must equal those of the same C on this computer bit for bit.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ctrlgen.controller.controller_step import ControllerStatus
from ctrlgen.core.errors import ToolError
from ctrlgen.firmware.c.real import Arithmetic, Integers, Real
from ctrlgen.firmware.folder import CFolder
from ctrlgen.verification.cores import CORES, INSTALL, Core, cross_compile, cross_compilers
from ctrlgen.verification.emulated_target import CallCost, CallKind, NotRun, StoppedTarget, Target
from ctrlgen.verification.emulation import MISSING, Machine, available
from ctrlgen.verification.host import Host
from ctrlgen.verification.integer_comparison import IntegerAnswers, numbers_of
from ctrlgen.verification.reference import ReferenceAnswers

RANDOM = 400  # of the reference's random targets, reachable and beyond
WORDS_BEHIND = 3  # of the state of the controller in integers, behind states and displacement


@dataclass(frozen=True)
class InLoop:
    """All runs, those that stopped early, and what did not run."""

    runs: tuple[Target, ...]
    stopped: tuple[StoppedTarget, ...]
    not_run: tuple[NotRun, ...]

    @property
    def passed(self) -> bool:
        """Whether everything that ran did so to its end with this computer's numbers."""
        return not self.stopped and all(run.passed for run in self.runs)


def run_in_loop(
    folder: CFolder, reference: ReferenceAnswers, progress: Callable[[str], None] = lambda _: None
) -> InLoop:
    """Every core, arithmetic and cross compiler that is there, see `CORES`. Raises ToolError where this computer's own compiler refuses the
    C."""
    if not available():
        return InLoop((), (), (NotRun(what="emulated cores", remedy=MISSING),))
    compilers = cross_compilers()
    missing = tuple(NotRun(what=name, remedy=INSTALL[name]) for name in INSTALL if name not in compilers)
    if not compilers:
        return InLoop((), (), missing)
    runs: list[Target] = []
    stopped: list[StoppedTarget] = []
    with tempfile.TemporaryDirectory(prefix="ctrlgen-") as scratch:
        hosts = {real: Host(folder, reference, real, Path(scratch)) for real in folder.arithmetics}
        for core in CORES:
            for compiler in (name for name in core.compilers if name in compilers):
                version = compilers[compiler]
                for real in core.tried(folder.arithmetics):
                    progress(f"{core.name}, {compiler}, {real.value}")
                    try:
                        runs.append(_run(folder, reference, hosts[real], core, compiler, version, Path(scratch)))
                    except ToolError as error:
                        stopped.append(StoppedTarget(core=core.name, compiler=version, real=real, words=str(error)))
    return InLoop(tuple(runs), tuple(stopped), missing)


def _run(
    folder: CFolder, ref: ReferenceAnswers, host: Host, core: Core, compiler: str, version: str, scratch: Path
) -> Target:
    real = host.real
    machines = {}
    pieces: tuple[tuple[str, Mapping[Any, str]], ...] = (("online", folder.online), ("player", folder.player))
    for piece, names in pieces:
        if real in names:
            program = scratch / f"{piece}_{core.name}_{compiler}_{real.suffix}.elf"
            entry = folder.init[real] if piece == "online" else folder.sample[Real(real)]
            cross_compile(compiler, core, [folder.path / f"{names[real]}.c"], folder.path, entry, program)
            machines[piece] = Machine(core, program)
    costs, compared = [], _Compared(real)
    for what, answers, expected in _sequences(machines, folder, ref, host, core.calls):
        counts, plain = [], []
        for k, (numbers, status, count) in enumerate(answers):
            counts.append(count)
            if status & ~int(ControllerStatus.UNSURE) == 0:
                plain.append(count)
            compared.add(what, k, np.concatenate([[status], numbers.astype(float)]), expected[k])
        mean, within = float(np.mean(counts)), max(plain, default=None)
        costs.append(CallCost(what=what, calls=len(counts), mean=mean, worst=max(counts), worst_within=within))
    return Target(
        core=core.name,
        compiler=version,
        real=real,
        costs=tuple(costs),
        stack=max(m.stack for m in machines.values()),
        code=sum(m.code for m in machines.values()),
        tables=sum(m.tables for m in machines.values()),
        writable=sum(m.writable for m in machines.values()),
        numbers=compared.numbers,
        differing=compared.differing,
        ulp=compared.ulp,
        where=compared.where,
    )


Answers = Iterator[tuple[np.ndarray, int, int]]  # numbers, status, instructions of each call


def _sequences(
    machines: dict[str, Machine], folder: CFolder, ref: ReferenceAnswers, host: Host, most: int | None
) -> Iterator[tuple[CallKind, Answers, np.ndarray]]:
    """What is run, its answers, and this computer's; of each kind at most so many calls, the first ones."""
    if isinstance(host.real, Integers):
        yield from _in_integers(machines["online"], folder, IntegerAnswers(ref), host, most)
        return
    online, real, machine = folder.online[host.real], host.real, machines["online"]
    nu, m = ref.model.u.numel(), ref.random.shape[1]
    answered = ref.width
    numbers = sum(part.size for part in ref.controller.rest()) + folder.state_words + folder.given_numbers
    state, target, out = (machine.reserve(count, real) for count in (numbers, m, answered))

    def answers(function: str, targets: np.ndarray) -> Answers:
        for wanted in targets:
            with np.errstate(over="ignore"):
                machine.write(target, wanted, real)
            status, count = machine.call(f"{online}_{function}", state, target, out)
            # as the harness does: the samples of a path follow one another as those of its clock
            yield machine.read(out, answered, real), status & ~int(ControllerStatus.UNSURE), count

    count = min(RANDOM, most or RANDOM)
    random, command = ref.random[:: max(1, len(ref.random) // count)], ref.command[:most]
    if ref.scenario.sample_time is not None:
        machine.call(folder.init[real], state)
        machine.write(state, np.concatenate(ref.start), real)
        yield CallKind.STEP_SCENARIO, answers("step", command), host.followed(command, ref.start)
        rest = ref.controller.rest()
        for what, targets in ((CallKind.STEP_RANDOM, random), (CallKind.STEP_HOSTILE, ref.hostile[:most])):
            machine.write(state, np.concatenate(rest), real)
            yield what, answers("step", targets), host.followed(targets, rest)
    else:  # nothing but equilibria
        machine.call(folder.init[real], state)
        yield CallKind.SETTLE_SCENARIO, answers("settle", command), host.settled(command)
    machine.call(folder.init[real], state)
    yield CallKind.SETTLE_RANDOM, answers("settle", random), host.settled(random)
    if "player" in machines:
        player, drive = machines["player"], machines["player"].reserve(nu, real)
        samples = np.arange(len(ref.solution.drive))[:most]

        def played() -> Answers:
            for k in samples:
                status, count = player.call(folder.sample[Real(real)], int(k), drive)
                yield player.read(drive, nu, real), status, count

        yield CallKind.PLAYER, played(), host.played(samples)


def _in_integers(
    machine: Machine, folder: CFolder, integers: IntegerAnswers, host: Host, most: int | None
) -> Iterator[tuple[CallKind, Answers, np.ndarray]]:
    """The same of the controller in integers."""
    ref, real = integers.ref, host.real
    online, rest = folder.online[real], integers.controller.rest()
    sizes = (sum(part.size for part in numbers_of(rest)) + WORDS_BEHIND, integers.random.shape[1], ref.width)
    state, target, out = (machine.reserve(count, real) for count in sizes)

    def answers(function: str, targets: np.ndarray) -> Answers:
        for wanted in targets:
            machine.write(target, wanted, real)
            status, count = machine.call(f"{online}_{function}", state, target, out)
            yield machine.read(out, ref.width, real), status, count

    for what, targets, start in (
        (CallKind.STEP_SCENARIO, integers.command[:most], numbers_of(integers.start)),
        (CallKind.STEP_RANDOM, integers.random[:most], numbers_of(rest)),
        (CallKind.STEP_HOSTILE, integers.hostile[:most], numbers_of(rest)),
    ):
        machine.call(folder.init[real], state)
        machine.write(state, np.concatenate(start), real)
        yield what, answers("step", targets), host.followed(targets, start)
    machine.call(folder.init[real], state)
    yield CallKind.SETTLE_RANDOM, answers("settle", integers.random[:most]), host.settled(integers.random[:most])


class _Compared:
    """Counts the numbers that differ from this computer's, and by how many units in the last place."""

    def __init__(self, real: Arithmetic) -> None:
        self.real, self.numbers, self.differing, self.ulp, self.where = real, 0, 0, 0, ""

    def add(self, what: CallKind, k: int, answer: np.ndarray, expected: np.ndarray) -> None:
        self.numbers += len(answer)
        different = ~((answer == expected) | (np.isnan(answer) & np.isnan(expected)))
        if different.any():
            self.differing += int(different.sum())
            self.where = self.where or f"{what}, call {k}"
            places = [self._places(v[different]) for v in (answer, expected)]
            self.ulp = max(self.ulp, *(abs(a - b) for a, b in zip(*places, strict=True)))

    def _places(self, values: np.ndarray) -> list[int]:
        """Of each number its place among all numbers of its type."""
        if isinstance(self.real, Integers):
            return [int(v) for v in values]
        number, integer = (np.float32, np.int32) if self.real is Real.FLOAT else (np.float64, np.int64)
        bits = values.astype(number).view(integer).astype(object)
        return [b if b >= 0 else -(b + 2 ** (8 * self.real.bytes - 1)) for b in bits]
