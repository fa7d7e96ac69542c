"""The generated online C per call, in double and in float, against solvers of the same sample."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median

import numpy as np

from benchmarks import casadi_c, least_squares, table
from benchmarks.measure import Line, Note, interleave, timed
from benchmarks.samples import NEAR, NEAR_FLOAT, Disagreement, Samples
from benchmarks.timed_c import Program, build, generated
from ctrlgen.budget.robust import solve
from ctrlgen.controller.controller_step import ControllerStatus
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.folder import generate

PASSES = 200  # over all targets of a set, in each round; the median counts
SLOW_PASSES = 20  # for peers that take microseconds
GUARDED = 0.5  # of the targets beyond the limits at least break a composite limit
IPOPT = "IPOPT, whole circle"
NEAREST = {Real.DOUBLE: NEAR, Real.FLOAT: NEAR_FLOAT}


def run(repeat: int) -> list[Line | Note]:
    """Three sets of targets: the circle, random reachable ones, and ones that break limits."""
    samples = Samples()
    results: list[Line | Note] = []
    with tempfile.TemporaryDirectory(prefix="ctrlgen-bench-") as scratch:
        folder = Path(scratch)
        c = generate(samples.scenario, samples.model, folder, samples.solution)
        ours: dict[str, tuple[Real, Program]] = {}
        for real, prefix in c.online.items():
            program = build(prefix, generated(prefix, real.value), folder / f"{prefix}.c", samples.axes)
            ours[f"online C {real.value}"] = real, program
        peers: dict[str, Program] = {}
        for title, function in ((casadi_c.NEWTON, casadi_c.newton), (casadi_c.SQP, casadi_c.sqp)):
            try:
                peers[title] = casadi_c.build_peer(title, function(samples), samples, folder)
            except (RuntimeError, Disagreement) as error:  # CasADi cannot write it, or gcc cannot build it
                results.append(Note(f"{title}: not available: {str(error).splitlines()[0]}"))

        tables = {real: table.build_table(samples, real, folder / "table") for real in Real}

        circle, reachable = samples.command, samples.reachable()
        beyond = {"beyond limits": samples.beyond(), "jumps beyond limits": samples.jumps()}
        for name, (real, program) in ours.items():
            _check_ours(samples, name, real, program, reachable, beyond)
        scipy_circle, scipy_reachable = (least_squares.solver(samples, targets) for targets in (circle, reachable))
        for name, program in peers.items():
            samples.check_circle(name, program.run(circle, 0)[0])
            samples.check(name, program.run(reachable, 0)[0], reachable)
            for targets in beyond.values() if name == casadi_c.NEWTON else ():  # it ignores limits: checkable
                samples.check(name, program.run(targets, 0)[0], targets)
        samples.check_circle(least_squares.NAME, scipy_circle())
        samples.check(least_squares.NAME, scipy_reachable(), reachable)

        results.append(_table_note(samples, tables[Real.DOUBLE], reachable, beyond))
        sets = {"circle": circle, "random path": reachable, **beyond}
        contenders: dict[tuple[str, str], Callable[[], float]] = {}
        for where, targets in sets.items():
            for name, (_, program) in ours.items():
                contenders[where, name] = partial(_time, program, targets, PASSES)
            for real, program in tables.items():
                contenders[where, f"{table.NAME}, {real.value}"] = partial(_time, program, targets, PASSES)
            for name, program in peers.items():
                if where not in beyond or name == casadi_c.NEWTON:
                    contenders[where, name] = partial(_time, program, targets, SLOW_PASSES)
        contenders["circle", IPOPT] = timed(lambda: solve(samples.scenario, samples.model), len(circle))
        contenders["circle", least_squares.NAME] = timed(scipy_circle, len(circle))
        contenders["random path", least_squares.NAME] = timed(scipy_reachable, len(reachable))
        seconds = interleave(contenders, repeat)
    for where in sets:
        for name, (real, _) in ours.items():
            by_hand = f"{table.NAME}, {real.value}"
            results.append(_line(name, where, by_hand, seconds[where, name], seconds[where, by_hand], aim=False))
            for peer in (*peers, IPOPT, least_squares.NAME):
                if (where, peer) in seconds:
                    results.append(_line(name, where, peer, seconds[where, name], seconds[where, peer]))
                elif where in beyond and peer in peers:  # our worst case against its ordinary one
                    results.append(_line(name, where, f"{peer}, circle", seconds[where, name], seconds["circle", peer]))
    return results


def _time(program: Program, targets: np.ndarray, passes: int) -> float:
    return program.run(targets, passes)[1]


def _line(name: str, where: str, peer: str, ours: list[float], theirs: list[float], aim: bool = True) -> Line:
    return Line(f"{name}, {where}", ours, peer, theirs, median(theirs) if aim else None)


def _table_note(samples: Samples, program: Program, reachable: np.ndarray, beyond: dict[str, np.ndarray]) -> Note:
    """What the table is off, and which limits it passes."""
    off = max(table.off(samples, program.run(t, 0)[0], t) for t in (samples.command, reachable))
    passed = "; ".join(f"{where}: {table.passed(samples, program.run(t, 0)[0])}" for where, t in beyond.items())
    return Note(f"{table.NAME}: {1e9 * off:.2g} nm off; {table.KEEPS}, and passes, {passed}")


def _check_ours(
    samples: Samples, name: str, real: Real, program: Program, reachable: np.ndarray, beyond: dict[str, np.ndarray]
) -> None:
    """Raises Disagreement unless our answers are right: followed where possible, within every limit elsewhere.

    In float a bisection may turn the other way than the reference's, so there only the limits are checked.
    """
    on_circle, on_path = (program.run(targets, 0)[0] for targets in (samples.command, reachable))
    samples.check_circle(name, on_circle, NEAREST[real])
    samples.check(name, on_path, reachable, NEAREST[real])
    if np.any(on_circle.status) or np.any(on_path.status):
        raise Disagreement(f"{name}: a limit reported for a reachable target")
    for where, targets in beyond.items():
        answers = program.run(targets, 0)[0]
        samples.check_limits(f"{name}, {where}", answers)
        if real is Real.DOUBLE:
            samples.check_same(f"{name}, {where}", answers, samples.reference(targets))
        guarded = np.mean(answers.status & int(ControllerStatus.COMPOSITE) > 0)
        if guarded < GUARDED:
            raise Disagreement(f"{name}, {where}: only {100 * guarded:.0f} % of the targets break a composite limit")
