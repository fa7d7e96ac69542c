"""The feedforward controller of a device with inertia: a target with its derivatives by time -> drives, in a fixed number of operations.

The drive is that of the inverse dynamics (`ctrlgen.model.inverse_dynamics`); held from one sample to the next it fits a target at the
middle between them. A motion that would break a limit on displacement, actuator state or an expression of them is answered with the
equilibrium at its position, which keeps every limit (`Controller`); a drive beyond its own limit is clipped.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import casadi as ca
import numpy as np

from ctrlgen.controller.controller_step import ControllerStatus, ControllerStep, State, answer
from ctrlgen.controller.feedforward import Controller, Rounding
from ctrlgen.controller.kernels import ControllerKernels
from ctrlgen.controller.ringing import Ringing, followed, ringing
from ctrlgen.controller.sample_times import check_times
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.devices import Signal
from ctrlgen.model.inverse_dynamics import InverseDynamics, inverse_dynamics
from ctrlgen.model.led_modes import amplitudes, led, structure_to_lead
from ctrlgen.model.model import Model
from ctrlgen.model.state_vector import TYPICAL_RATE


@dataclass(frozen=True)
class MotionKernels(ControllerKernels):
    """The kernels of one device with inertia. A target is (channels * (order + 1),): first the followed signal, then its first derivative
    by time, and so on; where it `leads_modes` of the bodies, two more (`ctrlgen.model.led_modes`). Raises InputError for a device with
    states that a target does not determine, such as memories of effects, and where there are no modes to lead."""

    leads_modes: bool = False

    def __post_init__(self) -> None:
        if self.dynamics.internal:
            kinds = ", ".join(sorted({e.kind for e in self.model.device.effect if e.states})) or "the device's own"
            what = f"has states that the motion does not determine ({kinds}): C cannot compute its drive online; solve the path instead"
            raise InputError(self.model.name, [Fault("device", what)])

    @cached_property
    def dynamics(self) -> InverseDynamics:
        """The inverse dynamics of the nominal model, from the followed signal."""
        own = inverse_dynamics(self.nominal, self.follow)
        return own.after(led(self.nominal, self.follow, own.order)) if self.leads_modes else own

    @property
    def _step_time(self) -> None:
        """None: a motion takes its derivatives, and not the sample before."""
        return

    @cached_property
    def target(self) -> Signal:
        """The followed signal and its derivatives by time."""
        s, orders = self.model.signals[self.follow], range(self.dynamics.order + 1)
        names = tuple(c if not k else f"d{k}_{c}" for k in orders for c in s.channels)
        units = tuple(u if not k else f"{u}/s" if k == 1 else f"{u}/s^{k}" for k in orders for u in s.units)
        sizes = tuple(size * TYPICAL_RATE**k for k in orders for size in s.scale)
        return Signal(
            s.name, f"{s.label} and its derivatives by time", names, units, s.column, ca.SX.sym("t", len(names)), sizes
        )

    @cached_property
    def motion(self) -> dict[str, ca.Function]:
        """target -> "displacement" z, "state" x (n_x,) and "drive" u at that moment."""
        target = ca.SX.sym("target", len(self.target.channels))
        x, z, u = self.dynamics.kernel(ca.reshape(target, -1, self.dynamics.order + 1))
        parts = {"displacement": z, "state": x, "drive": u}
        return {
            name: ca.Function(name, [target], [value], ["target"], ["result"], {"cse": True})
            for name, value in parts.items()
        }

    @cached_property
    def ringing(self) -> Ringing | None:
        """How fast what sets the device ringing dies out; None where no time passes between targets."""
        if self.sample_time is None:
            return None
        structure = structure_to_lead(self.nominal, self.follow) if self.leads_modes else None
        return ringing(self.nominal, self.sample_time, structure)

    @cached_property
    def joins(self) -> ca.Function:
        """target -> (2 n_y,) where the motion comes from, half a sample before, then where it leads, half a sample after, both weighted:
        of a motion that does not break, the last target leads to where this one comes from."""
        bounds, motion = self.ringing, self.motion
        assert bounds is not None and self.sample_time is not None
        eta = amplitudes(structure_to_lead(self.nominal, self.follow)) if self.leads_modes else []
        along = followed(self.nominal, motion, len(self.model.signals[self.follow].channels), eta)
        target = ca.SX.sym("target", len(self.target.channels))
        y, rate = along(target)
        at, by = bounds.weights * y, self.sample_time / 2 * bounds.weights * rate
        return ca.Function("joins", [target], [ca.vertcat(at - by, at + by)], ["target"], ["result"], {"cse": True})

    def state_can_be_limited(self, share: float) -> bool:
        """Whether actuator states have limits: a motion can need any state."""
        n = self.nominal.n_states
        return bool(np.any(np.isfinite([bound[:n] for bound in self.nominal.x_bounds])))

    def sensitivity(self, target: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The largest changes of displacement, state and drive where each number of the target, and of the displacements and their
        derivatives by time that follow from it, changes by as much as it is."""
        slopes = [slope(target).full() for slope in self._slopes]
        parts = np.split(np.abs(target), self.dynamics.order + 1)
        per_target = slopes[0][:, : len(parts[0])]
        d_parts = [np.abs(per_target) @ part for part in parts]
        moved = np.linalg.inv(per_target) if per_target.shape[0] == per_target.shape[1] else np.linalg.pinv(per_target)
        blocks = [np.split(slope, self.dynamics.order + 1, axis=1) for slope in slopes[1:]]
        of_state, of_drive = (
            np.sum([np.abs(b @ moved) @ d for b, d in zip(of, d_parts, strict=True)], axis=0) for of in blocks
        )
        return d_parts[0], of_state[: self.nominal.n_states], of_drive

    @cached_property
    def _slopes(self) -> list[ca.Function]:
        """target -> derivatives of displacement, state and drive by the target."""
        target = ca.SX.sym("target", len(self.target.channels))
        names = ("displacement", "state", "drive")
        return [ca.Function(name, [target], [ca.jacobian(self.motion[name](target), target)]) for name in names]


@dataclass(frozen=True)
class MotionController(Controller):
    """The limiter around the kernels of one device with inertia."""

    kernels: MotionKernels

    def step(self, state: State, target: np.ndarray, *, settle: bool = False) -> ControllerStep:
        """Drives for the motion that `target` says, or with `settle` for the equilibrium at its position. `state` (as `rest`) is kept
        where the target is no command; else that of the motion follows. A state that is lost is answered with the safe drive."""
        kernels, m = self.kernels, self.kernels.nominal
        usable = bool(np.all(np.abs(target) <= kernels.input_limits))
        if (not settle or not usable) and self.is_lost(*state):
            return self._without_state()
        if not usable:
            return self._without_target(kernels.static, state)
        position = target[: len(kernels.model.signals[kernels.follow].channels)]
        if settle:
            return super().step(state, position, settle=True)
        z, x, u = (answer(kernels.motion[name], target) for name in ("displacement", "state", "drive"))
        if broken := self._broken(x, z):
            held = super().step(state, position, settle=True)
            return ControllerStep(held.status | broken, held.displacement, held.actuator_state, held.drive, held.state)
        u, (low, high) = self.chosen(u, state), m.u_bounds
        slack = self.slacks[2]
        status = ControllerStatus(0) if np.all((u >= low - slack) & (u <= high + slack)) else ControllerStatus.DRIVE
        u = np.clip(u, low, high)
        if self.rate is not None:
            u, _, _, too_fast = self._toward(self.rate, state[2], u)
            u = np.clip(u, low, high)
            status |= ControllerStatus.RATE if too_fast else status
        last = () if self.rate is None else (u,)
        return ControllerStep(status, z, x[: m.n_states], u, (x, z, *last))

    def wanted(self, state: State, target: np.ndarray) -> np.ndarray | None:
        """(n_u,) the drives of the motion, whatever their limits; None where a step from `state` does not follow it."""
        if self.is_lost(*state) or not np.all(np.abs(target) <= self.kernels.input_limits):
            return None
        z, x, u = (self.kernels.motion[name](target).full().ravel() for name in ("displacement", "state", "drive"))
        return None if self._broken(x, z) else self.chosen(u, state)

    def _broken(self, x: np.ndarray, z: np.ndarray) -> ControllerStatus:
        """Which limits beside those of the drives a motion breaks."""
        kernels, m, (z_slack, x_slack, _) = self.kernels, self.kernels.nominal, self.slacks
        n, broken = m.n_states, ControllerStatus(0)
        if not np.all((z >= m.z_bounds[0] - z_slack) & (z <= m.z_bounds[1] + z_slack)):
            broken |= ControllerStatus.DISPLACEMENT
        elif kernels.guarded_limits:
            ratio = self._answer("composite_ratio", kernels.composite_ratio, x, z, z)[0]
            broken |= ControllerStatus.COMPOSITE if not ratio <= 1 + self.slack else broken
        low, high = (bound[:n] for bound in m.x_bounds)
        if self.state_can_be_limited and not np.all((x[:n] >= low - x_slack) & (x[:n] <= high + x_slack)):
            broken |= ControllerStatus.STATE
        return broken

    def rounding(
        self, before: State, target: np.ndarray, reached: tuple[np.ndarray, np.ndarray], settle: bool, share: float
    ) -> Rounding:
        """As of a controller without inertia; of a motion by `MotionKernels.sensitivity`."""
        if settle:
            position = target[: len(self.kernels.model.signals[self.kernels.follow].channels)]
            return super().rounding(before, position, reached, True, share)
        return Rounding(*(share * part for part in self.kernels.sensitivity(target)))


@lru_cache(maxsize=4)  # generation and each check of what was generated ask for the same one; its kernels take long
def controller_of(
    model: Model,
    follow: str,
    sample_time: float | None,
    leads_modes: bool = False,
    times: tuple[float, float] | None = None,
) -> Controller:
    """The feedforward controller of a device; one with inertia takes derivatives too, two more where it `leads_modes` of bodies. With
    `times` [s], the shortest and the longest, its sample time may vary. Raises InputError where it may not."""
    if times is not None:
        check_times(model)
    if model.inertial:
        return MotionController(MotionKernels(model, follow, sample_time, leads_modes=leads_modes))
    return Controller(ControllerKernels(model, follow, sample_time, times))
