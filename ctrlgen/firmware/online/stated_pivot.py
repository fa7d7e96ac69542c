"""The function of the online C that takes the pose of another point of the body, a pivot given at run time: its kernel, what it accepts,
reference answers. The transform is that of a scenario's pivot, `ctrlgen.physics.pivot`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from ctrlgen.controller.kernels import ControllerKernels
from ctrlgen.firmware.c.cprint import Kernel, Printer
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.online.limit_tables import magnitude_test
from ctrlgen.physics.pivot import can_turn, pivoted
from ctrlgen.physics.screw import FULL_TURN, TWIST

FARTHEST = 1e3  # m, of a pivot's coordinate: beyond any machine, and no product of it with a pose overflows a float
ROUNDINGS = 16  # of each number that an answer follows from: a product of two series of some tens of operations
PIVOTS = 6  # reference answers of the self test
ARM = 0.05  # m, typical of pivots in reference answers: the half of a stage's size


@dataclass(frozen=True)
class StatedPivot:
    """Poses about a pivot as targets of a controller with these `kernels`."""

    kernels: ControllerKernels

    @property
    def acts(self) -> bool:
        """Whether the controller follows a pose that can turn about a pivot."""
        return self.kernels.follow == "pose" and can_turn(self._channels)

    @property
    def _channels(self) -> tuple[str, ...]:
        return self.kernels.model.signals[self.kernels.follow].channels

    @cached_property
    def function(self) -> ca.Function:
        """(pose, pivot (3,)) -> target, both of as many numbers as a target."""
        return pivoted(self._channels, len(self.kernels.target.channels) // len(self._channels) - 1)

    @cached_property
    def limits(self) -> np.ndarray:
        """The largest magnitude of each number of a pose that is accepted: as of a target, angles a full turn."""
        limits = self.kernels.input_limits.copy()
        angles = [k for k, name in enumerate(self._channels) if name in TWIST[:3]]
        limits[angles] = np.minimum(limits[angles], FULL_TURN)
        return limits

    def rounding(self, pose: np.ndarray, pivot: np.ndarray, real: Real) -> np.ndarray:
        """What roundings of `real` arithmetic may change each number of the target, (n,), for `pose` (n,) and `pivot` (3,)."""
        by_pose, by_pivot = (part.full() for part in self._slopes(pose, pivot))
        return ROUNDINGS * real.epsilon * (np.abs(by_pose) @ np.abs(pose) + np.abs(by_pivot) @ np.abs(pivot))

    @cached_property
    def _slopes(self) -> ca.Function:
        """(pose, pivot) -> derivatives of the target by each."""
        pose, pivot = self.function.sx_in()
        target = self.function(pose, pivot)
        return ca.Function("slopes", [pose, pivot], [ca.jacobian(target, pose), ca.jacobian(target, pivot)])

    def cases(self, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Poses (count, n) and pivots (count, 3) from none to large: typical sizes of targets, every other with angles near one radian."""
        poses = rng.normal(size=(count, len(self.limits))) * np.array(self.kernels.target.scale)
        for k, name in enumerate(self._channels):
            if name in TWIST[:3]:
                poses[1::2, k] = rng.uniform(-1, 1, len(poses[1::2]))
        poses[0] = 0.0
        return poses, rng.normal(size=(count, 3)) * ARM


def pivot_context(kernels: ControllerKernels, printer: Printer) -> Mapping[str, Any] | None:
    """What online.c.j2 and online.h.j2 need of it; None where the controller's target has no pivot."""
    stated = StatedPivot(kernels)
    if not stated.acts:
        return None
    real = printer.real
    tests = [magnitude_test(f"pose[{i}]", most, real) for i, most in enumerate(stated.limits)]
    tests += [magnitude_test(f"pivot[{i}]", FARTHEST, real) for i in range(3)]
    about = "Pose of the stated point where `pose` is that of the `pivot`: delta = delta_p - (R - I) pivot, R the rotation by theta."
    kernel: Kernel = printer.kernel(stated.function, "of_pivot", about, may_be_result=["pose", "pivot"])
    return {"kernel": kernel, "usable": tests}


def pivot_vectors(kernels: ControllerKernels, real: Real) -> list[dict[str, np.ndarray]]:
    """Reference answers: "pose", "pivot", "target" and the "rounding" that each of its numbers may be off."""
    stated = StatedPivot(kernels)
    if not stated.acts:
        return []
    rows = []
    for pose, pivot in zip(*stated.cases(PIVOTS, np.random.default_rng(3)), strict=True):
        pose, pivot = (real.held(numbers) for numbers in (pose, pivot))
        target, off = stated.function(pose, pivot).full().ravel(), stated.rounding(pose, pivot, real)
        rows.append({"pose": pose, "pivot": pivot, "target": real.held(target), "rounding": real.held(off)})
    return rows
