"""The generated online C per call, in double and in float, against solvers of the same sample."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from benchmarks import casadi_c, least_squares
from benchmarks.measure import Line, Note, interleave, timed
from benchmarks.samples import NEAR, NEAR_FLOAT, Disagreement, Samples
from benchmarks.timed_c import Program, build, generated
from ctrlgen.controller import Status
from ctrlgen.cprint import Real
from ctrlgen.generate import generate
from ctrlgen.solve import solve

PASSES = 200  # over all targets of a set, in each round; the median counts
SLOW_PASSES = 20  # for peers that take microseconds
IPOPT = "IPOPT, whole circle"
NEAREST = {Real.DOUBLE: NEAR, Real.FLOAT: NEAR_FLOAT}


def run(repeat: int) -> list[Line | Note]:
    """Three sets of targets: the circle, random reachable ones, and ones that break limits."""
    samples = Samples()
    results: list[Line | Note] = []
    with tempfile.TemporaryDirectory(prefix="ctrlgen-bench-") as scratch:
        folder = Path(scratch)
        c = generate(samples.scenario, samples.model, folder, samples.solution)
        ours = {
            f"online C {real.value}": (real, build(name, generated(name, real.value), folder / f"{name}.c", samples.axes))
            for real, name in c.online.items()
        }
        peers: dict[str, Program] = {}
        for title, function in ((casadi_c.NEWTON, casadi_c.newton), (casadi_c.SQP, casadi_c.sqp)):
            try:
                peers[title] = casadi_c.build_peer(title, function(samples), samples, folder)
            except (RuntimeError, Disagreement) as error:  # CasADi cannot write it, or gcc cannot build it
                results.append(Note(f"{title}: not available: {str(error).splitlines()[0]}"))

        circle, reachable, beyond = samples.command, samples.reachable(), samples.beyond()
        for name, (real, program) in ours.items():
            _check_ours(samples, name, program, NEAREST[real], circle, reachable, beyond)
        scipy_circle, scipy_reachable = (least_squares.solver(samples, targets) for targets in (circle, reachable))
        for name, answer in ((p, lambda t, p=peers[p]: p.run(t, 0)[0]) for p in peers):
            samples.check_circle(name, answer(circle))
            samples.check(name, answer(reachable), reachable)
        samples.check_circle(least_squares.NAME, scipy_circle())
        samples.check(least_squares.NAME, scipy_reachable(), reachable)

        sets = {"circle": circle, "random reachable": reachable, "beyond limits": beyond}
        contenders = {}
        for where, targets in sets.items():
            for name, (_, program) in ours.items():
                contenders[where, name] = lambda p=program, t=targets: p.run(t, PASSES)[1]
            for name, program in peers.items():
                if where != "beyond limits":
                    contenders[where, name] = lambda p=program, t=targets: p.run(t, SLOW_PASSES)[1]
        contenders["circle", IPOPT] = timed(lambda: solve(samples.scenario, samples.model), len(circle))
        contenders["circle", least_squares.NAME] = timed(scipy_circle, len(circle))
        contenders["random reachable", least_squares.NAME] = timed(scipy_reachable, len(reachable))
        seconds = interleave(contenders, repeat)
    for where in sets:
        # Beyond the limits the peers answer another question, so our worst case meets their ordinary one.
        other = "circle" if where == "beyond limits" else where
        for name in ours:
            for against, peer in ((n, s) for (w, n), s in seconds.items() if w == other and n not in ours):
                shown = f"{against}, circle" if where != other and against != IPOPT else against
                results.append(Line(f"{name}, {where}", seconds[where, name], shown, peer, float(np.median(peer))))
    return results


def _check_ours(
    samples: Samples, name: str, program: Program, near: float, circle: np.ndarray, reachable: np.ndarray, beyond: np.ndarray
) -> None:
    """Raises Disagreement unless our answers are right: followed where possible, the reference's beyond limits."""
    answers = program.run(circle, 0)[0]
    samples.check_circle(name, answers, near)
    if np.any(answers.status):
        raise Disagreement(f"{name}: a status other than 0 on the circle")
    answers = program.run(reachable, 0)[0]
    samples.check(name, answers, reachable, near)
    if np.any(answers.status & ~int(Status.DRIVE)):  # a random jump in one sample may take more power than there is
        raise Disagreement(f"{name}: a limit reported for a reachable target")
    samples.check_same(name, program.run(beyond, 0)[0], samples.reference(beyond), near)
