"""How the player stores the solved drive: as a table or as a piecewise cubic, whichever has fewer bytes (docs/player.md).

Both stay. On the shipped scenarios the cubic takes 4 to 38 times fewer bytes than the table (circle20 in float: 648 instead of 24,000)
for 60 to 110 instructions more a sample; ten seconds of six drives at 1 kHz would be a table of 240 kB. The table has no approximation,
and paths of less than about twenty samples and drives that are noise have no shorter form.

The tolerance is on the followed signal, not on the drive: the model is driven by what the C computes (a closed path for
two laps), and may differ from the command by `length_tolerance` and `ANGLE_TOLERANCE`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from math import ceil, inf, log10

import numpy as np
from pydantic import Field

from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import SolverError
from ctrlgen.core.units import same_dimension
from ctrlgen.devices.limit import ranges
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.player.spline import Spline, fit
from ctrlgen.model.model import Model
from ctrlgen.reporting.result_file import Keys, Number
from ctrlgen.trajectory.inverse.clock import in_time
from ctrlgen.trajectory.playback import ANGLE_TOLERANCE, length_tolerance
from ctrlgen.trajectory.solution import Solution
from ctrlgen.trajectory.unstated_modes import followed_under

TOLERANCE_SHARE = 0.8  # of the tolerances; the rest is left to compilers that fuse a product and a sum
INSTRUCTION_BUDGET = 150  # of one sample, Cortex-M4F
SEARCH_INSTRUCTIONS = 22  # of one sample, to find the piece of a cubic
STEPS_A_DECADE = 6  # of the drive tolerance, in the search for the coarsest
GUESSES = (
    6  # of the next drive tolerance, after which the interval is halved: three to four find it on the shipped scenarios
)
FINEST_STEP = 42  # 10^(-42/6) of a drive's range: below a float's rounding


@dataclass(frozen=True)
class SampleTable:
    """Every sample as solved, `drive` (samples, axes)."""

    drive: np.ndarray

    kind = "table"

    def bytes(self, real: Real) -> int:
        """Bytes of constants in the C."""
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

    def interpolated(self, k: np.ndarray, fraction: np.ndarray, real: Real) -> np.ndarray:
        """(n, axes): the drives at k + fraction, 0 <= fraction < 1, linear to the next sample; the first follows the last."""
        low, high = self.values(real)[k], self.values(real)[(k + 1) % len(self.drive)]
        return low + fraction.astype(low.dtype)[:, None] * (high - low)


Curve = SampleTable | Spline
BETWEEN = 4  # moments a sample at which the rates of a curve are looked at
RATE_ROUNDING = 1e-3  # of the range of a rate: of drives in float over a quarter of a sample


class PlayerCandidate(Keys):
    """One way in which the player's drives could be stored."""

    kind: str = Field(description="Form: table, spline or Fourier series.")
    size: str = Field(description="Its size in words.")
    bytes: int | None = Field(description="Bytes of constant data.")
    operations: int | None = Field(description="Operations of one call.")
    instructions: int | None = Field(description="Instructions of one call, estimated.")
    length: Number = Field(description="Largest position error that it causes [m].")
    angle: Number = Field(description="Largest rotation error that it causes [rad].")
    drive: Number = Field(description="Largest drive error, as a share of the drive's range.")
    chosen: bool = Field(description="Whether it was generated.")
    remark: str = Field(description="Why not, where it was not.")


@dataclass(frozen=True)
class Compression:
    """The chosen `curve` in one arithmetic and all candidates.

    `low`, `high` (axes,): bounds checked at run time, infinite where the curve cannot exceed them.
    """

    real: Real
    curve: Curve
    closed: bool
    low: np.ndarray
    high: np.ndarray
    candidates: tuple[PlayerCandidate, ...]

    @property
    def chosen(self) -> PlayerCandidate:
        """The candidate that became the player."""
        return next(c for c in self.candidates if c.chosen)

    def drives(self, k: np.ndarray, fraction: np.ndarray | None = None) -> np.ndarray:
        """(n, axes): what the C answers at sample k plus `fraction` of a sample time."""
        fraction = np.zeros(len(k)) if fraction is None else fraction
        if not self.closed:
            fraction = np.where(k == _samples(self.curve) - 1, 0.0, fraction)
        values = self.curve.interpolated(k, fraction, self.real)
        return np.clip(values, self.low.astype(values.dtype), self.high.astype(values.dtype)).astype(float)


def compress(solution: Solution) -> dict[Real, Compression]:
    """For each arithmetic the form of fewest bytes within the tolerances and `INSTRUCTION_BUDGET`; else the table."""
    drive, closed = solution.drive, solution.scenario.closed
    low, high = solution.model.u_bounds
    span = np.ptp(drive, axis=0)
    span = np.where(span > 0, span, solution.model.u_scale * 1e-3)

    @cache
    def spline(step: int) -> Spline | None:
        return fit(drive, low, high, span * 10 ** (-step / STEPS_A_DECADE), closed)

    found, step = {}, STEPS_A_DECADE
    for real in Real:  # one arithmetic begins where the other ended
        found[real], step = _compress(solution, real, spline, step)
    return found


def _compress(
    solution: Solution, real: Real, spline: Callable[[int], Spline | None], begin: int
) -> tuple[Compression, int]:
    """The form in one arithmetic, and the step of the drive tolerance at which the search for it ended, begun at another."""
    bounds, allowed = (
        _inward(solution.model, real),
        length_tolerance(solution.model.signals[solution.scenario.file.follow]),
    )
    n, closed = len(solution.drive), solution.scenario.closed

    def measured(curve: Curve) -> PlayerCandidate:
        compression = Compression(real, curve, closed, *_kept(curve, bounds, real), ())
        values = compression.drives(np.arange(n))
        length, angle = _error(solution, values)
        if isinstance(curve, Spline) and not _keeps_rates(solution, compression):
            length = np.inf
        off = float(np.abs(values - solution.drive).max())
        cost = instructions(curve, int(np.isfinite([compression.low, compression.high]).sum()))
        return PlayerCandidate(
            kind=curve.kind,
            size=_size(curve),
            bytes=curve.bytes(real),
            operations=curve.operations,
            instructions=cost,
            length=length,
            angle=angle,
            drive=off,
            chosen=False,
            remark="",
        )

    table = SampleTable(np.clip(solution.drive, *bounds))
    weighed: list[tuple[Curve | None, PlayerCandidate]] = [(table, measured(table))]

    found = _coarsest(spline, measured, lambda c: c.bytes(real) < table.bytes(real), begin, allowed)
    weighed.append(found[1:] if found else (None, _no_curve("cubic", "no shorter than the table within the tolerance")))
    usable = [(curve, c) for curve, c in weighed if curve is not None and _within(c, allowed) and _affordable(c)]
    curve, best = min(usable, key=lambda pair: pair[1].bytes or 0) if usable else weighed[0]
    assert curve is not None
    candidates = []
    for _, c in weighed:
        told = {"chosen": c is best, "remark": c.remark or _remark(c, best, bool(usable), allowed)}
        candidates.append(c.model_copy(update=told))
    return Compression(real, curve, closed, *_kept(curve, bounds, real), tuple(candidates)), found[
        0
    ] if found else begin


def _coarsest(
    spline: Callable[[int], Spline | None],
    measured: Callable[[Curve], PlayerCandidate],
    short: Callable[[Spline], bool],
    begin: int,
    allowed: float,
) -> tuple[int, Spline, PlayerCandidate] | None:
    """The `short` spline of the coarsest drive tolerance that keeps the tolerance of what is followed, `allowed` [m] of its lengths, after
    its step; None where there is none.

    Errors are nearly proportional to the drive tolerance: from the step `begin` on each that was measured tells where the next is tried,
    until one serves and that a step coarser does not.
    """
    too_coarse, too_fine, step, good = STEPS_A_DECADE - 1, FINEST_STEP + 1, begin, None
    for tried in range(FINEST_STEP):
        curve, change = spline(step), 0.0
        if curve is not None and short(curve):
            candidate = measured(curve)
            change = _steps_to_go(candidate, allowed)
            if _within(candidate, allowed):
                good, too_fine = (step, curve, candidate), step
            else:
                too_coarse = step
        elif good is None:
            too_fine = step
        else:
            too_coarse = step
        if too_fine - too_coarse <= 1:
            break
        guess = step + ceil(change) if tried < GUESSES else (too_coarse + too_fine) // 2
        step = min(max(guess, too_coarse + 1), too_fine - 1)
    return good


def _steps_to_go(candidate: PlayerCandidate, allowed: float) -> float:
    """Steps by which the drive tolerance is to be finer, coarser below zero, for an error that just keeps the tolerance; a decade where
    the error tells nothing."""
    shares = (candidate.length or 0.0) / allowed, (candidate.angle or 0.0) / ANGLE_TOLERANCE
    share = max(shares) / TOLERANCE_SHARE
    return STEPS_A_DECADE * log10(share) if 0 < share < inf else STEPS_A_DECADE


def instructions(curve: Curve, limited: int) -> int:
    """Estimated instructions of one sample on a Cortex-M4F in float; `limited`: number of bounds checked at run time.

    Fitted to counts of an emulator for clang -O2 with one to eight drives. A Cortex-M4F has no double in hardware.
    """
    if isinstance(curve, SampleTable):
        return 20 + 2 * curve.drive.shape[1]
    return round(45 + 12.5 * curve.axes + (SEARCH_INSTRUCTIONS if len(curve.pieces) > 1 else 0) + 6 * limited)


def _error(solution: Solution, drives: np.ndarray) -> tuple[float, float]:
    """Largest distance [m] and angle [rad] between command and model driven by `drives`; a closed path is run for two laps."""
    m, scenario, start = solution.model, solution.scenario, solution.trace
    command, role = solution.command, scenario.file.follow
    if scenario.closed:
        drives, wanted = np.vstack([drives, drives]), np.vstack([command, command, command[:1]])
    else:
        wanted = np.vstack([command, command[-1:]])
    try:
        if scenario.file.leads_modes:  # which leaves something: the player is to do as the solution does
            solved = np.vstack([solution.drive, solution.drive]) if scenario.closed else solution.drive
            wanted = followed_under(scenario, m, solved, start.x[0], start.z[0])
        reached = followed_under(scenario, m, drives, start.x[0], start.z[0])
    except SolverError:
        return np.inf, np.inf
    worst = np.abs(reached - wanted).max(axis=0)
    units = m.signals[role].units
    length, angle = (
        max((float(e) for e, u in zip(worst, units, strict=True) if same_dimension(u, unit)), default=0.0)
        for unit in ("m", "rad")
    )
    return length, angle


def _keeps_rates(solution: Solution, compression: Compression) -> bool:
    """Whether the drives, looked at between samples too, change no faster than they may; where those of the solution do not either."""
    m, n, h = solution.model, len(solution.drive), in_time(solution.scenario.clock).sample_time
    if not m.rate_limits:
        return True
    k = np.repeat(np.arange(n), BETWEEN)
    drives = compression.drives(k, np.tile(np.arange(BETWEEN) / BETWEEN, n))
    if solution.scenario.closed:
        drives = np.vstack([drives, drives[:1]])
    change = np.diff(drives, axis=0) / (h / BETWEEN)
    low, high = m.rate_bounds
    rounded = RATE_ROUNDING * ranges((low, high), 0.0)
    return bool(np.all(change >= low - rounded) and np.all(change <= high + rounded))


def _within(c: PlayerCandidate, allowed: float) -> bool:
    return (
        c.length is not None
        and c.angle is not None
        and c.length <= TOLERANCE_SHARE * allowed
        and c.angle <= TOLERANCE_SHARE * ANGLE_TOLERANCE
    )


def _affordable(c: PlayerCandidate) -> bool:
    return c.instructions is not None and c.instructions <= INSTRUCTION_BUDGET


def _remark(c: PlayerCandidate, best: PlayerCandidate, usable: bool, allowed: float) -> str:
    """Why this candidate was chosen, or why not."""
    if c is best:
        return "fewest bytes" if usable else "as solved; nothing is within the tolerance"
    if not _within(c, allowed):
        return "not within the tolerance"
    return f"more bytes than the {best.kind}" if _affordable(c) else f"more than {INSTRUCTION_BUDGET} instructions"


def _no_curve(kind: str, remark: str) -> PlayerCandidate:
    numbers = dict.fromkeys(("bytes", "operations", "instructions", "length", "angle", "drive"))
    return PlayerCandidate(kind=kind, size="", **numbers, chosen=False, remark=remark)


def _size(curve: Curve) -> str:
    if isinstance(curve, SampleTable):
        return number_of(len(curve.drive), "row")
    count = sum(p.segments for p in curve.pieces)
    return number_of(count, "segment") + (f" in {len(curve.pieces)} pieces" if len(curve.pieces) > 1 else "")


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
    """The bounds to check at run time: those that the curve's extremes, with eight roundings, may exceed; else infinite."""
    low, high = curve.extremes()
    slack = 8 * float(np.finfo(np.float32 if real is Real.FLOAT else np.float64).eps) * np.maximum(abs(low), abs(high))
    if isinstance(curve, SampleTable):
        slack = 0 * slack
    positive = (bounds[0] == 0) & (low >= 0) & isinstance(curve, Spline)  # a sum of products of none below zero
    keep_low, keep_high = (low - slack < bounds[0]) & ~positive, high + slack > bounds[1]
    return np.where(keep_low, bounds[0], -np.inf), np.where(keep_high, bounds[1], np.inf)
