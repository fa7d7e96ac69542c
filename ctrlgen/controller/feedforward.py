"""The feedforward controller: commanded signal -> drives, with every limit kept, in a fixed number of operations.

It has no feedback: what it keeps of the device is the state that its own model predicts. The generated C
(codegen/limiter) makes the same decisions; docs/limiter.md says how their equality is shown.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ctrlgen.controller.controller_step import ControllerStatus, ControllerStep, State, answer, clamp
from ctrlgen.controller.drive_rate import FREE, RateLimiter
from ctrlgen.controller.kernels import ControllerKernels
from ctrlgen.controller.limit_reach import Slacks
from ctrlgen.controller.lost_state import is_beyond
from ctrlgen.controller.null_motion import of_least_effort
from ctrlgen.model.inverse import Inverse

SLACK = 1e-9  # of a signal's typical size: an excess below this is clipped without being reported
SECANT_STEPS = 3  # of the line search toward a target that the drives cannot reach in one sample
SECANT_FRACTION = 1 - 2**-8  # of the secant estimate is taken, because the drive is not linear along the line
REACH_FRACTION = 1 - 2**-14  # of what is reached in closed form is taken, because numbers are rounded


@dataclass(frozen=True)
class Rounding:
    """Changes [SI] of displacement (n_axes,), actuator state (n_states,) and drive (n_u,)."""

    displacement: np.ndarray
    state: np.ndarray
    drive: np.ndarray


def _moved(f: Callable[[np.ndarray], np.ndarray], at: np.ndarray, by: np.ndarray) -> np.ndarray:
    """The sum of what f changes by where each number of `at` is moved `by` so much, alone."""
    home = f(at)
    changes = [np.abs(f(at + step) - home) for step in np.diag(by)]
    return np.sum([np.where(np.isfinite(c), c, 0.0) for c in changes], axis=0) if changes else np.zeros_like(home)


def unobserved(what: str, answer: np.ndarray) -> None:
    """The observer that does nothing with an answer."""


@dataclass(frozen=True)
class Controller:
    """The limiter around the kernels of one device.

    `slack`, of a signal's typical size, is the excess over a limit that is clipped without report. Without `keeps_rates` drives change as
    fast as they are asked to. Each answer of a kernel that a decision is taken on is told to `observe` with its name: "displacement",
    "state", "drive", "composite_bound", "composite_ratio", and "rate" with whether the rates change the drives, and by more than the slack.
    """

    kernels: ControllerKernels
    slack: float = SLACK
    keeps_rates: bool = True
    observe: Callable[[str, np.ndarray], object] = unobserved

    @cached_property
    def slacks(self) -> Slacks:
        """Excess over a limit that is clipped without report, for displacement, actuator state and drive."""
        return self.kernels.slacks(self.slack)

    @cached_property
    def state_can_be_limited(self) -> bool:
        """Whether a displacement in range can need an actuator state beyond its limits."""
        return self.kernels.state_can_be_limited(self.slack)

    @cached_property
    def drive_can_be_limited(self) -> tuple[bool, bool]:
        """Whether a displacement in range can need a drive beyond its limits, to settle there and to step there."""
        return self.kernels.drive_can_be_limited(self.slack)

    @cached_property
    def rate(self) -> RateLimiter | None:
        """What keeps the limits on rates of drives; None for a device without, and where no time passes."""
        k = self.kernels
        if k.sample_time is None or not (k.rated and self.keeps_rates):
            return None
        fall, rise = (np.clip(bound * k.sample_time, -FREE, FREE) for bound in k.nominal.rate_bounds)
        return RateLimiter(fall, rise, self.slacks[2])

    @cached_property
    def plausible(self) -> np.ndarray:
        """The largest magnitudes of the numbers of a state that is not lost, see `lost_state`."""
        return self.kernels.plausible(self.rate is not None)

    def is_lost(self, *state: np.ndarray) -> bool:
        """Whether a state cannot be one that the controller left."""
        return is_beyond(self.plausible, *state)

    def rest(self) -> State:
        """State of a device at rest at ambient temperature, its drives off."""
        m = self.kernels.nominal
        still = m.rest.copy(), np.zeros(len(m.axes))
        return still if self.rate is None else (*still, self.kernels.safe_drive.copy())

    def drive(self, k: Inverse, state: State, wanted: np.ndarray, state_wanted: np.ndarray) -> np.ndarray:
        """(n_u,) the drives that displacement and actuator state need, by the kernels `k`; beyond limits where none keep them."""
        return self.chosen(self._answer("drive", k.drive, *state[:2], wanted, state_wanted), state)

    def chosen(self, drive: np.ndarray, state: State) -> np.ndarray:
        """Gives, of all drives (n_u,) that push as `drive`, those of least effort within limits."""
        return of_least_effort(drive, self.kernels.redundancy, self.rate, *state[2:])

    def rounding(
        self, before: State, target: np.ndarray, reached: tuple[np.ndarray, np.ndarray], settle: bool, share: float
    ) -> Rounding:
        """By how much displacement, actuator state and drive change where all that each is computed from does by this `share` of itself.

        The numbers of a target, then the displacements, then the states, each number alone: what cancels between them does not cancel in
        their roundings. `reached` are displacement and actuator state of a step from `before` to `target`.
        """
        k, (x, z), (d, state) = self._inverse(settle), before[:2], reached

        def off_target(t: np.ndarray) -> np.ndarray:
            return answer(k.displacement, x, z, t)

        def off_displacement(d: np.ndarray) -> np.ndarray:
            return np.concatenate([answer(k.state, x, z, d), self.drive(k, before, d, state)])

        d_off = np.maximum(_moved(off_target, target, share * target), share * np.abs(d))
        moved = _moved(off_displacement, d, d_off)
        state_off = np.maximum(moved[: len(state)], share * np.abs(state))
        drive_off = moved[len(state) :] + _moved(lambda s: self.drive(k, before, d, s), state, state_off)
        return Rounding(d_off, state_off, drive_off)

    def _inverse(self, settle: bool) -> Inverse:
        return self.kernels.modes[not settle]

    def _toward(self, rate: RateLimiter, last: np.ndarray, wanted: np.ndarray) -> tuple[np.ndarray, float, bool, bool]:
        """The answer of `RateLimiter.toward`, of which the observer is told."""
        drive, share, touched, held = rate.toward(last, wanted)
        self.observe("rate", np.array([touched, held]))
        return drive, share, touched, held

    def _answer(self, what: str, kernel: ca.Function, *arguments: object) -> np.ndarray:
        """The answer of a kernel on which a decision is taken."""
        found = answer(kernel, *arguments)
        self.observe(what, found)
        return found

    def step(self, state: State, target: np.ndarray, *, settle: bool = False) -> ControllerStep:
        """Drives that bring the followed signal to `target` (channels,) [SI] at the next sample, from `state` (as `rest`).

        With `settle`: the equilibrium at `target`, and its state. Every limit is kept; `ControllerStatus` says which ones acted. With
        rates of drives that holds for the drives and their rates; see `ControllerStatus.RATE`.
        A state that is found lost (`is_lost`, `examined_first`) is answered with the safe drive, and is NaN from then on, which is
        answered so too; go on from `rest` once the device is there.
        A target that the drives cannot reach in one sample is approached along the straight line of displacements, on
        which convex limits hold.
        """
        kernels, m, (x, z) = self.kernels, self.kernels.nominal, state[:2]
        k = self._inverse(settle)
        n, static = m.n_states, k is kernels.static
        first = kernels.examined_first[not static]
        if np.isnan(np.concatenate(state)).all() or (first and self.is_lost(*state)):
            return self._without_state()
        z_slack, _, u_slack = self.slacks
        if not (np.abs(target) <= kernels.input_limits[: len(target)]).all():  # nor is a NaN
            lost = not first and self.is_lost(*state)
            return self._without_state() if lost else self._without_target(k, state)
        wanted, status = self._answer("displacement", k.displacement, x, z, target), ControllerStatus(0)
        if not ((wanted >= m.z_bounds[0]) & (wanted <= m.z_bounds[1])).all():  # a NaN is not inside either
            beyond = wanted
            wanted, hit = clamp(beyond, *m.z_bounds, z_slack)
            if hit:
                wanted = answer(kernels.nearest, beyond)
                status |= ControllerStatus.DISPLACEMENT
        state_wanted, hit = self._limited_state(k, x, z, wanted)
        if hit:
            wanted = answer(k.settle, np.concatenate([state_wanted, x[n:]]), wanted, kernels.safe_drive)
            status |= ControllerStatus.STATE
        wanted, worst = self._limit_composite(x, z, wanted)
        if worst > 1:
            state_wanted, _ = self._limited_state(k, x, z, wanted)
        if worst > 1 + self.slack:
            status |= ControllerStatus.COMPOSITE
        drive = self.drive(k, state, wanted, state_wanted)
        outside = not ((drive >= m.u_bounds[0]) & (drive <= m.u_bounds[1])).all()
        if outside and not first and self.is_lost(*state):
            return self._without_state()
        u, limited = clamp(drive, *m.u_bounds, u_slack)
        if limited:
            toward = self._into_reach if kernels.own_drives else self._line_search
            wanted, state_wanted, drive = toward(k, state, np.zeros_like(z) if static else z, wanted, drive)
            u, limited = clamp(drive, *m.u_bounds, u_slack)
            status |= ControllerStatus.DRIVE
        held = False
        if self.rate is not None:
            u, share, touched, held = self._toward(self.rate, state[2], u)
            if touched and not first and self.is_lost(*state):
                return self._without_state()
            u = np.clip(u, *m.u_bounds)
        last = () if self.rate is None else (u,)
        if held:
            status, limited, wanted = status | ControllerStatus.RATE, True, z + share * (wanted - z)
        if not limited and len(x) == n:  # only actuators have memory: their state is what the drive was computed for
            return ControllerStep(status, wanted, state_wanted, u, (state_wanted, wanted, *last))
        x_next = answer(k.advance, x, wanted if static else z, u)
        z_next = answer(k.settle, x_next, wanted, u) if limited else wanted
        if held and kernels.limits_can_be_passed:
            status |= self._passed(x_next, z_next)
        return ControllerStep(status, z_next, x_next[:n] if limited else state_wanted, u, (x_next, z_next, *last))

    def _passed(self, x: np.ndarray, z: np.ndarray) -> ControllerStatus:
        """The limits beyond which a device is that has come to (x, z) with its drives as fast as they may change."""
        m, status = self.kernels.nominal, ControllerStatus(0)
        n, (low, high) = m.n_states, m.x_bounds
        if clamp(z, *m.z_bounds, self.slacks[0])[1]:
            status |= ControllerStatus.DISPLACEMENT
        if self.state_can_be_limited and clamp(x[:n], low[:n], high[:n], self.slacks[1])[1]:
            status |= ControllerStatus.STATE
        return status | (ControllerStatus.COMPOSITE if self._limit_composite(x, z, z)[1] > 1 + self.slack else status)

    def _without_state(self) -> ControllerStep:
        """The safe drive, where nothing is known of the device; a device that is left alone comes to rest."""
        rest, home = self.rest()[:2]
        lost = tuple(np.full_like(part, np.nan) for part in self.rest())
        n = self.kernels.nominal.n_states
        return ControllerStep(ControllerStatus.LOST, home, rest[:n], self.kernels.safe_drive, lost)

    def _without_target(self, k: Inverse, state: State) -> ControllerStep:
        """The safe drive, or the way to it that rates allow, and what the device does under it for one sample."""
        (x, z, *last), m, u = state, self.kernels.nominal, self.kernels.safe_drive
        if self.rate is not None:
            u = np.clip(self._toward(self.rate, last[0], u)[0], *m.u_bounds)
            last = [u]
        x_next = answer(k.advance, x, z, u)
        z_next = answer(k.settle, x_next, z, u)
        return ControllerStep(ControllerStatus.INPUT, z, x[: m.n_states], u, (x_next, z_next, *last))

    def _limited_state(self, k: Inverse, x: np.ndarray, z: np.ndarray, wanted: np.ndarray) -> tuple[np.ndarray, bool]:
        """The actuator state that displacement `wanted` needs, limited to its range, and whether that changed it."""
        n, (low, high) = self.kernels.nominal.n_states, self.kernels.nominal.x_bounds
        state = self._answer("state", k.state, x, z, wanted)
        return clamp(state, low[:n], high[:n], self.slacks[1]) if self.state_can_be_limited else (state, False)

    def _limit_composite(self, x: np.ndarray, z: np.ndarray, wanted: np.ndarray) -> tuple[np.ndarray, float]:
        """`wanted` scaled toward home where it breaks a guarded limit, and the largest share of a limit seen (0: none looked at)."""
        kernels, worst = self.kernels, 0.0
        bound = kernels.composite_bound
        if kernels.guarded_limits and (bound is None or not self._answer("composite_bound", bound, wanted)[0] <= 1):
            for _ in range(kernels.composite_rounds):
                ratio = float(self._answer("composite_ratio", kernels.composite_ratio, x, z, wanted)[0])
                if ratio > 1:  # not for NaN
                    worst, wanted = max(worst, ratio), wanted / ratio
        return wanted, worst

    def _into_reach(
        self, k: Inverse, now: State, origin: np.ndarray, target: np.ndarray, at_target: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """As `_line_search` where each drive leads a displacement of its own: as far as every one can, in closed form.

        Drives held within their limits lead to displacements r. Of the line as much is gone, max(0, min_i (r_i - o_i) / (t_i - o_i)),
        as the slowest of those that are beyond by more than the slack allows: less is what rounding leaves of a state, and an axis that
        rests would hold the others. As drives rise with their displacements, or fall, all lie between those of
        origin o and r.
        """
        (low, high), slack, (x, z) = self.kernels.nominal.u_bounds, self.slacks[2], now[:2]
        held, _ = clamp(at_target, low, high, slack)
        x_then = answer(k.advance, x, target if k is self.kernels.static else z, held)
        gone, whole, share = answer(k.settle, x_then, target, held) - origin, target - origin, 1.0
        for i in np.flatnonzero((at_target > held + slack) | (at_target < held - slack)):
            if (whole[i] > 0 and gone[i] < share * whole[i]) or (whole[i] < 0 and gone[i] > share * whole[i]):
                share = gone[i] / whole[i]
        reached = origin + (REACH_FRACTION * share if share > 0 else 0.0) * whole
        state, _ = self._limited_state(k, x, z, reached)
        return reached, state, self.drive(k, now, reached, state)

    def _line_search(
        self, k: Inverse, now: State, origin: np.ndarray, target: np.ndarray, at_target: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(displacement, actuator state, drive) on the line from `origin` to `target`, as far as admissible drives were found.

        `SECANT_STEPS` secants of the drive that is first at its limit, each shortened to `SECANT_FRACTION`; the origin
        itself where its drives are inadmissible. `at_target`: the drives at `target`.
        """
        (low, high), slack = self.kernels.nominal.u_bounds, self.slacks[2]

        def needed(displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            state, _ = self._limited_state(k, now[0], now[1], displacement)
            return state, self.drive(k, now, displacement, state)

        state, at_start = needed(origin)
        if clamp(at_start, low, high, slack)[1]:
            return origin, state, at_start
        direction, accepted, rejected = target - origin, 0.0, 1.0
        for _ in range(SECANT_STEPS):
            share = 1.0
            for i in np.flatnonzero((at_target > high + slack) | (at_target < low - slack)):
                limit = high[i] if at_target[i] > high[i] else low[i]
                share = min(share, (limit - at_start[i]) / (at_target[i] - at_start[i]))
            fraction = accepted + SECANT_FRACTION * max(share, 0.0) * (rejected - accepted)
            trial_state, drive = needed(origin + fraction * direction)
            if clamp(drive, low, high, slack)[1]:
                rejected, at_target = fraction, drive
            else:
                accepted, state, at_start = fraction, trial_state, drive
        return origin + accepted * direction, state, at_start
