"""A stage with one axis and inertia, m q'' + c q' + k q = k_f u, open loop or closed loop."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Annotated, ClassVar, Literal

import casadi as ca
from pydantic import model_validator

from ctrlgen.core.units import In, Quantity, same_dimension, written_unit
from ctrlgen.devices.base import Device
from ctrlgen.devices.device_physics import DevicePhysics, FeedbackLoop, InertialPhysics
from ctrlgen.devices.limit import Limit
from ctrlgen.devices.machine import MachineParts
from ctrlgen.devices.section import Section
from ctrlgen.devices.signal import AxisSignal, Signal
from ctrlgen.devices.travel import Travel, ends_of, farthest

ForceConstant = Annotated[Quantity, In("N/V", positive=True)] | Annotated[Quantity, In("N/A", positive=True)]


class Mechanics(Section):
    """The moving mass and its flexures; with zero stiffness the axis integrates."""

    domain: ClassVar[str] = "stage"
    relative_sd: ClassVar[float | None] = 0.1

    mass: Annotated[Quantity, In("kg", positive=True)]
    """Moving mass m."""
    damping: Annotated[Quantity, In("N*s/m", low=0.0)]
    """Viscous damping c: the force -c q' opposes the velocity."""
    stiffness: Annotated[Quantity, In("N/um", low=0.0)]
    """Stiffness k of the flexures: the force -k q pulls toward q = 0."""
    stroke: Travel
    """Largest displacement to either side of q = 0, or its ends, such as ["-10 um", "60 um"]; a limit of trajectories and of the generated
    controller."""


class Actuator(Section):
    """A motor whose force is proportional to its drive, in volt or ampere."""

    domain: ClassVar[str] = "actuator"
    relative_sd: ClassVar[float | None] = 0.1

    force_constant: ForceConstant
    """Force per drive k_f; its unit decides whether the drive is a voltage or a current."""
    drive_limit: Annotated[Quantity, In("V", positive=True)] | Annotated[Quantity, In("A", positive=True)]
    """Largest drive of either sign, in volt or ampere as in `force_constant`."""

    @model_validator(mode="after")
    def _driven_by_one_quantity(self) -> Actuator:
        constant, limit = written_unit(self.force_constant.text), written_unit(self.drive_limit.text)
        if not same_dimension(f"({constant})*({limit})", "N"):
            raise ValueError(
                f"force_constant in {constant} gives no force of a drive_limit in {limit}; write both in volt or in ampere"
            )
        return self


class Loop(Section):
    """The position controller, u = k_p k_v (r - y) - k_v q' + k_i int(r - y) dt, clipped at the drive limit.

    It is evaluated at every sample and its output held until the next, as in a digital controller.
    """

    domain: ClassVar[str] = "actuator"
    relative_sd: ClassVar[float | None] = 0.0

    measures: Literal["reading", "displacement"] = "reading"
    """What y is: the recorded reading with all its errors, or the displacement q, seen by an encoder of its own."""
    position_gain: Annotated[Quantity, In("1/s", positive=True)]
    """k_p: commanded velocity per position error."""
    velocity_gain: Annotated[Quantity, In("V/(m/s)", low=0.0)]
    """k_v: drive per velocity error."""
    integral_gain: Annotated[Quantity, In("V/(m*s)", low=0.0)]
    """k_i: drive per integral of the position error; 0 for a controller without it."""


class Axis(Device):
    """Drive, or reference of the closed loop -> force -> displacement of one mass on flexures."""

    kind: Literal["axis"]
    """Newton's second law of one moving mass."""
    mechanics: Mechanics
    """Mass, flexures and stroke."""
    actuator: Actuator
    """The motor."""
    loop: Loop | None = None
    """The position controller; the drive of the device is then the reference position. Left out: open loop."""

    def excluded_actuators(self) -> dict[str, str]:
        """A ceramic does not move a stage that nothing holds."""
        return {} if self.mechanics.stiffness.si > 0 else {"piezo": "nothing holds its stage"}

    def parts(self, physics: DevicePhysics) -> MachineParts:
        """As of any device; a stiffness is one of flexures where no transmission is stated."""
        parts = super().parts(physics)
        return replace(parts, flexible=self.mechanics.stiffness.si > 0) if parts.transmission is None else parts

    def physics(self, p: SimpleNamespace) -> InertialPhysics:
        """Newton's second law with the device's numbers."""
        m, a, axes = p.mechanics, p.actuator, ("axis",)
        stroke, largest = farthest(self.mechanics.stroke), self.actuator.drive_limit.si
        ends = ends_of(self.mechanics.stroke)
        unit = written_unit(self.actuator.drive_limit.text)
        force_scale = largest * self.actuator.force_constant.si
        u, closed = ca.SX.sym("u", 1), self.loop is not None
        volts = ("drive", "drive", axes, (unit,), "u_", u, (largest,))
        drive = (
            Signal("reference", "reference position", axes, ("um",), "r_", u, (stroke,)) if closed else Signal(*volts)
        )
        integral = Signal("integral", "integral of the error", axes, ("um*s",), "i_", ca.SX.sym("i", 1), (stroke,))

        def control_law(r: ca.SX, y: ca.SX, v: ca.SX, x: ca.SX) -> ca.SX:
            g = p.loop
            wanted = g.position_gain * g.velocity_gain * (r - y) - g.velocity_gain * v + g.integral_gain * x
            return ca.fmin(ca.fmax(wanted, -largest), largest)

        def limits(signal: SimpleNamespace) -> list[Limit]:
            bounds = ends if closed else (-largest, largest)
            return [
                Limit("drive", f"commanded {drive.label}", axes, drive.units[0], signal.drive, *bounds),
                Limit("stroke", "stage displacement", axes, "um", signal.displacement, *ends),
            ]

        loop = None
        if self.loop is not None:
            command = AxisSignal("amplifier drive", unit, "u_", largest)
            loop = FeedbackLoop(control_law, lambda x, error: error, command, self.loop.measures)
        return InertialPhysics(
            axes=axes,
            components=axes,
            pose_units=("um",),
            pose_scale=(stroke,),
            drive=drive,
            state=integral if closed else None,
            rest=(0.0,) if closed else (),
            displacement_scale=stroke,
            force_scale=force_scale,
            mass=(m.mass,),
            dynamics=lambda drive, x, d, v: (a.force_constant * drive, ca.SX(0, 1)),
            restoring_force=lambda d: m.stiffness * d,
            damping_force=lambda v: m.damping * v,
            pose=lambda d: d,
            feedback=loop,
            limits=limits,
        )
