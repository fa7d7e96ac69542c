"""The whole circle: IPOPT over all samples at once, against scipy sample by sample."""

from __future__ import annotations

from time import perf_counter
from typing import Any
from unittest.mock import patch

import casadi as ca
import numpy as np

from benchmarks import least_squares
from benchmarks.measure import Line, Note, interleave, timed
from benchmarks.samples import Answers, Samples
from ctrlgen.budget.robust import solve


class _Stopwatch:
    """A CasADi solver that notes how long its calls take."""

    def __init__(self, solver: ca.Function, calls: list[float]) -> None:
        self.solver, self.calls = solver, calls

    def __call__(self, **arguments: Any) -> Any:
        start = perf_counter()
        answer = self.solver(**arguments)
        self.calls.append(perf_counter() - start)
        return answer

    def stats(self) -> Any:
        return self.solver.stats()


def run(repeat: int) -> list[Line | Note]:
    """Seconds per sample; `solve` whole, and IPOPT's share of it."""
    samples = Samples()
    n = len(samples.command)
    trace, drive = samples.solution.trace, samples.solution.drive
    ours = Answers(trace.z, trace.x, np.roll(drive, 1, axis=0), np.zeros(n, dtype=int))
    samples.check_circle("IPOPT", ours)
    scipy_solve = least_squares.solver(samples, samples.command)
    samples.check_circle(least_squares.NAME, scipy_solve())
    inside: list[float] = []

    def solve_once() -> None:
        calls: list[float] = []
        nlpsol = ca.nlpsol
        with patch("casadi.nlpsol", lambda *a: _Stopwatch(nlpsol(*a), calls)):
            solve(samples.scenario, samples.model)
        inside.append(sum(calls) / n)

    seconds = interleave({"ours": timed(solve_once, n), "scipy": timed(scipy_solve, n)}, repeat)
    building = [whole - proper for whole, proper in zip(seconds["ours"], inside, strict=True)]
    parts = {"circle, ctrlgen solve": seconds["ours"], "  IPOPT proper": inside, "  building, reading out": building}
    return [Line(f"{what}, per point", times, least_squares.NAME, seconds["scipy"]) for what, times in parts.items()]
