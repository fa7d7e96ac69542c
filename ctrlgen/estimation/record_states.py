"""The initial states that suit one record best, at given parameters: what the readings of a record are predicted from.

min |W (y - y(p, s))|^2 + sum ((s_j - s0_j)/sd_j)^2 over the free initial states s of that record alone, s0 where they are expected.
"""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from ctrlgen.effects import Effect, State
from ctrlgen.estimation.error_model import ErrorModel
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.initial_memory import arbitrary_states
from ctrlgen.estimation.least_squares import initial_state_sd, whiten_residual
from ctrlgen.estimation.settings import FIT, HELD_OUT_REFIT
from ctrlgen.estimation.simulator import Simulator
from ctrlgen.numerics.levenberg_marquardt import levenberg_marquardt
from ctrlgen.recordings.recording import Record


class Begun(NamedTuple):
    """The objective, the states (n_s,) in their prior deviations, and the readings (n, n_y) [SI] from there."""

    objective: float
    states: np.ndarray
    y: np.ndarray


class StatesProblem:
    """Residual (m,) and Jacobian (m, n_s) by the states in their prior deviations: rows of the readings, then of the prior about those
    `expected` (n_s,).

    Large values are not limited: a record may begin far from where it is looked for.
    """

    def __init__(
        self, simulator: Simulator, error: ErrorModel, theta: np.ndarray, record: Record, expected: np.ndarray
    ) -> None:
        self.simulator, self.error, self.theta, self.record, self.expected = simulator, error, theta, record, expected
        self.sd = initial_state_sd(simulator)
        self.k = len(self.sd)
        self.step_limit = np.full(self.k, np.inf)
        self._readings: tuple[np.ndarray, np.ndarray] | None = None
        self._slopes: tuple[np.ndarray, np.ndarray] | None = None

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Those of a fit."""
        most = np.full(self.k, FIT.start_reach)
        return -most, most

    def readings(self, x: np.ndarray) -> np.ndarray:
        """The readings (n, n_y) [SI]; the last are kept."""
        if self._readings is None or not np.array_equal(self._readings[0], x):
            self._readings = x.copy(), self.simulator.simulate(self.record, self.theta, self.sd * x)
        return self._readings[1]

    def residual(self, x: np.ndarray) -> np.ndarray:
        """The residual (m,)."""
        return np.concatenate([whiten_residual(self.error, self.record, self.readings(x)).ravel(), x - self.expected])

    def evaluate(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The residual (m,) and its Jacobian (m, n_s); the last is kept."""
        if self._slopes is None or not np.array_equal(self._slopes[0], x):
            y, Y = self.simulator.sensitivities(self.record, self.theta, self.sd * x, by_free=False)
            J = np.vstack([-self.error.whiten(Y, self.record.valid).reshape(-1, self.k) * self.sd, np.eye(self.k)])
            self._readings, self._slopes = (x.copy(), y), (x.copy(), np.nan_to_num(J, posinf=0.0, neginf=0.0))
        return self.residual(x), self._slopes[1]

    def normal_matrix(self, J: np.ndarray) -> np.ndarray:
        """J'J (n_s, n_s)."""
        return J.T @ J


def begun_near(
    simulator: Simulator, error: ErrorModel, theta: np.ndarray, record: Record, states: np.ndarray, expected: np.ndarray
) -> Begun:
    """The states reached from `states`, where `expected` ones are likeliest: by one Gauss-Newton step, shortened until it lowers the
    objective, where the readings are linear in them; by Levenberg-Marquardt from there where that step brings much less than it promised.
    As given where they have no slopes."""
    problem = StatesProblem(simulator, error, theta, record, expected)
    r, J = problem.evaluate(states)
    was = float(r @ r)
    best = Begun(was, states, problem.readings(states))
    if not J[: -problem.k].any():
        return best
    step = np.linalg.lstsq(J, -r, rcond=None)[0]
    promised = float(np.sum((r + J @ step) ** 2))
    for _ in range(HELD_OUT_REFIT.halvings):  # a gap or a friction threshold makes the first step useless
        there = states + step
        residual = problem.residual(there)
        if (value := float(residual @ residual)) <= was:
            best = Begun(value, there, problem.readings(there))
            break
        step = step / 4
    least = HELD_OUT_REFIT.unsettled * best.objective
    settled = best.objective - promised <= least or was - best.objective <= least
    # what catches up with its drive, and a phase, promise too little in one step
    if settled and not simulator.slews and not arbitrary_states(simulator):
        return best
    found = levenberg_marquardt(problem, best.states, HELD_OUT_REFIT.max_steps_to_begin)
    r = problem.residual(found)
    value = float(r @ r)
    return Begun(value, found, problem.readings(found)) if value < best.objective else best


def told_state(law: type[Effect]) -> State:
    """Of a law that is another in each record, the state that tells how: the rate of a drift rather than its zero."""
    return [state for state in law.states if state.per_record][-1]


def place_of_told(simulator: Simulator, cause: Hypothesis) -> int:
    """The place of the `told_state` of a cause among the free initial states of a simulator."""
    own = re.compile(rf"{cause.effect}_\d+_{told_state(cause.law).name}_{re.escape(cause.at)}")
    names = simulator.model.x_names
    (place,) = (k for k, x in enumerate(simulator.free_initial_states) if x < len(names) and own.fullmatch(names[x]))
    return place
