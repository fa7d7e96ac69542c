"""An axis without dynamics, whose position is its command: reading = command."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Annotated, Literal

import casadi as ca

from ctrlgen.core.units import In, Quantity, written_unit
from ctrlgen.devices.base import BalancedPhysics, Device, Limit, Signal

Travel = Annotated[Quantity, In("deg", positive=True)] | Annotated[Quantity, In("um", positive=True)]


class Servo(Device):
    """Command -> position, without force or time; linear or rotary as the unit of `travel`, the largest excursion, says."""

    kind: Literal["servo"]
    """An axis whose reading equals its command."""
    travel: Travel
    """Largest excursion to either side of zero; an angle makes the axis rotary, a length linear."""

    def physics(self, p: SimpleNamespace) -> BalancedPhysics:
        """The identity."""
        axes, unit, travel = ("axis",), written_unit(self.travel.text), self.travel.si
        drive = Signal("command", "commanded position", axes, (unit,), "r_", ca.SX.sym("u", 1), (travel,))

        def limits(signal: SimpleNamespace) -> list[Limit]:
            return [Limit("drive", drive.label, axes, unit, signal.drive, -travel, travel)]

        return BalancedPhysics(
            axes=axes, components=axes, pose_units=(unit,), pose_scale=(travel,), drive=drive,
            displacement_scale=travel, force_scale=travel, force_unit=unit, travel_unit=unit,
            force=lambda u, x, d: u, restoring_force=lambda d: d, pose=lambda d: d, limits=limits,
        )  # fmt: skip
