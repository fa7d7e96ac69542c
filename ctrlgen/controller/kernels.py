"""What a feedforward controller computes with: its kernels, what of its limits can be met, and what a state is judged by.
`ctrlgen.controller.feedforward` decides with them, `ctrlgen.firmware.online.online` prints them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import casadi as ca
import numpy as np

from ctrlgen.controller.composite_bound import CompositeBound, composite_bound, worst_in_range
from ctrlgen.controller.contraction import Contraction, Stepped, contraction
from ctrlgen.controller.controller_step import answer
from ctrlgen.controller.few_coordinates import FewCoordinates, few_coordinates
from ctrlgen.controller.limit_reach import Slacks, drive_beyond, state_beyond
from ctrlgen.controller.lost_state import plausible_magnitudes
from ctrlgen.controller.named_inverse import NamedInverses, given_inverses, named_inverses
from ctrlgen.controller.nearest_displacement import coupling, nearest_displacement
from ctrlgen.controller.null_motion import NullMotion, null_motion
from ctrlgen.controller.own_drives import has_own_drives
from ctrlgen.controller.quick_state import QuickReach, QuickState, quick_reach, quick_state
from ctrlgen.controller.ringing import Ringing
from ctrlgen.controller.run_time_choices import choices, with_constants
from ctrlgen.devices import Limit, Signal
from ctrlgen.model.allocation import inverse_of
from ctrlgen.model.assembly import build_model
from ctrlgen.model.inverse import NEWTON_STEPS, Inverse, invert
from ctrlgen.model.model import Model
from ctrlgen.numerics.newton import steps_needed

# The memory of an effect does not scale with the displacement, so its share of the excess is removed over several rounds.
COMPOSITE_ROUNDS = 8


@dataclass(frozen=True)
class ControllerKernels:
    """The kernels of one device, one followed signal, one sample time (None: equilibria only), each worked out when first asked for.

    `times`: shortest and longest sample time [s] where it may vary; what is decided before the C runs holds for all between.
    """

    model: Model
    follow: str
    sample_time: float | None
    times: tuple[float, float] | None = None

    @cached_property
    def static(self) -> Inverse:
        """The kernels of the inverse for equilibria."""
        return inverse_of(self.nominal, self.follow, None)

    @property
    def _step_time(self) -> float | None:
        """The sample time of the kernels for the next sample; None where there are none."""
        return self.sample_time

    @cached_property
    def moving(self) -> Inverse | None:
        """Kernels for the next sample; None where there is no sample time."""
        if self._step_time is None:
            return None
        return (
            self.varied.at(self._step_time) if self.varied else inverse_of(self.nominal, self.follow, self._step_time)
        )

    @cached_property
    def varied(self) -> Inverse | None:
        """Kernels for the next sample with its time as their last argument; None where it does not vary."""
        if self.times is None:
            return None
        return invert(self.nominal, self.follow, sum(self.times) / 2, longest=self.times[1])

    def over(self, sample_time: float) -> Self:
        """The kernels over another `sample_time` [s] within `times`."""
        return replace(self, sample_time=sample_time)

    @cached_property
    def quick(self) -> QuickState | None:
        """The polynomials that stand for the state's kernels in single precision, the same to settle and to step; None where these are
        used themselves. They have the same values at the ends of the range and lie between them within it."""
        device, m = self.model.device, self.nominal
        every = self.modes
        if device.given_at_start or not m.n_states or m.redundant:
            return None
        found = [quick_state(k.state, *m.z_bounds) for k in every]
        texts = {str(k.state(*(ca.SX.sym(name, *k.state.size_in(name)) for name in k.state.name_in()))) for k in every}
        return found[0] if len(texts) == 1 else None

    def quick_reach(self, room: np.ndarray) -> QuickReach | None:
        """The polynomials that stand for the displacement which balances states, in single precision, where one sample can lead less far
        than to the target; None where there are none, or drives (n_u,) would be off by more than `room`."""
        if self.quick is None or not self.own_drives:
            return None
        found = quick_reach(self.static.state, *self.nominal.z_bounds)
        return None if found is None or np.any(self._drive_off(found.state_off) > room) else found

    def _drive_off(self, state_off: np.ndarray) -> np.ndarray:
        """(n_u,) by how much drives that are linear in the actuator states change where these do by `state_off`, at most."""
        changes = []
        for k in self.modes:
            x, z, wanted, state = (ca.SX.sym(name, *k.drive.size_in(name)) for name in k.drive.name_in()[:4])
            slope = ca.evalf(ca.densify(ca.jacobian(k.drive(x, z, wanted, state), state))).full()
            changes.append(np.abs(slope) @ state_off)
        return np.asarray(np.max(changes, axis=0))

    @cached_property
    def own_drives(self) -> bool:
        """Whether each drive leads one displacement of its own (`ctrlgen.controller.own_drives`), to settle and to step."""
        every = (self, *self.variants)
        return self.times is None and all(has_own_drives(k.nominal, mode) for k in every for mode in k.modes)

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
        inverses = given_inverses(device, self.follow, self._step_time)
        return replace(inverses, model=inverses.model.limited_as(self.model))

    def at(self, values: dict[str, float]) -> Self:
        """The kernels of the device with its run-time constants at `values` [SI, by path]; the others as the file has them. What is
        reserved of limits is the same."""
        model = build_model(with_constants(self.model.device, values)).limited_as(self.model)
        return type(self)(model, self.follow, self.sample_time)

    @cached_property
    def variants(self) -> tuple[Self, ...]:
        """The kernels of devices with other run-time constants, within their ranges
        (`ctrlgen.controller.run_time_choices`), or over the shortest and the longest sample time: decisions that are taken before
        the C runs hold for all of them."""
        if self.times is not None:  # not one of its own, which would have variants again
            return tuple(replace(self, sample_time=h, times=None) for h in self.times)
        return tuple(self.at(values) for values in choices(self.model.device.given_at_start))

    @cached_property
    def newton_steps(self) -> int:
        """Steps to the displacement that balances the forces: one where the balance is linear in it."""
        return max(k._own_newton_steps for k in (self, *self.variants))

    @cached_property
    def _own_newton_steps(self) -> int:
        m = self.nominal
        return steps_needed(m.balance, m.z, NEWTON_STEPS)

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
        shares = self._shares(self.moving or self.static)
        if (few := self.few_shares) is None:
            return shares
        arguments = [ca.SX.sym(name, *shares.size_in(name)) for name in shares.name_in()]
        found = few.function(few.coordinates(arguments[-1]))
        return ca.Function("composite_shares", arguments, [found], shares.name_in(), ["shares"], {"cse": True})

    @cached_property
    def varied_shares(self) -> ca.Function:
        """`composite_shares` with the time of a sample as their last argument, where it varies."""
        return self._shares(self.varied) if self.varied else self.composite_shares

    @cached_property
    def few_shares(self) -> FewCoordinates | None:
        """`composite_shares` in fewer coordinates than there are displacements; None where there are none."""
        if not self.guarded_limits or self.times is not None:
            return None
        return few_coordinates(self._shares(self.moving or self.static), *self.nominal.z_bounds)

    def _shares(self, k: Inverse) -> ca.Function:
        m = self.nominal
        wanted = ca.SX.sym("wanted", m.z.numel())
        given = {"x": m.x, "z": m.z, "wanted": wanted} | ({"h": ca.SX.sym("h")} if "h" in k.memory.name_in() else {})
        x_then = ca.vertcat(m.x[: m.n_states, :], k.memory(*given.values()))
        squares = [
            ca.substitute(limit.expr, ca.vertcat(m.x, m.z), ca.vertcat(x_then, wanted)) ** 2 * (1 / limit.upper**2)
            for limit in self.guarded_limits
            if limit.upper
        ]
        return ca.Function(
            "composite_shares",
            list(given.values()),
            [ca.vertcat(ca.SX(0, 1), *squares)],
            list(given),
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

    @cached_property
    def composite_rounds(self) -> int:
        """How often a displacement is scaled toward home: once where the limited quantities are proportional to it."""
        m = self.nominal
        bent = ca.depends_on(ca.jacobian(m.signals["displacement"].expr, m.z), m.z)
        return COMPOSITE_ROUNDS if bent or m.x.numel() > m.n_states else 1

    @cached_property
    def nearest_slopes(self) -> np.ndarray | None:
        """(n, n) of `ctrlgen.controller.nearest_displacement`; None where one displacement moves one channel."""
        return coupling(self.nominal, self.follow)

    @cached_property
    def nearest(self) -> ca.Function:
        """beyond -> the displacement in range whose followed signal is nearest to that of the displacement `beyond`."""
        return nearest_displacement(self.nominal.z_bounds, self.nearest_slopes)

    @cached_property
    def composite_bound(self) -> ca.Function | None:
        """wanted -> a cheap upper bound of `composite_ratio` (`ctrlgen.controller.composite_bound`); None where there is none."""
        return None if self.bound is None else self.bound.of_displacement

    @cached_property
    def target_bound(self) -> ca.Function | None:
        """target -> the same bound at the displacement of a target that leads into the range; None where it is no cheaper."""
        if self.bound is None or (directions := self.target_directions) is None:
            return None
        reach = np.abs(np.linalg.pinv(directions)) @ np.max(np.abs(self.nominal.z_bounds), axis=0)
        bound = self.bound.of_target(directions, reach)
        return bound if bound.n_instructions() < self.bound.of_displacement.n_instructions() else None

    @cached_property
    def bound(self) -> CompositeBound | None:
        """The cheap bound of guarded limits; None where there are none, or no bound."""
        m = self.nominal
        if not self.guarded_limits or m.x.numel() > m.n_states:
            return None
        return composite_bound(m, self.follow, self._composite_ratios)

    @cached_property
    def target_directions(self) -> np.ndarray | None:
        """(n, channels) M where every displacement is z = M target, whatever the state, and a target that leads into the range is one
        that is accepted, also where it is rounded; None elsewhere."""
        found = [_matrix_of(k.displacement) for k in self.modes]
        M = found[0]
        if self.given is not None or M is None or found[-1] is None or not np.array_equal(M, found[-1]):
            return None
        if M.shape[0] != M.shape[1] or np.linalg.matrix_rank(M) < len(M):
            return None
        # |fl(M t) - M t| <= c |t| with t in units of its limits, and |M t| >= s |t|: in range, |t| (s - c) is at most the range.
        limits, size = self.input_limits[: len(M)], np.max(np.abs(self.nominal.z_bounds), axis=0)
        scaled = M * limits / size[:, None]
        roundings = 2 * len(M) * np.finfo(np.float32).eps * np.linalg.norm(np.abs(scaled))
        least = np.linalg.svd(scaled, compute_uv=False)[-1]
        return M if least - roundings > np.sqrt(len(M)) else None

    def _composite_ratios(self, displacements: np.ndarray) -> np.ndarray:
        """`composite_ratio` at each column of `displacements`, with no memory of effects."""
        m, count = self.nominal, displacements.shape[1]
        cold = np.tile(m.rest[:, None], (1, count))
        return self.composite_ratio.map(count)(cold, 0 * displacements, displacements).full().ravel()

    def state_can_be_limited(self, share: float) -> bool:
        """Whether a displacement in range can need an actuator state beyond its limits (`ctrlgen.controller.limit_reach`), by more than
        the slacks of this share."""
        if self.rated:
            return bool(np.any(np.isfinite([bound[: self.nominal.n_states] for bound in self.nominal.x_bounds])))
        return any(state_beyond(k.nominal, *k.modes, k.own_slacks(share)) for k in (self, *self.variants))

    def drive_can_be_limited(self, share: float) -> tuple[bool, bool]:
        """Whether a displacement in range can need a drive beyond its limits to settle there, or to step there, from any state
        (`ctrlgen.controller.limit_reach`). An actuator that never does for an equilibrium needs no line search to settle."""
        if self.rated:
            return True, True
        reached = [drive_beyond(k.nominal, *k.modes, k.own_slacks(share)) for k in (self, *self.variants)]
        return any(settle for settle, _ in reached), any(step for _, step in reached)

    @property
    def modes(self) -> tuple[Inverse, Inverse]:
        """The inverse to settle and the one to step."""
        return self.static, self.moving or self.static

    @property
    def target(self) -> Signal:
        """The signal whose channels a target gives."""
        return self.model.signals[self.follow]

    @cached_property
    def input_limits(self) -> np.ndarray:
        """(channels,) largest |target| that is accepted as a command: 1e5 typical sizes, far outside any range."""
        return 1e5 * np.array(self.target.scale)

    @cached_property
    def safe_drive(self) -> np.ndarray:
        """(n_u,) the drive without a usable target: zero, or the admissible value nearest to it. A heater that is off cools passively."""
        return np.clip(0.0, *self.nominal.u_bounds)

    def slacks(self, share: float) -> Slacks:
        """Excess over a limit that is clipped without report: for displacement and actuator state this share of a typical size, for the
        drive what the other two change it by."""
        z_slack, state_slack, u_slacks = zip(*(k.own_slacks(share) for k in (self, *self.variants)), strict=True)
        return z_slack[0], state_slack[0], np.max(u_slacks, axis=0)

    def own_slacks(self, share: float) -> Slacks:
        """The slacks at the constants of the device file alone."""
        m, n = self.nominal, self.nominal.n_states
        z_slack, state_slack = share * m.z_scale, share * m.x_scale[:n]
        x, z = self.model.rest, np.zeros(len(self.model.axes))
        kernel = (self.moving or self.static).drive
        drives = [answer(kernel, x, z, z + side * z_slack, x[:n] + side * state_slack) for side in (-1, 0, 1)]
        return z_slack, state_slack, np.max(np.abs(np.diff(drives, axis=0)), axis=0)

    def plausible(self, with_drive: bool) -> np.ndarray:
        """What a state is judged by, which holds the last drive or not, see `plausible_magnitudes`."""
        return np.max([plausible_magnitudes(k.nominal, with_drive) for k in (self, *self.variants)], axis=0)

    @cached_property
    def examined_first(self) -> tuple[bool, bool]:
        """Whether the state is examined before it is used, to settle and to step: where the displacement of a target depends on it, or
        effects remember. Else it is examined where a limit is met: till then one that is lost would show in the drives, or none of its
        numbers enters the answer and all are written anew."""
        settle, step = zip(*(k._own_examined_first for k in (self, *self.variants)), strict=True)
        return any(settle), any(step)

    @cached_property
    def _own_examined_first(self) -> tuple[bool, bool]:
        m = self.nominal
        kernels = [k.displacement for k in self.modes]
        targets = [ca.SX.sym("target", k.size1_in("target")) for k in kernels]
        settle, step = (
            m.x.numel() > m.n_states or ca.depends_on(k(m.x, m.z, target), ca.vertcat(m.x, m.z))
            for k, target in zip(kernels, targets, strict=True)
        )
        return settle, step

    @cached_property
    def redundancy(self) -> NullMotion | None:
        """What keeps more drives than axes within their limits; None where there are as many."""
        return null_motion(self.nominal)

    @cached_property
    def contraction(self) -> Contraction | None:
        """How fast a wrong belief of the states dies out (`ctrlgen.controller.contraction`); None for a device without states, and where
        no sample is stepped from the one before."""
        if self.sample_time is None or not self.nominal.x.numel():
            return None
        every = [Stepped(k.nominal, k.static, k.moving) for k in (self, *self.variants) if k.moving is not None]
        return contraction(every, self.times[0] if self.times else self.sample_time) if every else None

    @property
    def ringing(self) -> Ringing | None:
        """How fast the device stops ringing (`ctrlgen.controller.ringing`); None without inertia."""
        return None

    @property
    def can_be_observed(self) -> bool:
        """Whether a measured state tells how far the device is off its motion: not of modes that are led."""
        return self.ringing is not None and len(self.ringing.weights) == len(self.nominal.axes) + self.nominal.x.numel()

    @property
    def tells_of_itself(self) -> bool:
        """Whether its status says that what is believed of the device may be wrong."""
        return self.contraction is not None or self.ringing is not None

    @property
    def rated(self) -> bool:
        """Whether drives may change only so fast, over a sample time."""
        return self.sample_time is not None and bool(self.nominal.rate_limits)

    @property
    def limits_can_be_passed(self) -> bool:
        """Whether a drive that may not turn back faster can lead the device beyond a limit: where actuators or effects remember, or the
        forces are not linear in the displacement, so that between two admissible drives there may be one that is not."""
        return self.rated and (self.nominal.x.numel() > 0 or self.newton_steps > 1)


def _matrix_of(displacement: ca.Function) -> np.ndarray | None:
    """M where a displacement is M target; None where it is not."""
    x, z, target = (ca.SX.sym(name, *displacement.size_in(name)) for name in ("x", "z", "target"))
    slope = ca.jacobian(displacement(x, z, target), target)
    if ca.symvar(slope) or not ca.simplify(displacement(x, z, 0 * target)).is_zero():
        return None
    return ca.evalf(slope).full()
