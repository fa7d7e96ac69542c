"""Processor in the loop, emulated: the generated C cross-compiled, run over the scenario and beyond, counted and compared.

The answers of the core must equal those of the same C on this computer bit for bit.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ctrlgen.core.errors import ToolError
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.folder import CFolder
from ctrlgen.verification.cores import CORES, INSTALL, Core, cross_compile, cross_compilers
from ctrlgen.verification.emulation import MISSING, Machine, available
from ctrlgen.verification.host import Host
from ctrlgen.verification.reference import ReferenceAnswers

RANDOM = 400  # of the reference's random targets, reachable and beyond


@dataclass(frozen=True)
class Cost:
    """Instructions of one kind of call: the worst and the mean over `calls` of them, and how many were within all limits."""

    what: str
    calls: int
    mean: float
    worst: int
    worst_within: int | None


@dataclass(frozen=True)
class TargetRun:
    """One arithmetic on one core by one compiler. Sizes in bytes; `stack` is the most that any call used.

    `differing` of `numbers` differ from this computer's by at most `ulp` units in the last place, first in `where`.
    """

    core: str
    compiler: str
    real: Real
    costs: tuple[Cost, ...]
    stack: int
    code: int
    tables: int
    writable: int
    numbers: int
    differing: int
    ulp: int
    where: str

    def worst(self, kind: str, *, status_0: bool = False) -> int | None:
        """Most instructions of one call whose `what` begins with `kind`, or of those answered with status 0; None without one."""
        costs = [cost for cost in self.costs if cost.what.startswith(kind)]
        counts = [cost.worst_within if status_0 else cost.worst for cost in costs]
        return max((count for count in counts if count is not None), default=None)

    @property
    def instructions(self) -> dict[str, int | None]:
        """Most instructions of one call: along the scenario; answered with status 0; at all; to settle; of the player.

        A target within all limits costs more where a limit of several channels, such as a stress, is near: the cheap bound
        that the scenario stays below does not tell, and the limit itself is worked out.
        """
        kind = "step" if self.worst("step") is not None else "settle"
        return {
            "scenario": self.worst(f"{kind}, along"), "status_0": self.worst(kind, status_0=True), "worst": self.worst(kind),
            "settle": self.worst("settle"), "player": self.worst("player"),
        }  # fmt: skip

    @property
    def passed(self) -> bool:
        """Whether every number is this computer's, and nothing is kept in writable memory of its own."""
        return self.differing == 0 and self.writable == 0


@dataclass(frozen=True)
class Stopped:
    """A run that did not come to its end, with the message: program refused, processor fault, or a call that does not return."""

    core: str
    compiler: str
    real: Real
    words: str


@dataclass(frozen=True)
class InLoop:
    """All runs, those that stopped early, and (tool, remedy) of what did not run."""

    runs: tuple[TargetRun, ...]
    stopped: tuple[Stopped, ...]
    not_run: tuple[tuple[str, str], ...]

    @property
    def passed(self) -> bool:
        """Whether everything that ran did so to its end with this computer's numbers."""
        return not self.stopped and all(run.passed for run in self.runs)


def run_in_loop(
    folder: CFolder, reference: ReferenceAnswers, progress: Callable[[str], None] = lambda _: None
) -> InLoop:
    """Every core, arithmetic and cross compiler that is there. Raises ToolError where this computer's own compiler refuses the C."""
    if not available():
        return InLoop((), (), (("emulated cores", MISSING),))
    compilers = cross_compilers()
    missing = tuple((name, INSTALL[name]) for name in INSTALL if name not in compilers)
    if not compilers:
        return InLoop((), (), missing)
    runs: list[TargetRun] = []
    stopped: list[Stopped] = []
    with tempfile.TemporaryDirectory(prefix="ctrlgen-") as name:
        hosts = {real: Host(folder, reference, real, Path(name)) for real in Real}
        for core in CORES:
            for compiler, version in compilers.items():
                for real in core.reals:
                    progress(f"{core.name}, {compiler}, {real.value}")
                    try:
                        runs.append(_run(folder, reference, hosts[real], core, compiler, version, Path(name)))
                    except ToolError as error:
                        stopped.append(Stopped(core.name, version, real, str(error)))
    return InLoop(tuple(runs), tuple(stopped), missing)


def _run(
    folder: CFolder, ref: ReferenceAnswers, host: Host, core: Core, compiler: str, version: str, scratch: Path
) -> TargetRun:
    real = host.real
    machines = {}
    for piece, names in (("online", folder.online), ("player", folder.player)):
        if names:
            program = scratch / f"{piece}_{core.name}_{compiler}_{real.suffix}.elf"
            entry = f"{names[real]}_init" if piece == "online" else f"{names[real]}_sample"
            cross_compile(compiler, core, [folder.path / f"{names[real]}.c"], folder.path, entry, program)
            machines[piece] = Machine(core, program)
    costs, compared = [], _Compared(real)
    for what, answers, expected in _sequences(machines, folder, ref, host):
        counts, plain = [], []
        for k, (numbers, status, count) in enumerate(answers):
            counts.append(count)
            if status == 0:
                plain.append(count)
            compared.add(what, k, np.concatenate([[status], numbers.astype(float)]), expected[k])
        costs.append(Cost(what, len(counts), float(np.mean(counts)), max(counts), max(plain, default=None)))
    return TargetRun(
        core.name, version, real, tuple(costs), max(m.stack for m in machines.values()), sum(m.code for m in machines.values()),
        sum(m.tables for m in machines.values()), sum(m.writable for m in machines.values()),
        compared.numbers, compared.differing, compared.ulp, compared.where,
    )  # fmt: skip


Answers = Iterator[tuple[np.ndarray, int, int]]  # numbers, status, instructions of each call


def _sequences(
    machines: dict[str, Machine], folder: CFolder, ref: ReferenceAnswers, host: Host
) -> Iterator[tuple[str, Answers, np.ndarray]]:
    """What is run, its answers, and this computer's."""
    online, real, machine = folder.online[host.real], host.real, machines["online"]
    nu, m = ref.model.u.numel(), ref.random.shape[1]
    answered = nu + len(ref.model.axes) + ref.model.n_states
    numbers = sum(part.size for part in ref.controller.rest()) + 1 + folder.given_numbers
    state, target, out = (machine.reserve(count, real) for count in (numbers, m, answered))

    def answers(function: str, targets: np.ndarray) -> Answers:
        for wanted in targets:
            with np.errstate(over="ignore"):
                machine.write(target, wanted, real)
            status, count = machine.call(f"{online}_{function}", state, target, out)
            yield machine.read(out, answered, real), status, count

    random = ref.random[:: max(1, len(ref.random) // RANDOM)]
    if ref.scenario.sample_time is not None:
        machine.call(f"{online}_init", state)
        machine.write(state, np.concatenate(ref.start), real)
        yield "step, along the scenario", answers("step", ref.command), host.followed(ref.command, ref.start)
        rest = ref.controller.rest()
        for what, targets in (("step, random targets", random), ("step, hostile targets", ref.hostile)):
            machine.write(state, np.concatenate(rest), real)
            yield what, answers("step", targets), host.followed(targets, rest)
    else:  # nothing but equilibria
        machine.call(f"{online}_init", state)
        yield "settle, along the scenario", answers("settle", ref.command), host.settled(ref.command)
    machine.call(f"{online}_init", state)
    yield "settle, random targets", answers("settle", random), host.settled(random)
    if "player" in machines:
        player, drive = machines["player"], machines["player"].reserve(nu, real)
        samples = np.arange(len(ref.solution.drive))

        def played() -> Answers:
            for k in samples:
                status, count = player.call(f"{folder.player[real]}_sample", int(k), drive)
                yield player.read(drive, nu, real), status, count

        yield "player, a sample", played(), host.played(samples)


class _Compared:
    """Counts the numbers that differ from this computer's, and by how many units in the last place."""

    def __init__(self, real: Real) -> None:
        self.real, self.numbers, self.differing, self.ulp, self.where = real, 0, 0, 0, ""

    def add(self, what: str, k: int, answer: np.ndarray, expected: np.ndarray) -> None:
        self.numbers += len(answer)
        different = ~((answer == expected) | (np.isnan(answer) & np.isnan(expected)))
        if different.any():
            self.differing += int(different.sum())
            self.where = self.where or f"{what}, call {k}"
            number, integer = (np.float32, np.int32) if self.real is Real.FLOAT else (np.float64, np.int64)
            bits = [v[different].astype(number).view(integer).astype(object) for v in (answer, expected)]
            ordered = [[b if b >= 0 else -(b + 2 ** (8 * self.real.bytes - 1)) for b in side] for side in bits]
            self.ulp = max(self.ulp, *(abs(a - b) for a, b in zip(*ordered, strict=True)))
