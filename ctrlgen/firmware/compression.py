"""How the player holds the solved drive: a table, a piecewise cubic or a Fourier series, whichever is shortest.

What counts is not the drive but what follows from it: the compressed drive, computed as the C computes it, is sent
through the model (a closed path twice around), and what is followed may be off its command by `LENGTH` and `ANGLE`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from ctrlgen.core.errors import SolverError
from ctrlgen.core.units import same_dimension
from ctrlgen.firmware.cprint import Real
from ctrlgen.firmware.fourier import FEWEST, Fourier, series
from ctrlgen.firmware.spline import Spline, fit
from ctrlgen.model.model import Model
from ctrlgen.model.simulation import simulate
from ctrlgen.trajectory.solution import Solution

LENGTH, ANGLE = 1e-10, 1e-8  # m, rad: what a compressed drive may move what is followed
SHARE = 0.8  # of that; the rest is left to compilers that fuse a product and a sum
BUDGET = 150  # instructions of one sample, Cortex-M4F
SEARCH = 22  # of them to find the piece of a cubic
STEPS = 6  # drive tolerances tried, a decade
FINEST = 42  # 10^(-42/6) of a drive's range: below a float's rounding


@dataclass(frozen=True)
class SampleTable:
    """Every sample as solved, `drive` (samples, axes)."""

    drive: np.ndarray

    kind = "table"

    def bytes(self, real: Real) -> int:
        """Constants of the C."""
        return self.drive.size * real.bytes

    @property
    def operations(self) -> int:
        """Arithmetic operations of one sample: none."""
        return 0

    def extremes(self) -> tuple[np.ndarray, np.ndarray]:
        """(axes,) lowest and highest drive."""
        return self.drive.min(axis=0), self.drive.max(axis=0)

    def values(self, real: Real) -> np.ndarray:
        """(samples, axes): the drives in the arithmetic of the C."""
        return self.drive.astype(np.float32 if real is Real.FLOAT else np.float64)

    def between(self, k: np.ndarray, part: np.ndarray, real: Real) -> np.ndarray:
        """The same at k + part, 0 <= part < 1: the straight line to the next sample, or from the last to the first."""
        low, high = self.values(real)[k], self.values(real)[(k + 1) % len(self.drive)]
        return low + part.astype(low.dtype)[:, None] * (high - low)


Curve = SampleTable | Spline | Fourier


@dataclass(frozen=True)
class Candidate:
    """One way to hold the drive. `length` [m], `angle` [rad]: how far the model driven so is off the command.

    `drive`: how far the drive is off the solved one.
    `instructions` of one sample, Cortex-M4F, are estimated. `remark` says why it was chosen, or why not. Numbers are None
    where there is no such curve.
    """

    kind: str
    size: str
    bytes: int | None
    operations: int | None
    instructions: int | None
    length: float | None
    angle: float | None
    drive: float | None
    chosen: bool
    remark: str


@dataclass(frozen=True)
class Compression:
    """The chosen `curve` in one arithmetic, the bounds (axes,) it keeps, infinite where it cannot pass them, and all candidates."""

    real: Real
    curve: Curve
    closed: bool
    low: np.ndarray
    high: np.ndarray
    candidates: tuple[Candidate, ...]

    @property
    def chosen(self) -> Candidate:
        """The candidate that became the player."""
        return next(c for c in self.candidates if c.chosen)

    def drives(self, k: np.ndarray, part: np.ndarray | None = None) -> np.ndarray:
        """(n, axes): what the C answers at sample k, or `part` of the way to the next one."""
        part = np.zeros(len(k)) if part is None else part
        if not self.closed:
            part = np.where(k == _samples(self.curve) - 1, 0.0, part)
        values = self.curve.between(k, part, self.real)
        return np.clip(values, self.low.astype(values.dtype), self.high.astype(values.dtype)).astype(float)


def compress(solution: Solution) -> dict[Real, Compression]:
    """For each arithmetic the representation of fewest bytes within tolerance and `BUDGET`; the table where there is none."""
    drive, closed = solution.drive, solution.scenario.closed
    low, high = solution.model.u_bounds
    span = np.ptp(drive, axis=0)
    span = np.where(span > 0, span, solution.model.u_scale * 1e-3)

    @cache
    def spline(step: int) -> Spline | None:
        return fit(drive, low, high, span * 10 ** (-step / STEPS), closed)

    @cache
    def harmonics(count: int) -> Fourier:
        return series(drive, count)

    return {real: _compress(solution, real, spline, harmonics) for real in Real}


def _compress(
    solution: Solution, real: Real, spline: Callable[[int], Spline | None], harmonics: Callable[[int], Fourier]
) -> Compression:
    bounds = _inward(solution.model, real)
    n, closed = len(solution.drive), solution.scenario.closed

    def measured(curve: Curve) -> Candidate:
        compression = Compression(real, curve, closed, *_kept(curve, bounds, real), ())
        values = compression.drives(np.arange(n))
        length, angle = _error(solution, values)
        off = float(np.abs(values - solution.drive).max())
        cost = instructions(curve, int(np.isfinite([compression.low, compression.high]).sum()))
        return Candidate(
            curve.kind, _size(curve), curve.bytes(real), curve.operations, cost, length, angle, off, False, ""
        )

    table = SampleTable(np.clip(solution.drive, *bounds))
    found: list[tuple[Curve | None, Candidate]] = [(table, measured(table))]

    def search(
        kind: str, make: Callable[[int], Curve | None], first: int, last: int, further: Callable[[int], int]
    ) -> None:
        """Appends the coarsest curve within tolerance, or why there is none."""
        bad, at, good, reached = first - 1, first, None, None
        while good is None and at <= last:
            curve = make(at)
            if curve is None or curve.bytes(real) >= table.bytes(real):
                break
            reached = measured(curve)
            if _within(reached):
                good = at, curve, reached
            else:
                bad, at = at, min(further(at), last) if at < last else last + 1
        while good is not None and good[0] - bad > 1:
            middle = (bad + good[0]) // 2
            curve = make(middle)
            trial = None if curve is None else measured(curve)
            if curve is not None and trial is not None and _within(trial):
                good = middle, curve, trial
            else:
                bad = middle
        if good is None:
            found.append((None, _none(kind, "no shorter than the table within the tolerance")))
        else:
            found.append(good[1:])

    search("cubic", spline, STEPS, FINEST, lambda step: step + STEPS)
    if not closed:
        found.append((None, _none("Fourier", "the path is not closed")))
    elif n < FEWEST:
        found.append((None, _none("Fourier", f"fewer than {FEWEST} samples")))
    else:
        search("Fourier", harmonics, 1, (n - 1) // 2, lambda count: 2 * count)
    usable = [(curve, c) for curve, c in found if curve is not None and _within(c) and _affordable(c)]
    curve, best = min(usable, key=lambda pair: pair[1].bytes or 0) if usable else found[0]
    assert curve is not None
    candidates = tuple(
        replace(c, chosen=c is best, remark=c.remark or _remark(c, best, bool(usable))) for _, c in found
    )
    return Compression(real, curve, closed, *_kept(curve, bounds, real), candidates)


def instructions(curve: Curve, limited: int) -> int:
    """Estimated instructions of one sample on a Cortex-M4F in float, where `limited` bounds of drives are kept at run time.

    Fitted to the counts of an emulator for clang -O2, one to eight drives. Double takes a library there, or a Cortex-M7.
    """
    if isinstance(curve, SampleTable):
        return 20 + 2 * curve.drive.shape[1]
    if isinstance(curve, Spline):
        return round(45 + 12.5 * curve.axes + (SEARCH if len(curve.pieces) > 1 else 0) + 6 * limited)
    return round(27 + 3 * curve.axes + (7 + 5.25 * curve.axes) * curve.harmonics + 6 * limited)


def _error(solution: Solution, drives: np.ndarray) -> tuple[float, float]:
    """Worst distance [m] and angle [rad] between command and model driven by `drives`; a closed path is run twice."""
    m, scenario, start = solution.model, solution.scenario, solution.trace
    command, role = solution.command, scenario.file.follow
    if scenario.closed:
        drives, wanted = np.vstack([drives, drives]), np.vstack([command, command, command[:1]])
    else:
        wanted = np.vstack([command, command[-1:]])
    try:
        reached = simulate(m, drives, scenario.sample_time or 1.0, start.x[0], start.z[0]).signals[role]
    except SolverError:
        return np.inf, np.inf
    worst = np.abs(reached - wanted).max(axis=0)
    units = m.signals[role].units
    length, angle = (
        max((float(e) for e, u in zip(worst, units, strict=True) if same_dimension(u, unit)), default=0.0)
        for unit in ("m", "rad")
    )
    return length, angle


def _within(c: Candidate) -> bool:
    return c.length is not None and c.angle is not None and c.length <= SHARE * LENGTH and c.angle <= SHARE * ANGLE


def _affordable(c: Candidate) -> bool:
    return c.instructions is not None and c.instructions <= BUDGET


def _remark(c: Candidate, best: Candidate, usable: bool) -> str:
    """Why this candidate was chosen, or why not."""
    if c is best:
        return "fewest bytes" if usable else "as solved; nothing is within the tolerance"
    if not _within(c):
        return "not within the tolerance"
    return f"more bytes than the {best.kind}" if _affordable(c) else f"more than {BUDGET} instructions"


def _none(kind: str, remark: str) -> Candidate:
    return Candidate(kind, "", None, None, None, None, None, None, False, remark)


def _size(curve: Curve) -> str:
    if isinstance(curve, SampleTable):
        return f"{len(curve.drive)} rows"
    if isinstance(curve, Fourier):
        return f"{curve.harmonics} harmonic{'s' * (curve.harmonics > 1)}"
    count = sum(p.segments for p in curve.pieces)
    return f"{count} segments" + (f" in {len(curve.pieces)} pieces" if len(curve.pieces) > 1 else "")


def _samples(curve: Curve) -> int:
    return len(curve.drive) if isinstance(curve, SampleTable) else curve.samples


def _inward(model: Model, real: Real) -> tuple[np.ndarray, np.ndarray]:
    """The drives' bounds as numbers of the arithmetic, none rounded outward."""
    low, high = model.u_bounds
    if real is Real.DOUBLE:
        return low, high
    with np.errstate(over="ignore"):
        below, above = low.astype(np.float32), high.astype(np.float32)
    below = np.where(below < low, np.nextafter(below, np.float32(np.inf)), below)
    above = np.where(above > high, np.nextafter(above, np.float32(-np.inf)), above)
    return below.astype(float), above.astype(float)


def _kept(curve: Curve, bounds: tuple[np.ndarray, np.ndarray], real: Real) -> tuple[np.ndarray, np.ndarray]:
    """The bounds that must be kept at run time: those that the curve's own extremes, with eight roundings, may pass; else infinite."""
    low, high = curve.extremes()
    slack = 8 * float(np.finfo(np.float32 if real is Real.FLOAT else np.float64).eps) * np.maximum(abs(low), abs(high))
    if isinstance(curve, SampleTable):
        slack = 0 * slack
    positive = (bounds[0] == 0) & (low >= 0) & isinstance(curve, Spline)  # a sum of products of none below zero
    keep_low, keep_high = (low - slack < bounds[0]) & ~positive, high + slack > bounds[1]
    return np.where(keep_low, bounds[0], -np.inf), np.where(keep_high, bounds[1], np.inf)
