"""An axis without dynamics, whose position is its command, or proportional to its drive: reading = G u."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Annotated, ClassVar, Literal

import casadi as ca
from pydantic import model_validator

from ctrlgen.core.units import In, Quantity, same_dimension, written_unit
from ctrlgen.devices.base import Device
from ctrlgen.devices.device_physics import BalancedPhysics
from ctrlgen.devices.limit import Limit
from ctrlgen.devices.section import Section
from ctrlgen.devices.signal import Signal
from ctrlgen.devices.travel import TravelOrTurn, ends_of, farthest, travel_unit


class Transducer(Section):
    """What turns the drive into the position: a piezo ceramic and its amplifier, a valve, a lead screw."""

    domain: ClassVar[str] = "actuator"
    relative_sd: ClassVar[float | None] = 0.1

    gain: Annotated[Quantity, In(None, positive=True)]
    """Position per drive G, such as "0.5 um/V", "2 mm/A", "10 um/%" or "3 um/N"."""
    drive_limit: Annotated[Quantity, In(None, positive=True)]
    """Largest drive of either sign, in the unit that `gain` divides by: V, A, N, %, rpm."""


class Servo(Device):
    """Command -> position, without force or time; linear or rotary as the unit of `travel`, the largest excursion, says."""

    kind: Literal["servo"]
    """An axis whose reading equals its command, or is proportional to its drive."""
    travel: TravelOrTurn
    """Largest excursion to either side of zero, or its ends, such as ["-10 deg", "60 deg"]; an angle makes the axis rotary, a length
    linear."""

    transducer: Transducer | None = None
    """Makes the command a voltage, a current or another drive. Left out: the command is the position."""

    @model_validator(mode="after")
    def _gain_of_one_dimension(self) -> Servo:
        if self.transducer is None:
            return self
        unit, gain, drive = (
            travel_unit(self.travel),
            *(written_unit(q.text) for q in (self.transducer.gain, self.transducer.drive_limit)),
        )
        if not same_dimension(f"({gain})*({drive})", unit):
            raise ValueError(
                f"transducer.gain in {gain} times a drive in {drive} gives no position in {unit}, the unit of travel"
            )
        return self

    def physics(self, p: SimpleNamespace) -> BalancedPhysics:
        """The identity, or the gain of the transducer."""
        axes, unit, travel = ("axis",), travel_unit(self.travel), farthest(self.travel)
        u, gain = ca.SX.sym("u", 1), p.transducer.gain if self.transducer else 1.0
        most = self.transducer.drive_limit.si if self.transducer else travel
        drive = (
            Signal("command", "commanded position", axes, (unit,), "r_", u, (most,))
            if self.transducer is None
            else Signal("drive", "drive", axes, (written_unit(self.transducer.drive_limit.text),), "u_", u, (most,))
        )

        def limits(signal: SimpleNamespace) -> list[Limit]:
            ends = ends_of(self.travel)
            reach = (-most, most) if self.transducer else ends
            return [
                Limit("drive", drive.label, axes, drive.units[0], signal.drive, *reach),
                Limit("travel", "travel", axes, unit, signal.displacement, *ends),
            ]

        return BalancedPhysics(
            axes=axes,
            components=axes,
            pose_units=(unit,),
            pose_scale=(travel,),
            drive=drive,
            displacement_scale=travel,
            force_scale=travel,
            force_unit=unit,
            travel_unit=unit,
            force=lambda u, x, d: gain * u,
            restoring_force=lambda d: d,
            pose=lambda d: d,
            limits=limits,
        )
