"""Constant loads on the platform of a stage that the papers describe: a wrench at the point whose pose is followed.

With the axes held at d the platform goes to J d + C W, C its compliance there; its energy (x - J d)'C^-1(x - J d)/2 - W'x, least in x,
pulls the axes by J'W: the force that the actuators push against is f(d) - J'W.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import ClassVar, Self

import casadi as ca
from pydantic import model_validator

from ctrlgen.devices.base import Device
from ctrlgen.devices.load import GROUND_NAME, Gravity, Load, joined
from ctrlgen.physics.screw import Matrix

PLATFORM = "platform"


class LoadedPlatform(Device):
    """A device with a platform that may be loaded."""

    planar: ClassVar[bool] = False
    """Whether it moves in its plane alone: along x and y and about z."""

    load: tuple[Load, ...] = ()
    """`[[load]]` tables: what pushes the platform all the time. The pose counts from where it is without them."""

    @model_validator(mode="after")
    def _loads_of_the_platform(self) -> Self:
        return self._checked_loads()

    def _checked_loads(self) -> Self:
        """Itself. Raises ValueError naming all faults of its loads."""
        if faults := [f"load[{k}].{fault}" for k, load in enumerate(self.load) for fault in self._faults(load)]:
            raise ValueError("; ".join(faults))
        return self

    def _faults(self, load: Load) -> list[str]:
        faults = []
        if load.on != PLATFORM or load.against != GROUND_NAME or load.pattern:
            faults.append(
                f'on: of this kind the "{PLATFORM}" alone is loaded, against the ground and without a pattern'
            )
        if load.mass is not None:
            faults.append("mass: the masses of this kind are its own; state the weight as a force")
        if self.planar:
            out_of_plane = [
                q for q in (*(load.force or ())[2:], *(load.moment or ())[:2], *(load.at or ())[2:]) if q.si
            ]
            faults += ["force: the stage is planar; leave out what is not along x, along y or about z"] * bool(
                out_of_plane
            )
        return faults

    def loaded(self, loads: Sequence[Load], gravity: Gravity | None) -> Self:
        """The device with more loads. Raises ValueError where it cannot have them."""
        if gravity is not None:
            raise ValueError("gravity: weights of this kind of device are not known; state them as forces")
        return self.model_copy(update={"load": joined(self.load, loads)})._checked_loads()

    @staticmethod
    def wrench(p: SimpleNamespace) -> Matrix:
        """W (6, 1), (F; M) at the point whose pose is followed, of all loads among the values `p`."""
        W = ca.SX(6, 1)
        for load in p.load:
            force = ca.DM.zeros(3) if load.force is None else ca.vertcat(*load.force)
            moment = ca.DM.zeros(3) if load.moment is None else ca.vertcat(*load.moment)
            arm = ca.DM.zeros(3) if load.at is None else ca.vertcat(*load.at)
            W += ca.vertcat(force, moment + ca.cross(arm, force))
        return W
