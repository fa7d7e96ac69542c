"""Actuators of a stage by its matrix."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from ctrlgen.core.names import ChannelName
from ctrlgen.core.units import In, Quantity
from ctrlgen.devices.driven import Driven, PerDrive
from ctrlgen.devices.place import Direction, Place
from ctrlgen.devices.travel import Travel

PUSHES = ("at", "along", "gain", "travel")


class MatrixActuator(Driven):
    """`[[actuator]]`: one axis, named after it. Beside a Jacobian it has its name and the range of its drive alone."""

    name: ChannelName
    """Of the axis and its drive, such as "1x"."""
    at: Place | None = None
    """Where a force acts, in the frame of the point; its travel is that of this place."""
    along: Direction | None = None
    """In which direction; of any length."""
    gain: PerDrive | None = None
    """Force per drive, such as "0.2 N/V"."""
    stiffness: Annotated[Quantity, In("N/um", positive=True)] | None = None
    """Stiffness of a stack beside its blocked force, along its direction."""
    travel: Travel | None = None
    """Largest travel to both sides, or its ends, such as ["-10 um", "60 um"]; a limit."""

    def faults(self, pushes: bool) -> list[str]:
        """What is missing of an actuator that pushes, or too much of one whose motion the matrix states."""
        stated = [key for key in (*PUSHES, "stiffness") if getattr(self, key) is not None]
        if not pushes:
            return [f"{key}: belongs to a force; a jacobian states the motion per drive" for key in stated]
        faults = [f"{key}: is missing; a force needs it" for key in PUSHES if key not in stated]
        if self.along is not None and not np.linalg.norm(self.along) > 0:
            faults.append("along: is zero; give a direction")
        return faults + ([] if self.gain is None else self.gain_faults(self.gain, "N", "force"))
