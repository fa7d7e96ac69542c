"""An axis whose motion is imposed by a test machine, or measured, while the force is read."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Annotated, ClassVar, Literal

import casadi as ca

from ctrlgen.core.units import In, Quantity
from ctrlgen.devices.base import Device, ImposedPhysics, Limit, Section, Signal


class Mechanics(Section):
    """Mass, damping and stiffness, each of which may be zero, and typical sizes of the test."""

    domain: ClassVar[str] = "stage"
    tolerance: ClassVar[float | None] = 1.0

    mass: Annotated[Quantity, In("kg", low=0.0)]
    """Mass m that is accelerated with the motion."""
    damping: Annotated[Quantity, In("N*s/m", low=0.0)]
    """Viscous damping c: the reading contains +c v."""
    stiffness: Annotated[Quantity, In("N/um", low=0.0)]
    """Stiffness k: the reading contains +k d."""
    stroke: Annotated[Quantity, In("um", positive=True)]
    """Largest displacement to either side of d = 0; a limit, and the scale of the displacement."""
    speed: Annotated[Quantity, In("um/s", positive=True)]
    """Typical largest speed; a scale of the computation, not a limit."""
    force: Annotated[Quantity, In("N", positive=True)]
    """Typical largest force; a scale of the computation, not a limit."""


class TestedAxis(Device):
    """Imposed displacement, velocity and acceleration -> force F = m a + c v + k d."""

    kind: Literal["tested_axis"]
    """An axis whose motion is imposed and whose force is read."""
    mechanics: Mechanics
    """What resists the motion."""

    def physics(self, p: SimpleNamespace) -> ImposedPhysics:
        """Newton's second law, solved for the force."""
        m, own = p.mechanics, self.mechanics
        stroke, speed, force = own.stroke.si, own.speed.si, own.force.si
        names = ("position", "velocity", "acceleration")
        drive = Signal(
            "motion",
            "imposed motion",
            names,
            ("um", "um/s", "um/s^2"),
            "",
            ca.SX.sym("u", 3),
            (stroke, speed, speed**2 / stroke),
        )

        def limits(signal: SimpleNamespace) -> list[Limit]:
            return [Limit("stroke", "stage displacement", ("axis",), "um", signal.displacement, -stroke, stroke)]

        return ImposedPhysics(
            axes=("axis",), components=("force",), pose_units=("N",), pose_scale=(force,), drive=drive,
            displacement_scale=stroke, force_scale=force,
            force=lambda motion, d: m.mass * motion[2] + m.damping * motion[1],
            restoring_force=lambda d: m.stiffness * d, pose=lambda f: f, limits=limits,
        )  # fmt: skip
