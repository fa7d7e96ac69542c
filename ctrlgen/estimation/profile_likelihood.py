"""Step 11: confidence intervals of the causes' parameters by profile likelihood.

The profile of a parameter is the objective with the parameter held at a distance t from its optimum and all others fitted
again. Where the problem is close to linear it rises by (t/sd)^2. The 95 % interval ends where it has risen by 1.96^2; where
it never does, the data do not bound the parameter. Where the residual is not as white as the noise model says, the interval
is widened as in `robust_covariance`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from ctrlgen.core.units import from_si
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.hypothesis import PARAMETER
from ctrlgen.estimation.least_squares import LeastSquaresProblem
from ctrlgen.estimation.robust_covariance import sandwich_over_model, widening
from ctrlgen.estimation.settings import PROFILE, STATISTICS
from ctrlgen.numerics.levenberg_marquardt import levenberg_marquardt

BOUNDED, ABOVE, BELOW, FLAT = (
    "bounded",
    "not bounded above by these data",
    "not bounded below by these data",
    "not bounded by these data",
)


@dataclass(frozen=True)
class Profile:
    """The profile of one parameter of one finding, at `path` in the corrected device, its numbers in `unit`.

    `ci95`: the 95 % interval, widened by the sandwich. `points`: (value, rise of the objective). `shape`: which sides the
    data bound. `verified`: whether the profile was evaluated on both sides; else the interval is that of the curvature.
    `sandwich_over_model`: ratio of the standard deviations, None where there are too few samples for it.
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
    """The profile of every parameter of every cause, in the order of the structure's free parameters."""
    parameters = fit.structure.free_parameters
    if all(p.cause is None for p in parameters):
        return ()
    objective = _Objective(fitter, fit)
    ratio, wider = sandwich_over_model(fit), widening(fit)
    return tuple(
        _profile(objective, fit, i, float(wider[i]), None if ratio is None else float(ratio[i]))
        for i, p in enumerate(parameters)
        if p.cause is not None
    )


def _profile(objective: _Objective, fit: Fit, i: int, wider: float, ratio: float | None) -> Profile:
    p = fit.structure.free_parameters[i]
    cause = fit.structure.cause_of(p)
    value, sd = float(fit.theta[i]), float(np.sqrt(max(fit.covariance[i, i], 0.0)))
    low, high = (_Side(objective, i, value, sd, bound) for bound in (p.low, p.high))
    ends = max(value + wider * (low.end - value), p.low), min(value + wider * (high.end - value), p.high)
    shape = {(True, True): BOUNDED, (True, False): ABOVE, (False, True): BELOW, (False, False): FLAT}

    def shown(si: float) -> float:
        return float(from_si(si, p.unit))

    return Profile(
        path=p.path,
        effect=cause.effect,
        location=cause.location,
        parameter=(cause.path if cause.effect == PARAMETER else p.path).rpartition(".")[2],
        value=shown(value),
        ci95=(shown(ends[0]), shown(ends[1])),
        unit=p.unit,
        points=tuple((shown(x), float(rise)) for x, rise in sorted([*low.points, (value, 0.0), *high.points])),
        shape=shape[low.bounded, high.bounded],
        verified=low.verified and high.verified,
        sandwich_over_model=ratio,
    )


class _Side:
    """One side of a profile, towards a bound of the parameter.

    `points`: (value [SI], rise); `end` [SI] of the 95 % interval; `bounded`: whether the objective rises enough before the
    parameter's bound; `verified`: whether it was evaluated as far as its end. Points are taken at doubling distances until the
    rise is enough.
    """

    def __init__(self, objective: _Objective, i: int, value: float, sd: float, bound: float) -> None:
        self.objective, self.i, self.value = objective, i, value
        self.sign, room = np.sign(bound - value) or 1.0, abs(bound - value)
        self.points: list[tuple[float, float]] = []
        self.verified, self.bounded = False, STATISTICS.z_95 * sd <= room
        self.end = value + self.sign * min(STATISTICS.z_95 * sd, room)
        # before: (distance, root of the rise)
        t, before = PROFILE.first_distance * sd, (0.0, 0.0)
        for _ in range(PROFILE.doublings + 1):
            if not objective.affordable or room == 0:
                return
            distance = min(t, room)
            rise = self._rise(distance, (distance / sd) ** 2 if sd else np.inf)
            self.verified, root = True, np.sqrt(max(rise, 0.0))
            self.bounded = root >= STATISTICS.z_95
            if self.bounded:
                # with nothing left to fit the others the rise may be far too large, and the secant far too near
                self.verified = objective.affordable
                if self.verified:
                    self.end = value + self.sign * self._crossing(before, (distance, root))
                return
            self.end, before = float(value + self.sign * distance), (distance, root)
            if distance == room:
                return
            t *= 2.0

    def _rise(self, distance: float, expected: float) -> float:
        """The rise of the objective at a distance from the optimum, kept among the points."""
        value = self.value + self.sign * distance
        rise = self.objective.rise(self.i, value, expected)
        self.points.append((float(value), rise))
        return rise

    def _crossing(self, near: tuple[float, float], far: tuple[float, float]) -> float:
        """The distance at which the root of the rise is 1.96, between `near` and `far` (distance, root): by the secant of both, or
        looked for where `far` lies well above."""
        z, known = STATISTICS.z_95, dict([near, far])
        if far[1] < PROFILE.overshoot * z:
            return float(near[0] + (z - near[1]) / (far[1] - near[1]) * (far[0] - near[0]))

        def above(distance: float) -> float:
            if distance not in known and self.objective.affordable:
                known[distance] = np.sqrt(max(self._rise(distance, z**2), 0.0))
            # what may no longer be evaluated counts as below: an end is not found too near
            return float(known.get(distance, near[1])) - z

        looked = brentq(
            above, near[0], far[0], xtol=1e-300, rtol=PROFILE.same_end, maxiter=PROFILE.most_steps, disp=False
        )
        return float(looked)


class _Objective:
    """The objective around an optimum; evaluations are limited by their cost."""

    def __init__(self, fitter: Fitter, fit: Fit) -> None:
        self.problem = fitter.problem(fit.structure)
        self.values = np.concatenate([fit.theta, *fit.initial_states])
        self.optimum = self.problem.to_scaled(self.values)
        self.low, self.high = self.problem.bounds
        # by parameter all variables, the others fitted at a value of it
        self.refitted: dict[int, list[np.ndarray]] = {}
        J = fit.J * self.problem.si_by_scaled(self.values)
        self.H, self.least = J.T @ J, fit.objective
        states = max(len(sd) for sd in self.problem.initial_sd) + fit.J.shape[1]
        most = max(int(PROFILE.cost / (fit.n * states * fit.J.shape[1])), PROFILE.fewest_points)
        self.evaluations_left = most if fit.chi2 < PROFILE.largest_ratio * fit.n else 0

    @property
    def affordable(self) -> bool:
        """Whether another point may be evaluated."""
        return self.evaluations_left > 0

    def rise(self, i: int, value: float, expected: float) -> float:
        """The objective above its optimum with parameter `i` at `value` [SI] and the others fitted again.

        The others follow the quadratic approximation; where the rise exceeds the one `expected`, they are fitted, from there or from
        the nearest value at which they were.
        """
        others = np.arange(len(self.optimum)) != i
        x = self.optimum.copy()
        moved = self.values.copy()
        moved[i] = value
        x[i] = self.problem.to_scaled(moved)[i]
        shift = self.H[others, i] * (x[i] - self.optimum[i])
        x[others] -= np.linalg.lstsq(self.H[np.ix_(others, others)], shift, rcond=1e-12)[0]
        x[others] = np.clip(x, self.low, self.high)[others]
        rise = self._at(x) - self.least
        if rise <= PROFILE.refit_ratio * expected or not self.affordable:
            return float(rise)
        known = self.refitted.setdefault(i, [self.optimum])
        beside = np.where(others, min(known, key=lambda near: abs(near[i] - x[i])), x)
        start = beside if self._at(beside) - self.least < rise else x
        held = _Held(self.problem, i, x[i])
        fitted = levenberg_marquardt(held, start, PROFILE.most_refits)
        known.append(fitted)
        self.evaluations_left -= held.evaluations
        return float(min(rise, self._at(fitted) - self.least))

    def _at(self, x: np.ndarray) -> float:
        self.evaluations_left -= 1
        r, _ = self.problem.evaluate(x)
        return float(r @ r)


class _Held:
    """A problem with variable `i` held at a value; counts its `evaluations`."""

    def __init__(self, problem: LeastSquaresProblem, i: int, value: float) -> None:
        self.problem, self.evaluations = problem, 0
        self.k, self.step_limit, self.normal_matrix = problem.k, problem.step_limit, problem.normal_matrix
        low, high = (end.copy() for end in problem.bounds)
        low[i] = high[i] = value
        self.bounds = low, high

    def residual(self, x: np.ndarray) -> np.ndarray:
        """That of the problem."""
        self.evaluations += 1
        return self.problem.residual(x)

    def evaluate(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """That of the problem with its Jacobian."""
        self.evaluations += 1
        return self.problem.evaluate(x)
