"""The feedforward controller: commanded signal -> drives, with every limit kept, in a fixed number of operations.

It has no feedback: what it keeps of the device is the state that its own model predicts. The generated C
(`online.c.j2`) makes the same decisions; docs/limiter.md says how their equality is shown.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from ctrlgen.model.allocation import inverse_of
from ctrlgen.model.assembly import build_model
from ctrlgen.model.composite_bound import composite_bound, worst_in_range
from ctrlgen.model.controller_step import ControllerStatus, ControllerStep, clamp, row
from ctrlgen.model.inverse import NEWTON_STEPS, Inverse
from ctrlgen.model.limits_in_reach import drive_in_reach, state_in_reach
from ctrlgen.model.lost_state import Groups, is_beyond, plausible_sums
from ctrlgen.model.model import Limit, Model, Signal
from ctrlgen.model.named_inverse import NamedInverses, given_inverses, named_inverses
from ctrlgen.model.nearest_displacement import coupling, nearest_displacement
from ctrlgen.model.run_time import choices, with_constants

SLACK = 1e-9  # of a signal's typical size: an excess below this is clipped without being reported
# The memory of an effect does not scale with the displacement, so its share of the excess is removed over several rounds.
COMPOSITE_ROUNDS = 8

SECANT_STEPS = 3  # of the line search toward a target that the drives cannot reach in one sample
SECANT_FRACTION = 1 - 2**-8  # of the secant estimate is taken, because the drive is not linear along the line

OF_SLACK = frozenset({  # what a controller works out that depends on its slack
    "slack", "slacks", "state_can_be_limited", "_own_state_can_be_limited", "drive_can_be_limited", "_own_drive_can_be_limited",
    "variants",
})  # fmt: skip


@dataclass(frozen=True)
class Controller:
    """One device, one followed signal, one sample time (None: equilibria only)."""

    model: Model
    follow: str
    sample_time: float | None
    slack: float = SLACK

    @cached_property
    def static(self) -> Inverse:
        """Kernels for equilibria."""
        return inverse_of(self.nominal, self.follow, None)

    @property
    def _step_time(self) -> float | None:
        """The sample time of the kernels for the next sample; None where there are none."""
        return self.sample_time

    @cached_property
    def moving(self) -> Inverse | None:
        """Kernels for the next sample; None where there is no sample time."""
        return None if self._step_time is None else inverse_of(self.nominal, self.follow, self._step_time)

    @cached_property
    def named(self) -> NamedInverses:
        """The same kernels with their numbers as formulas of the device's parameters."""
        return named_inverses(self.model.device, self.follow, self._step_time)

    @cached_property
    def given(self) -> NamedInverses | None:
        """The same kernels in terms of the run-time constants; None for a device without."""
        device = self.model.device
        if not device.given_at_start:
            return None
        found = given_inverses(device, self.follow, self._step_time)
        return replace(found, model=found.model.limited_as(self.model))

    def at(self, values: dict[str, float]) -> Controller:
        """The controller of the device with its run-time constants at `values` [SI, by path]; the others as the file has them. What is
        reserved of limits is the same."""
        model = build_model(with_constants(self.model.device, values)).limited_as(self.model)
        return type(self)(model, self.follow, self.sample_time, self.slack)

    def with_slack(self, slack: float) -> Controller:
        """The same controller with another slack; the kernels, and what else does not depend on it, are this one's."""
        _ = self.static, self.moving  # worked out now, for both
        other = replace(self, slack=slack)
        other.__dict__.update({name: value for name, value in self.__dict__.items() if name not in OF_SLACK})
        other.__dict__["variants"] = tuple(variant.with_slack(slack) for variant in self.variants)
        return other

    @cached_property
    def variants(self) -> tuple[Controller, ...]:
        """The controllers of devices with other run-time constants, within their ranges (`ctrlgen.model.run_time`): decisions that are
        taken before the C runs hold for all of them."""
        return tuple(self.at(values) for values in choices(self.model.device.given_at_start))

    @cached_property
    def newton_steps(self) -> int:
        """Steps to the displacement that balances the forces: one where the balance is linear in it."""
        return max(c._own_newton_steps for c in (self, *self.variants))

    @cached_property
    def _own_newton_steps(self) -> int:
        m = self.nominal
        return NEWTON_STEPS if ca.depends_on(ca.jacobian(m.balance, m.z), m.z) else 1

    @cached_property
    def nominal(self) -> Model:
        """The model with every free parameter at its nominal value."""
        return build_model(self.model.device) if self.model.p.numel() else self.model

    @cached_property
    def guarded_limits(self) -> tuple[Limit, ...]:
        """Composite limits that can be broken by displacements inside their range."""
        limits = [limit for limit in self.nominal.composite_limits() if limit.upper is not None]
        x = self.nominal.x
        return tuple(
            limit for limit in limits if ca.depends_on(limit.expr, x) or worst_in_range(self.nominal, limit) > 1
        )

    @cached_property
    def composite_shares(self) -> ca.Function:
        """(x, z, wanted) -> the square of each guarded limit's value over its bound at displacement `wanted`; above 1 it is broken."""
        m = self.nominal
        wanted = ca.SX.sym("wanted", m.z.numel())
        x_then = ca.vertcat(m.x[: m.n_states], (self.moving or self.static).memory(m.x, m.z, wanted))
        squares = [
            ca.substitute(limit.expr, ca.vertcat(m.x, m.z), ca.vertcat(x_then, wanted)) ** 2 * (1 / limit.upper**2)
            for limit in self.guarded_limits if limit.upper
        ]  # fmt: skip
        names = ["x", "z", "wanted"]
        return ca.Function(
            "composite_shares",
            [m.x, m.z, wanted],
            [ca.vertcat(ca.SX(0, 1), *squares)],
            names,
            ["shares"],
            {"cse": True},
        )

    @cached_property
    def composite_ratio(self) -> ca.Function:
        """(x, z, wanted) -> the largest ratio of a guarded limit's value to its bound at displacement `wanted`; above 1 it is broken."""
        arguments = [ca.SX.sym(name, *self.composite_shares.size_in(name)) for name in self.composite_shares.name_in()]
        shares = self.composite_shares(*arguments)
        worst = ca.sqrt(ca.mmax(shares)) if shares.numel() else ca.SX(0)  # one root at the end
        return ca.Function(
            "composite_ratio", arguments, [worst], self.composite_shares.name_in(), ["ratio"], {"cse": True}
        )

    @property
    def composite_rounds(self) -> int:
        """How often a displacement is scaled toward home: once where the limited quantities are proportional to it."""
        m = self.nominal
        bent = ca.depends_on(ca.jacobian(m.signals["displacement"].expr, m.z), m.z)
        return COMPOSITE_ROUNDS if bent or m.x.numel() > m.n_states else 1

    @cached_property
    def nearest_slopes(self) -> np.ndarray | None:
        """(n, n) of `ctrlgen.model.nearest_displacement`; None where one displacement moves one channel."""
        return coupling(self.nominal, self.follow)

    @cached_property
    def nearest(self) -> ca.Function:
        """beyond -> the displacement in range whose followed signal is nearest to that of the displacement `beyond`."""
        return nearest_displacement(self.nominal.z_bounds, self.nearest_slopes)

    @cached_property
    def composite_bound(self) -> ca.Function | None:
        """wanted -> a cheap upper bound of `composite_ratio` (`ctrlgen.model.composite_bound`); None where there is none."""
        m = self.nominal
        if not self.guarded_limits or m.x.numel() > m.n_states:
            return None
        return composite_bound(m, self.follow, self._composite_ratios)

    def _composite_ratios(self, displacements: np.ndarray) -> np.ndarray:
        """`composite_ratio` at each column of `displacements`, with no memory of effects."""
        m, count = self.nominal, displacements.shape[1]
        cold = np.tile(m.rest[:, None], (1, count))
        return self.composite_ratio.map(count)(cold, 0 * displacements, displacements).full().ravel()

    @cached_property
    def state_can_be_limited(self) -> bool:
        """Whether a displacement in range can need an actuator state beyond its limits, by interval arithmetic."""
        return any(c._own_state_can_be_limited for c in (self, *self.variants))

    @cached_property
    def _own_state_can_be_limited(self) -> bool:
        kernels = self.static, self.moving or self.static
        return state_in_reach(self.nominal, kernels, self._own_slacks(self.slack)[1])

    @cached_property
    def drive_can_be_limited(self) -> tuple[bool, bool]:
        """Whether a displacement in range can need a drive beyond its limits to settle there, or to step there, by interval arithmetic
        over every state. An actuator that never does for an equilibrium needs no line search to settle."""
        settle, step = zip(*(c._own_drive_can_be_limited for c in (self, *self.variants)), strict=True)
        return any(settle), any(step)

    @cached_property
    def _own_drive_can_be_limited(self) -> tuple[bool, bool]:
        slack = self._own_slacks(self.slack)[2]
        settle, step = (drive_in_reach(self.nominal, k, slack) for k in (self.static, self.moving or self.static))
        return settle, step

    @property
    def target(self) -> Signal:
        """What a target holds."""
        return self.model.signals[self.follow]

    @cached_property
    def input_limits(self) -> np.ndarray:
        """(channels,) largest |target| that is accepted as a command: 1e5 typical sizes, far outside any range."""
        return 1e5 * np.array(self.target.scale)

    def drive_rounding(
        self,
        before: tuple[np.ndarray, np.ndarray],
        target: np.ndarray,
        step: ControllerStep,
        settle: bool,
        share: float,
    ) -> float:
        """By how much the drives of a `step` from the state `before` to `target` change where displacement and actuator state do
        by this `share` of themselves."""
        kernel = (self.static if settle or self.moving is None else self.moving).drive
        reached = (step.displacement, step.actuator_state)
        off = kernel(*before, *(value * (1 + share) for value in reached)) - kernel(*before, *reached)
        return float(np.max(np.abs(off.full())))

    @cached_property
    def safe_drive(self) -> np.ndarray:
        """(n_u,) the drive without a usable target: zero, or the admissible value nearest to it. A heater that is off cools passively."""
        return np.clip(0.0, *self.nominal.u_bounds)

    @cached_property
    def slacks(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Excess over a limit that is clipped without report, for displacement, actuator state and drive.

        That of the drive is what the other two change it by.
        """
        return self.slacks_of(self.slack)

    def slacks_of(self, slack: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """`slacks` for this share of a signal's typical size."""
        z_slack, state_slack, u_slacks = zip(*(c._own_slacks(slack) for c in (self, *self.variants)), strict=True)
        return z_slack[0], state_slack[0], np.max(u_slacks, axis=0)

    def _own_slacks(self, share: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        m, n = self.nominal, self.nominal.n_states
        z_slack, state_slack = share * m.z_scale, share * m.x_scale[:n]
        x, z = self.rest()
        kernel = (self.moving or self.static).drive
        drives = [row(kernel(x, z, z + side * z_slack, x[:n] + side * state_slack)) for side in (-1, 0, 1)]
        return z_slack, state_slack, np.max(np.abs(np.diff(drives, axis=0)), axis=0)

    @cached_property
    def plausible(self) -> Groups:
        """What a state is judged by, see `plausible_sums`."""
        own, *others = (plausible_sums(c.nominal) for c in (self, *self.variants))
        wider = [{those: most for those, most in sums} for sums in others]
        return tuple((those, max(most, *(w.get(those, most) for w in wider), most)) for those, most in own)

    @cached_property
    def examined_first(self) -> tuple[bool, bool]:
        """Whether the state is examined before it is used, to settle and to step: where the displacement of a target depends on it, or
        effects remember. Else it is examined where a limit is met: till then one that is lost would show in the drives, or none of its
        numbers enters the answer and all are written anew."""
        settle, step = zip(*(c._own_examined_first for c in (self, *self.variants)), strict=True)
        return any(settle), any(step)

    @cached_property
    def _own_examined_first(self) -> tuple[bool, bool]:
        m = self.nominal
        kernels = [k.displacement for k in (self.static, self.moving or self.static)]
        targets = [ca.SX.sym("target", k.size1_in("target")) for k in kernels]
        settle, step = (
            m.x.numel() > m.n_states or ca.depends_on(k(m.x, m.z, target), ca.vertcat(m.x, m.z))
            for k, target in zip(kernels, targets, strict=True)
        )
        return settle, step

    def is_lost(self, x: np.ndarray, z: np.ndarray) -> bool:
        """Whether the state (x, z) cannot be one that the controller left."""
        return is_beyond(self.plausible, x, z)

    def rest(self) -> tuple[np.ndarray, np.ndarray]:
        """State (x, z) of a device at rest at ambient temperature."""
        return self.model.rest.copy(), np.zeros(len(self.model.axes))

    def step(self, state: tuple[np.ndarray, np.ndarray], target: np.ndarray, *, settle: bool = False) -> ControllerStep:
        """Drives that bring the followed signal to `target` (channels,) [SI] at the next sample, from `state` (x, z).

        With `settle`: the equilibrium at `target`, and its state. Every limit is kept; `ControllerStatus` says which ones acted.
        A state that is found lost (`is_lost`, `examined_first`) is answered with the safe drive, and is NaN from then on, which is
        answered so too; go on from `rest` once the device is there.
        A target that the drives cannot reach in one sample is approached along the straight line of displacements, on
        which convex limits hold.
        """
        m, (x, z) = self.nominal, state
        first = self.examined_first[not settle and self.moving is not None]
        if np.all(np.isnan([*x, *z])) or (first and self.is_lost(x, z)):
            return self._without_state()
        k = self.static if settle or self.moving is None else self.moving
        n, static = m.n_states, k is self.static
        z_slack, _, u_slack = self.slacks
        wanted, status = row(k.displacement(x, z, target)), ControllerStatus(0)
        if not np.all((wanted >= m.z_bounds[0]) & (wanted <= m.z_bounds[1])):  # a NaN is not inside either
            usable = np.all(np.abs(target) <= self.input_limits[: len(target)])
            if not usable:
                lost = not first and self.is_lost(x, z)
                return self._without_state() if lost else self._without_target(k, x, z)
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
        drive = row(k.drive(x, z, wanted, state_wanted))
        outside = not np.all((drive >= m.u_bounds[0]) & (drive <= m.u_bounds[1]))
        if outside and not first and self.is_lost(x, z):
            return self._without_state()
        u, limited = clamp(drive, *m.u_bounds, u_slack)
        if limited:
            wanted, state_wanted, drive = self._line_search(k, x, z, np.zeros_like(z) if static else z, wanted, drive)
            u, limited = clamp(drive, *m.u_bounds, u_slack)
            status |= ControllerStatus.DRIVE
        if not limited and len(x) == n:  # only actuators have memory: their state is what the drive was computed for
            return ControllerStep(status, wanted, state_wanted, u, (state_wanted, wanted))
        x_next = row(k.advance(x, wanted if static else z, u))
        z_next = row(k.settle(x_next, wanted, u)) if limited else wanted
        return ControllerStep(status, z_next, state_wanted, u, (x_next, z_next))

    def _without_state(self) -> ControllerStep:
        """The safe drive, where nothing is known of the device; a device that is left alone comes to rest."""
        rest, home = self.rest()
        lost = (np.full_like(rest, np.nan), np.full_like(home, np.nan))
        return ControllerStep(ControllerStatus.LOST, home, rest[: self.nominal.n_states], self.safe_drive, lost)

    def _without_target(self, k: Inverse, x: np.ndarray, z: np.ndarray) -> ControllerStep:
        """The safe drive, and what the device does under it for one sample."""
        x_next = row(k.advance(x, z, self.safe_drive))
        z_next = row(k.settle(x_next, z, self.safe_drive))
        return ControllerStep(ControllerStatus.INPUT, z, x[: self.nominal.n_states], self.safe_drive, (x_next, z_next))

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
        self, k: Inverse, x: np.ndarray, z: np.ndarray, origin: np.ndarray, target: np.ndarray, at_target: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(displacement, actuator state, drive) on the line from `origin` to `target`, as far as admissible drives were found.

        `SECANT_STEPS` secants of the drive that is first at its limit, each shortened to `SECANT_FRACTION`; the origin
        itself where its drives are inadmissible. `at_target`: the drives at `target`.
        """
        (low, high), slack = self.nominal.u_bounds, self.slacks[2]

        def answer(displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            state, _ = self._limited_state(k, x, z, displacement)
            return state, row(k.drive(x, z, displacement, state))

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
