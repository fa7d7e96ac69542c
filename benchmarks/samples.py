"""The circle, other targets, and the problem of one sample that every peer solves.

One sample: given the wanted pose, the stage displacements z and temperatures T with pose(z) = target and
balance(z, T) = 0; the drives u that lead from the temperatures before to T follow in closed form, because the
step is linear in u. Unknowns y = (z, T) and equations are divided by their typical sizes, as in `ctrlgen.trajectory.solution`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import casadi as ca
import numpy as np

from ctrlgen.budget.robust import solve
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.firmware.c.real import Real
from ctrlgen.model.assembly import build_model
from ctrlgen.model.discretisation import held_step
from ctrlgen.model.model import Model
from ctrlgen.model.simulation import simulate
from ctrlgen.trajectory.inverse.clock import in_time
from ctrlgen.trajectory.scenario import Scenario, load_scenario
from ctrlgen.trajectory.solution import Solution
from ctrlgen.verification.tolerances import EXCESS_LIMIT

SCENARIO = Path(__file__).resolve().parent.parent / "scenarios" / "circle20"
NEAR = 1e-11  # m: 0.01 nm, what two answers may differ by
NEAR_FLOAT = 1e-10  # m, in single precision
COUNT = 1000  # targets of the random sets
PAUSE = 25  # samples between two random points of a path


class Disagreement(Exception):
    """A contender's answer is wrong; its time would mean nothing."""


@dataclass(frozen=True)
class Answers:
    """What a contender answered, SI: displacements, temperatures and drives (n, 6) each, status (n,)."""

    z: np.ndarray
    T: np.ndarray
    u: np.ndarray
    status: np.ndarray


class Samples:
    """Scenario, model, solution, and checks of answers against them."""

    def __init__(self) -> None:
        self.scenario: Scenario = load_scenario(SCENARIO)
        self.model: Model = build_model(self.scenario.device)
        self.solution: Solution = solve(self.scenario, self.model)
        self.command = self.solution.command
        self.controller = controller_of(self.model, self.scenario.file.follow, self.scenario.sample_time)
        self.axes = len(self.model.axes)
        if self.model.x.numel() != self.axes or not self.scenario.closed:
            raise Disagreement("the peers are written for a closed path and one state per actuator")

    @cached_property
    def symbols(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        """y = (z, T), T before (both scaled), target (SI)."""
        n = self.axes
        return ca.SX.sym("y", 2 * n), ca.SX.sym("before", n), ca.SX.sym("target", self.command.shape[1])

    @cached_property
    def pose_error(self) -> ca.SX:
        """(pose(z) - target) / typical size, as an expression of the symbols."""
        signal = self.model.signals[self.scenario.file.follow]
        return (self._at(signal.expr, ca.SX.zeros(self.axes)) - self.symbols[2]) / signal.scale

    @cached_property
    def balance(self) -> ca.SX:
        """balance(z, T) / typical force."""
        return self._at(self.model.balance, ca.SX.zeros(self.axes)) / self.model.force_scale

    @cached_property
    def drive(self) -> ca.Function:
        """(y, before) -> the drives that lead from `before` to the T in y, in W."""
        m, (y, before, _) = self.model, self.symbols
        u = ca.SX.sym("u", self.axes)
        step = self._at(held_step(m, in_time(self.scenario.clock).sample_time), u, before * m.x_scale + m.rest)
        motion = step - y[self.axes :] * m.x_scale - m.rest
        slope = ca.jacobian(motion, u)
        return ca.Function("drive", [y, before], [-ca.solve(slope, ca.substitute(motion, u, 0))])

    def _at(self, expression: ca.SX, u: ca.SX, T: ca.SX | None = None) -> ca.SX:
        """`expression` of the model at the symbols' displacements and, unless `T` is given, temperatures."""
        m, y = self.model, self.symbols[0]
        T = y[self.axes :] * m.x_scale + m.rest if T is None else T
        values = ca.vertcat(T, y[: self.axes] * m.z_scale, u, ca.DM(m.p_nominal))
        return ca.substitute(expression, ca.vertcat(m.x, m.z, m.u, m.p), values)

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Bounds of y."""
        m = self.model
        z, T = m.z_bounds, m.x_bounds
        low, high = (np.concatenate([z[i] / m.z_scale, (T[i] - m.rest) / m.x_scale]) for i in range(2))
        return low, high

    def answers(self, y: np.ndarray, u: np.ndarray) -> Answers:
        """Scaled unknowns (n, 12) and drives as Answers."""
        m, n = self.model, self.axes
        return Answers(y[:, :n] * m.z_scale, y[:, n:] * m.x_scale + m.rest, u, np.zeros(len(y), dtype=int))

    def reachable(self) -> np.ndarray:
        """A path through random points of the range, slow enough to be followed: COUNT targets within every limit.

        Points are random displacements, shrunk where they break a composite limit; the limits are convex, so that
        the straight lines between points break none. Each line is eased by a cosine, and the path is closed.
        """
        m = self.model
        low, high = m.z_bounds
        n = COUNT // PAUSE
        z = np.random.default_rng(1).uniform(low + 0.1 * (high - low), high, size=(n, self.axes))
        values = m.limited_values(np.tile(m.rest, (n, 1)), z, np.zeros((n, self.axes)))
        by_name = {limit.name: value for limit, value in zip(m.limits, values, strict=True)}
        ratios = [np.max(by_name[c.name] / c.upper, axis=1) for c in m.composite_limits() if c.upper is not None]
        z = z / np.maximum(np.max(ratios, axis=0), 1.0)[:, None] * (1 - 1e-6)
        share = (1 - np.cos(np.pi * np.arange(PAUSE) / PAUSE)) / 2
        lines = z[:, None, :] + share[None, :, None] * (np.roll(z, -1, axis=0) - z)[:, None, :]
        return self._pose(lines.reshape(-1, self.axes))

    def beyond(self) -> np.ndarray:
        """The reachable path enlarged, so that most of its targets break a composite limit."""
        return 1.6 * self.reachable()

    def jumps(self) -> np.ndarray:
        """Random targets beyond the limits, each far from the one before: displacement, stress and drive give way."""
        low, high = self.model.z_bounds
        return self._pose(np.random.default_rng(2).uniform(low - 0.2 * high, 1.3 * high, size=(COUNT, self.axes)))

    def _pose(self, z: np.ndarray) -> np.ndarray:
        m, n = self.model, len(z)
        signal = m.signals[self.scenario.file.follow].expr
        return ca.Function("pose", [m.z], [signal]).map(n)(z.T).full().T

    def check(self, name: str, answers: Answers, targets: np.ndarray, near: float = NEAR) -> None:
        """Raises Disagreement unless pose(z) is the target and T balances z, both within `near`."""
        m = self.model
        pose = np.abs(self._pose(answers.z) - targets) / np.array(m.signals[self.scenario.file.follow].scale) * 1e-6
        force = ca.substitute(m.balance, ca.vertcat(m.u, m.p), ca.vertcat(ca.SX.zeros(self.axes), ca.DM(m.p_nominal)))
        off = ca.solve(ca.jacobian(force, m.z), force)
        settled = ca.Function("off", [m.x, m.z], [off]).map(len(targets))(answers.T.T, answers.z.T).full()
        for what, error in (("the pose misses its target by", pose), ("the forces balance elsewhere, off by", settled)):
            _require(name, what, np.abs(error).max(), near)

    def check_same(self, name: str, answers: Answers, reference: Answers, near: float = NEAR) -> None:
        """Raises Disagreement unless displacements and status are those of `reference`."""
        _require(name, "a displacement differs by", np.abs(answers.z - reference.z).max(), near)
        if np.any(answers.status != reference.status):
            raise Disagreement(f"{name}: another status at sample {int(np.argmax(answers.status != reference.status))}")

    def check_limits(self, name: str, answers: Answers) -> None:
        """Raises Disagreement unless the model driven by these answers keeps every limit, to what float rounding may leave."""
        m = self.model
        u = answers.u[1:]
        reached = simulate(m, u, in_time(self.scenario.clock).sample_time, answers.T[0])
        x, z = reached.x[1:], reached.z[1:]
        for limit, v in zip(m.limits, m.limited_values(x, z, u), strict=True):
            size = max(abs(limit.upper or 0.0), abs(limit.lower or 0.0)) or np.abs(v).max()
            over = -np.inf if limit.upper is None else v.max() - limit.upper
            under = -np.inf if limit.lower is None else limit.lower - v.min()
            if not max(over, under) <= EXCESS_LIMIT[Real.FLOAT] * size:
                raise Disagreement(f"{name}: {limit.label} goes {max(over, under) / size:.2g} of its bound beyond it")

    def check_circle(self, name: str, answers: Answers, near: float = NEAR) -> None:
        """Raises Disagreement unless answers to the circle are IPOPT's and their drives, simulated, follow it.

        The answer to target k leads from sample k - 1 to k.
        """
        self.check(name, answers, self.command, near)
        trace = self.solution.trace
        _require(name, "a displacement differs from IPOPT's by", np.abs(answers.z - trace.z).max(), near)
        drives = np.roll(answers.u, -1, axis=0)
        role = self.scenario.file.follow
        reached = simulate(self.model, drives, in_time(self.scenario.clock).sample_time, trace.x[0]).signals[role][:-1]
        error = np.abs(reached - self.command) / np.array(self.model.signals[role].scale) * 1e-6
        _require(name, "its drives lead the model off the circle by", error.max(), near)

    def reference(self, targets: np.ndarray) -> Answers:
        """The controller of `ctrlgen.controller.feedforward` over `targets`, starting settled at the last one."""
        step = self.controller.step(self.controller.rest(), targets[-1], settle=True)
        steps = []
        for target in targets:
            step = self.controller.step(step.state, target)
            steps.append(step)
        z, T, u = (np.array([getattr(s, f) for s in steps]) for f in ("displacement", "actuator_state", "drive"))
        return Answers(z, T, u, np.array([int(s.status) for s in steps]))


def _require(name: str, what: str, error: float, near: float) -> None:
    if not error <= near:
        raise Disagreement(f"{name}: {what} {error * 1e9:.3g} nm, more than {near * 1e9:g} nm")
