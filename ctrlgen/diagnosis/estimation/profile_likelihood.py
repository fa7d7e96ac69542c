"""Step 11: how sure the numbers of the findings are.

Profile: the objective with one number held at distance t and all others fitted again; in a well-behaved problem it rises
by (t/sd)^2. The 95 % interval ends where it has risen by 1.96^2; where it never does, the data do not bound the number.
Where the residual is not as white as the noise model says, the interval is widened as the sandwich of `scatter` is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ctrlgen.core.units import from_si
from ctrlgen.diagnosis.estimation.fit import Fit, Fitter, _Problem
from ctrlgen.diagnosis.estimation.robust_covariance import sandwich_over_model
from ctrlgen.diagnosis.hypotheses.hypotheses import PARAMETER
from ctrlgen.diagnosis.settings import PROFILE, ROBUST_COVARIANCE, STATISTICS

BOUNDED, ABOVE, BELOW, FLAT = (
    "bounded", "not bounded above by these data", "not bounded below by these data", "not bounded by these data",
)  # fmt: skip


@dataclass(frozen=True)
class Profile:
    """One number of one finding, at `path` in the corrected device, in `unit`: `ci95` the larger of profile and sandwich;
    `points` (value, rise of the objective); `shape` says whether both sides are bounded; `verified` whether the profile was
    looked at or only its curvature; the sandwich's deviation over the model's, None where there are too few samples for it.
    """

    path: str
    effect: str
    location: str
    parameter: str
    value: float
    ci95: tuple[float, float]
    unit: str
    points: tuple[tuple[float, float], ...]
    shape: str
    verified: bool
    sandwich_over_model: float | None


def profiles(fitter: Fitter, fit: Fit) -> tuple[Profile, ...]:
    """Of every number of every cause, in the order of the unknowns."""
    if all(u.cause is None for u in fit.structure.free_parameters):
        return ()
    surface = _Surface(fitter, fit)
    ratio = sandwich_over_model(fit)
    return tuple(
        _profile(surface, fit, i, ratio) for i, u in enumerate(fit.structure.free_parameters) if u.cause is not None
    )


def _profile(surface: _Surface, fit: Fit, i: int, ratio: np.ndarray | None) -> Profile:
    unknown = fit.structure.free_parameters[i]
    cause = fit.structure.cause_of(unknown)
    value, sd = float(fit.theta[i]), float(np.sqrt(max(fit.covariance[i, i], 0.0)))
    low, high = (_Side(surface, i, value, sd, bound) for bound in (unknown.low, unknown.high))
    wider = 1.0 if ratio is None or ratio[i] < ROBUST_COVARIANCE.agreement else float(ratio[i])
    ends = [max(value + wider * (low.end - value), unknown.low), min(value + wider * (high.end - value), unknown.high)]
    points = sorted([*low.points, (value, 0.0), *high.points])
    shape = {(True, True): BOUNDED, (True, False): ABOVE, (False, True): BELOW, (False, False): FLAT}
    name = (cause.path if cause.effect == PARAMETER else unknown.path).rpartition(".")[2]
    shown = [float(from_si(x, unknown.unit)) for x in (value, *ends)]
    return Profile(
        unknown.path, cause.effect, cause.location, name, shown[0], (shown[1], shown[2]), unknown.unit,
        tuple((float(from_si(x, unknown.unit)), float(rise)) for x, rise in points), shape[low.bounded, high.bounded],
        low.verified and high.verified, None if ratio is None else float(ratio[i]),
    )  # fmt: skip


class _Side:
    """One side of a profile: `points` (value, rise), the `end` of the interval, whether the data bound it."""

    def __init__(self, surface: _Surface, i: int, value: float, sd: float, bound: float) -> None:
        side = np.sign(bound - value) or 1.0
        room = abs(bound - value)
        self.points: list[tuple[float, float]] = []
        self.verified, self.bounded = False, STATISTICS.z_95 * sd <= room
        self.end = value + side * min(STATISTICS.z_95 * sd, room)
        t, before = PROFILE.first_distance * sd, (0.0, 0.0)
        for _ in range(PROFILE.doublings + 1):
            if not surface.affords() or room == 0:
                return
            reach = min(t, room)
            rise = surface.rise(i, value + side * reach, (reach / sd) ** 2 if sd else np.inf)
            self.points.append((float(value + side * reach), rise))
            self.verified, root = True, np.sqrt(max(rise, 0.0))
            self.bounded = root >= STATISTICS.z_95
            if self.bounded:
                self.end = value + side * self._between(surface, i, value, side, before, (reach, root))
                return
            self.end, before = float(value + side * reach), (reach, root)
            if reach == room:
                return
            t *= 2.0

    def _between(
        self,
        surface: _Surface,
        i: int,
        value: float,
        side: float,
        near: tuple[float, float],
        far: tuple[float, float],
    ) -> float:
        """The distance at which the root of the rise is CI, by the secant; looked at again while it was far overshot."""
        for _ in range(PROFILE.most_secants):
            reach = float(near[0] + (STATISTICS.z_95 - near[1]) / (far[1] - near[1]) * (far[0] - near[0]))
            if far[1] < PROFILE.overshoot * STATISTICS.z_95 or not surface.affords():
                return reach
            rise = surface.rise(i, value + side * reach, STATISTICS.z_95**2)
            self.points.append((float(value + side * reach), rise))
            near, far = (
                ((reach, np.sqrt(max(rise, 0.0))), far) if rise < STATISTICS.z_95**2 else (near, (reach, np.sqrt(rise)))
            )
        return far[0]


class _Surface:
    """The objective around an optimum."""

    def __init__(self, fitter: Fitter, fit: Fit) -> None:
        self.problem = _Problem(fitter, fit.structure)
        self.values = np.concatenate([fit.theta, *fit.initial_states])
        self.at = self.problem.inner(self.values)
        self.low, self.high = self.problem.bounds
        J = fit.J * self.problem.by_inner(self.values)
        self.H, self.best = J.T @ J, fit.objective
        states = max(len(s) for s in self.problem.sizes) + fit.J.shape[1]
        affordable = max(int(PROFILE.cost / (fit.n * states * fit.J.shape[1])), PROFILE.fewest_points)
        self.left = affordable if fit.chi2 < PROFILE.largest_ratio * fit.n else 0

    def affords(self) -> bool:
        """Whether another point may be looked at."""
        return self.left > 0

    def rise(self, i: int, value: float, expected: float) -> float:
        """The objective above its optimum with number `i` at `value` [SI] and the others where the curvature puts them,
        fitted once more where that is far above `expected`."""
        rest = np.arange(len(self.at)) != i
        x = self.at.copy()
        moved = self.values.copy()
        moved[i] = value
        x[i] = self.problem.inner(moved)[i]
        x[rest] -= np.linalg.lstsq(self.H[np.ix_(rest, rest)], self.H[rest, i] * (x[i] - self.at[i]), rcond=1e-12)[0]
        x[rest] = np.clip(x, self.low, self.high)[rest]
        rise = self._objective(x) - self.best
        if rise > PROFILE.refit_ratio * expected and self.affords():
            r, J = self.problem.evaluate(x)
            J = J[:, rest]
            x[rest] = np.clip(x[rest] - np.linalg.lstsq(J, r, rcond=1e-10)[0], self.low[rest], self.high[rest])
            rise = min(rise, self._objective(x) - self.best)
        return float(rise)

    def _objective(self, x: np.ndarray) -> float:
        self.left -= 1
        r, _ = self.problem.evaluate(x)
        return float(r @ r)
