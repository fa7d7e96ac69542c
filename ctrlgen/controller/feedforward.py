"""The feedforward controller: commanded signal -> drives, with every limit kept, in a fixed number of operations.

It has no feedback: what it keeps of the device is the state that its own model predicts. The generated C
(`online.c.j2`) makes the same decisions; docs/limiter.md says how their equality is shown.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ctrlgen.controller.controller_step import ControllerStatus, ControllerStep, State, clamp, row
from ctrlgen.controller.kernels import ControllerKernels
from ctrlgen.model.inverse import Inverse

SECANT_STEPS = 3  # of the line search toward a target that the drives cannot reach in one sample
SECANT_FRACTION = 1 - 2**-8  # of the secant estimate is taken, because the drive is not linear along the line


@dataclass(frozen=True)
class Controller(ControllerKernels):
    """One device, one followed signal, one sample time (None: equilibria only)."""

    def step(self, state: State, target: np.ndarray, *, settle: bool = False) -> ControllerStep:
        """Drives that bring the followed signal to `target` (channels,) [SI] at the next sample, from `state` (as `rest`).

        With `settle`: the equilibrium at `target`, and its state. Every limit is kept; `ControllerStatus` says which ones acted. With
        rates of drives that holds for the drives and their rates; see `ControllerStatus.RATE`.
        A state that is found lost (`is_lost`, `examined_first`) is answered with the safe drive, and is NaN from then on, which is
        answered so too; go on from `rest` once the device is there.
        A target that the drives cannot reach in one sample is approached along the straight line of displacements, on
        which convex limits hold.
        """
        m, (x, z) = self.nominal, state[:2]
        first = self.examined_first[not settle and self.moving is not None]
        if np.all(np.isnan(np.concatenate(state))) or (first and self.is_lost(*state)):
            return self._without_state()
        k = self.static if settle or self.moving is None else self.moving
        n, static = m.n_states, k is self.static
        z_slack, _, u_slack = self.slacks
        wanted, status = row(k.displacement(x, z, target)), ControllerStatus(0)
        if not np.all((wanted >= m.z_bounds[0]) & (wanted <= m.z_bounds[1])):  # a NaN is not inside either
            usable = np.all(np.abs(target) <= self.input_limits[: len(target)])
            if not usable:
                lost = not first and self.is_lost(*state)
                return self._without_state() if lost else self._without_target(k, state)
            beyond = wanted
            wanted, hit = clamp(beyond, *m.z_bounds, z_slack)
            if hit:
                wanted = row(self.nearest(beyond))
                status |= ControllerStatus.DISPLACEMENT
        state_wanted, hit = self._limited_state(k, x, z, wanted)
        if hit:
            wanted = row(k.settle(np.concatenate([state_wanted, x[n:]]), wanted, self.safe_drive))
            status |= ControllerStatus.STATE
        wanted, worst = self._limit_composite(x, z, wanted)
        if worst > 1:
            state_wanted, _ = self._limited_state(k, x, z, wanted)
        if worst > 1 + self.slack:
            status |= ControllerStatus.COMPOSITE
        drive = self.drive(k, state, wanted, state_wanted)
        outside = not np.all((drive >= m.u_bounds[0]) & (drive <= m.u_bounds[1]))
        if outside and not first and self.is_lost(*state):
            return self._without_state()
        u, limited = clamp(drive, *m.u_bounds, u_slack)
        if limited:
            wanted, state_wanted, drive = self._line_search(k, state, np.zeros_like(z) if static else z, wanted, drive)
            u, limited = clamp(drive, *m.u_bounds, u_slack)
            status |= ControllerStatus.DRIVE
        held = False
        if self.rate is not None:
            u, share, touched, held = self.rate.toward(state[2], u)
            if touched and not first and self.is_lost(*state):
                return self._without_state()
            u = np.clip(u, *m.u_bounds)
        last = () if self.rate is None else (u,)
        if held:
            status, limited, wanted = status | ControllerStatus.RATE, True, z + share * (wanted - z)
        if not limited and len(x) == n:  # only actuators have memory: their state is what the drive was computed for
            return ControllerStep(status, wanted, state_wanted, u, (state_wanted, wanted, *last))
        x_next = row(k.advance(x, wanted if static else z, u))
        z_next = row(k.settle(x_next, wanted, u)) if limited else wanted
        if held:
            status |= self._passed(x_next, z_next) if self.limits_can_be_passed else status
            state_wanted = x_next[:n]
        return ControllerStep(status, z_next, state_wanted, u, (x_next, z_next, *last))

    def _passed(self, x: np.ndarray, z: np.ndarray) -> ControllerStatus:
        """The limits beyond which a device is that has come to (x, z) with its drives as fast as they may change."""
        found, n, (low, high) = ControllerStatus(0), self.nominal.n_states, self.nominal.x_bounds
        if clamp(z, *self.nominal.z_bounds, self.slacks[0])[1]:
            found |= ControllerStatus.DISPLACEMENT
        if self.state_can_be_limited and clamp(x[:n], low[:n], high[:n], self.slacks[1])[1]:
            found |= ControllerStatus.STATE
        return found | (ControllerStatus.COMPOSITE if self._limit_composite(x, z, z)[1] > 1 + self.slack else found)

    def _without_state(self) -> ControllerStep:
        """The safe drive, where nothing is known of the device; a device that is left alone comes to rest."""
        rest, home = self.rest()[:2]
        lost = tuple(np.full_like(part, np.nan) for part in self.rest())
        return ControllerStep(ControllerStatus.LOST, home, rest[: self.nominal.n_states], self.safe_drive, lost)

    def _without_target(self, k: Inverse, state: State) -> ControllerStep:
        """The safe drive, or the way to it that rates allow, and what the device does under it for one sample."""
        (x, z, *last), u = state, self.safe_drive
        if self.rate is not None:
            u = np.clip(self.rate.toward(last[0], u)[0], *self.nominal.u_bounds)
            last = [u]
        x_next = row(k.advance(x, z, u))
        z_next = row(k.settle(x_next, z, u))
        return ControllerStep(ControllerStatus.INPUT, z, x[: self.nominal.n_states], u, (x_next, z_next, *last))

    def _limited_state(self, k: Inverse, x: np.ndarray, z: np.ndarray, wanted: np.ndarray) -> tuple[np.ndarray, bool]:
        """The actuator state that displacement `wanted` needs, limited to its range, and whether that changed it."""
        n, (low, high) = self.nominal.n_states, self.nominal.x_bounds
        state = row(k.state(x, z, wanted))
        return clamp(state, low[:n], high[:n], self.slacks[1]) if self.state_can_be_limited else (state, False)

    def _limit_composite(self, x: np.ndarray, z: np.ndarray, wanted: np.ndarray) -> tuple[np.ndarray, float]:
        """`wanted` scaled toward home where it breaks a guarded limit, and the largest share of a limit seen (0: none looked at)."""
        worst = 0.0
        if self.guarded_limits and (self.composite_bound is None or not float(self.composite_bound(wanted)) <= 1):
            for _ in range(self.composite_rounds):
                ratio = float(self.composite_ratio(x, z, wanted))
                if ratio > 1:  # not for NaN
                    worst, wanted = max(worst, ratio), wanted / ratio
        return wanted, worst

    def _line_search(
        self, k: Inverse, now: State, origin: np.ndarray, target: np.ndarray, at_target: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(displacement, actuator state, drive) on the line from `origin` to `target`, as far as admissible drives were found.

        `SECANT_STEPS` secants of the drive that is first at its limit, each shortened to `SECANT_FRACTION`; the origin
        itself where its drives are inadmissible. `at_target`: the drives at `target`.
        """
        (low, high), slack = self.nominal.u_bounds, self.slacks[2]

        def answer(displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            state, _ = self._limited_state(k, now[0], now[1], displacement)
            return state, self.drive(k, now, displacement, state)

        state, at_start = answer(origin)
        if clamp(at_start, low, high, slack)[1]:
            return origin, state, at_start
        direction, accepted, rejected = target - origin, 0.0, 1.0
        for _ in range(SECANT_STEPS):
            share = 1.0
            for i in np.flatnonzero((at_target > high + slack) | (at_target < low - slack)):
                limit = high[i] if at_target[i] > high[i] else low[i]
                share = min(share, (limit - at_start[i]) / (at_target[i] - at_start[i]))
            fraction = accepted + SECANT_FRACTION * max(share, 0.0) * (rejected - accepted)
            trial_state, drive = answer(origin + fraction * direction)
            if clamp(drive, low, high, slack)[1]:
                rejected, at_target = fraction, drive
            else:
                accepted, state, at_start = fraction, trial_state, drive
        return origin + accepted * direction, state, at_start
