"""Time-optimal path following by one nonlinear programme over the path's speed, solved by IPOPT.

The path is cut at fixed shares s_i. Unknown are the derivatives w_i = (s', ..., s^(m)) there, the time h_i of each interval and the
(m+1)th derivative c_i, constant in it:

    minimise    sum_i h_i + small sum_i (change of c)^2
    subject to  s_i+1 and w_i+1 by Taylor's formula from w_i, c_i, h_i
                every limit at every s_i
                every bound of the rate of a drive, times h_i, on u_i+1 - u_i

m is the number of derivatives that the drive follows, so that the drive is continuous. In time the programme is regular where the
path rests, at which formulations in s'^2 are not. It is solved for few intervals first, with the weight of the last term large,
then for more and a smaller weight, each begun at the one before (continuation). Every place is a constant of the programme, so that
nothing is interpolated.

Sources: D. Verscheure, B. Demeulenaere, J. Swevers, J. De Schutter, M. Diehl, IEEE Trans. Autom. Control 54 (2009) 2318 (the problem
over the path's speed); J. T. Betts, Practical Methods for Optimal Control, 2nd ed. (2010), chapter 4 (transcription, refinement);
A. Waechter, L. T. Biegler, Math. Program. 106 (2006) 25 (IPOPT).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import factorial

import casadi as ca
import numpy as np

from ctrlgen.core.errors import SolverError
from ctrlgen.devices.limit import ranges
from ctrlgen.numerics.ipopt import IpoptOptions, NonlinearProgramme, solve_nlp
from ctrlgen.path_timing.drive_law import Law
from ctrlgen.path_timing.timing_law import TimingLaw

INTERVALS = ((32, 1e-4), (128, 1e-6), (512, 1e-8))  # of the path, and the weight of the smoothing term in each pass
OPTIONS = IpoptOptions(tol=1e-8, max_iter=400, mu_strategy="adaptive", bound_relax_factor=0.0)
SHORTEST = 1e-6  # of the mean time of an interval


@dataclass(frozen=True)
class RateBound:
    """The lowest and highest rate [SI/s] of each drive (n_u,); infinite where there is none."""

    low: np.ndarray
    high: np.ndarray


class SpeedProgramme:
    """The programme of a smooth piece of a path. `places` (shares) -> (n, place_size) what the law needs there; `closed`: periodic,
    otherwise from rest to
    rest; `distances` (place, speed) -> how far each limit is from its bound, and the drives."""

    def __init__(
        self,
        law: Law,
        places: Callable[[np.ndarray], np.ndarray],
        ends: tuple[float, float],
        closed: bool,
        distances: ca.Function,
        rates: RateBound,
    ) -> None:
        self.law, self.places, self.ends, self.closed, self.rates = law, places, ends, closed, rates
        self.distances = distances

    def fastest(self, begin: TimingLaw, progress: Callable[[str], None] = lambda _: None) -> TimingLaw:
        """The fastest law, begun at one that keeps the limits. Raises SolverError where IPOPT finds none."""
        law = begin
        for intervals, weight in INTERVALS:
            progress(f"IPOPT, {intervals} intervals of the path")
            law = self._solved(law, self._shares(intervals), weight)
        return law

    def _shares(self, intervals: int) -> np.ndarray:
        """The shares (intervals + 1,) at which the path is cut: evenly, or closer together toward points of rest."""
        even = np.linspace(0, 1, intervals + 1)
        inner = even if self.closed else (1 - np.cos(np.pi * even)) / 2
        return self.ends[0] + (self.ends[1] - self.ends[0]) * inner

    def _solved(self, begin: TimingLaw, share: np.ndarray, weight: float) -> TimingLaw:
        n, m, T = len(share) - 1, self.law.order, begin.duration
        W, C, H = ca.MX.sym("w", m, n + 1), ca.MX.sym("c", 1, n), ca.MX.sym("h", 1, n)
        size = share[-1] - share[0]
        unit = np.array([size / T ** (k + 1) for k in range(m)])  # of each derivative; time in units of T/n
        step = T / n
        derivatives = ca.vertcat(W, ca.horzcat(C, ca.MX(1, 1)))
        rows, low, high = [], [], []

        def row(value: ca.MX, least: np.ndarray | float, most: np.ndarray | float) -> None:
            rows.append(ca.vec(value))
            low.append(np.broadcast_to(least, value.numel()).ravel())
            high.append(np.broadcast_to(most, value.numel()).ravel())

        for k in range(m + 1):  # s itself, then its derivatives; in units of T: s^(k) T^k/size
            terms = [derivatives[j - 1, :-1] * (H / n) ** (j - k) / factorial(j - k) for j in range(k + 1, m + 2)]
            moved = sum(terms[1:], terms[0])
            if k == 0:
                row(moved / (np.diff(share)[None] / size), 1.0, 1.0)
            else:
                row(W[k - 1, 1:] - W[k - 1, :-1] - moved, 0.0, 0.0)
        distances, u = self.distances.map(n + 1)(self.places(share).T, W * unit[:, None])
        row(distances, 0.0, np.inf)
        span = ranges(self.law.model.u_bounds, self.law.model.u_scale)
        for i in range(u.size1()):
            for bound, is_high in ((self.rates.low[i], False), (self.rates.high[i], True)):
                if np.isfinite(bound):
                    value = (u[i, 1:] - u[i, :-1] - bound * step * H) / span[i]
                    row(value, *((-np.inf, 0.0) if is_high else (0.0, np.inf)))
        if self.closed:
            row(W[:, -1] - W[:, 0], 0.0, 0.0)
        bend = ca.horzcat(C[1:] - C[:-1], C[0] - C[-1]) if self.closed else C[1:] - C[:-1]
        cost = ca.sum2(H) / n + weight * ca.sumsqr(bend) / n
        w_low, w_high = np.full((m, n + 1), -np.inf), np.full((m, n + 1), np.inf)
        w_low[0] = 0.0  # forward
        if not self.closed:
            w_low[:, [0, -1]] = w_high[:, [0, -1]] = 0.0
        start = self._start(begin, share, unit, T, size, n)
        free = np.full(n, np.inf)
        least = np.concatenate([w_low.ravel("F"), -free, np.full(n, SHORTEST)])
        most = np.concatenate([w_high.ravel("F"), free, free])
        row_bounds = np.concatenate(low), np.concatenate(high)
        programme = NonlinearProgramme(ca.veccat(W, C, H), cost, ca.vertcat(*rows), row_bounds, (least, most))
        solution = solve_nlp(programme, start, OPTIONS)
        if not solution.converged:
            raise SolverError(
                f"IPOPT found no fastest speed along the path ({solution.status} after {solution.iterations} iterations); "
                "make the path smoother or smaller"
            )
        values = solution.unknowns
        w = values[: m * (n + 1)].reshape(m, n + 1, order="F")
        time = np.concatenate([[0.0], np.cumsum(values[-n:]) * step])
        return TimingLaw(time, share, (w * unit[:, None]).T)

    def _start(
        self, begin: TimingLaw, share: np.ndarray, unit: np.ndarray, T: float, size: float, n: int
    ) -> np.ndarray:
        time = begin.when(share)
        time[0], time[-1] = begin.time[0], begin.time[-1]
        m = self.law.order
        w = np.stack([begin.at(time, k + 1) for k in range(m)]) / unit[:, None]
        if not self.closed:
            w[:, [0, -1]] = 0.0
        h = np.maximum(np.diff(time), 1e-3 * T / n)
        c = np.diff(w[-1]) / (h / T)
        return np.concatenate([w.ravel("F"), c, h * n / T])
