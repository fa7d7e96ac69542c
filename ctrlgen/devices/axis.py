"""A stage with one axis and inertia, linear or rotary, m q'' + c q' + k q = k_f u, open loop or closed loop."""

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
from ctrlgen.devices.travel import TravelOrTurn, ends_of, farthest, travel_unit

Mass = Annotated[Quantity, In("kg", positive=True)] | Annotated[Quantity, In("kg*m^2", positive=True)]
Damping = Annotated[Quantity, In("N*s/m", low=0.0)] | Annotated[Quantity, In("N*m*s/rad", low=0.0)]
Stiffness = Annotated[Quantity, In("N/um", low=0.0)] | Annotated[Quantity, In("N*m/rad", low=0.0)]
ForceConstant = (
    Annotated[Quantity, In("N/V", positive=True)]
    | Annotated[Quantity, In("N/A", positive=True)]
    | Annotated[Quantity, In("N*m/V", positive=True)]
    | Annotated[Quantity, In("N*m/A", positive=True)]
)
VelocityGain = Annotated[Quantity, In("V/(m/s)", low=0.0)] | Annotated[Quantity, In("V*s/rad", low=0.0)]
IntegralGain = Annotated[Quantity, In("V/(m*s)", low=0.0)] | Annotated[Quantity, In("V/(rad*s)", low=0.0)]
LINEAR = {"mass": "kg", "damping": "N*s/m", "stiffness": "N/um"}
ROTARY = {"mass": "kg*m^2", "damping": "N*m*s/rad", "stiffness": "N*m/rad"}
"""Units of the numbers of an axis that moves, and of one that turns."""


class Mechanics(Section):
    """The moving mass and its flexures; with zero stiffness the axis integrates.

    An axis is rotary where its `stroke` is an angle; the other numbers are then an inertia, N*m*s/rad and N*m/rad.
    """

    domain: ClassVar[str] = "stage"
    relative_sd: ClassVar[float | None] = 0.1

    mass: Mass
    """Moving mass m, or moment of inertia."""
    damping: Damping
    """Viscous damping c: the force -c q' opposes the velocity."""
    stiffness: Stiffness
    """Stiffness k of the flexures: the force -k q pulls toward q = 0."""
    stroke: TravelOrTurn
    """Largest displacement to either side of q = 0, or its ends, such as ["-10 um", "60 um"] or ["-30 deg", "30 deg"]; a limit of
    trajectories and of the generated controller. An angle makes the axis rotary."""

    @property
    def rotary(self) -> bool:
        """Whether the displacement is an angle."""
        return same_dimension(travel_unit(self.stroke), "rad")

    @model_validator(mode="after")
    def _one_kind_of_motion(self) -> Mechanics:
        faults = [
            f"{key} = {getattr(self, key).text!r} should be in {unit}"
            for key, unit in (ROTARY if self.rotary else LINEAR).items()
            if not same_dimension(written_unit(getattr(self, key).text), unit)
        ]
        if faults:
            kind, dimension = ("rotary", "an angle") if self.rotary else ("linear", "a length")
            raise ValueError(f"the axis is {kind}, because its stroke is {dimension}: {'; '.join(faults)}")
        return self


class Actuator(Section):
    """A motor whose force, or torque, is proportional to its drive, in volt or ampere."""

    domain: ClassVar[str] = "actuator"
    relative_sd: ClassVar[float | None] = 0.1

    force_constant: ForceConstant
    """Force or torque per drive k_f; its unit decides whether the drive is a voltage or a current."""
    drive_limit: Annotated[Quantity, In("V", positive=True)] | Annotated[Quantity, In("A", positive=True)]
    """Largest drive of either sign, in volt or ampere as in `force_constant`."""

    @model_validator(mode="after")
    def _driven_by_one_quantity(self) -> Actuator:
        constant, limit = written_unit(self.force_constant.text), written_unit(self.drive_limit.text)
        if not any(same_dimension(f"({constant})*({limit})", force) for force in ("N", "N*m")):
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
    velocity_gain: VelocityGain
    """k_v: drive per velocity error."""
    integral_gain: IntegralGain
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

    @model_validator(mode="after")
    def _moves_or_turns(self) -> Axis:
        rotary, force, per = (
            self.mechanics.rotary,
            self.actuator.force_constant.text,
            "rad" if self.mechanics.rotary else "m",
        )
        constant, drive = written_unit(force), written_unit(self.actuator.drive_limit.text)
        wanted = {
            "actuator.force_constant": (force, same_dimension(f"({constant})*({drive})", "N*m" if rotary else "N"))
        }
        if self.loop is not None:
            for key, unit in (("velocity_gain", f"V*s/{per}"), ("integral_gain", f"V/({per}*s)")):
                text = getattr(self.loop, key).text
                wanted[f"loop.{key}"] = text, same_dimension(written_unit(text), unit)
        faults = [f"{key} = {text!r}" for key, (text, fits) in wanted.items() if not fits]
        if faults:
            kind, dimension = ("rotary", "an angle") if rotary else ("linear", "a length")
            raise ValueError(
                f"the axis is {kind}, because its stroke is {dimension}: {', '.join(faults)} is of another axis"
            )
        return self

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
        length = travel_unit(self.mechanics.stroke) if self.mechanics.rotary else "um"
        u, closed = ca.SX.sym("u", 1), self.loop is not None
        volts = ("drive", "drive", axes, (unit,), "u_", u, (largest,))
        drive = (
            Signal("reference", "reference position", axes, (length,), "r_", u, (stroke,)) if closed else Signal(*volts)
        )
        integral = Signal(
            "integral", "integral of the error", axes, (f"{length}*s",), "i_", ca.SX.sym("i", 1), (stroke,)
        )

        def control_law(r: ca.SX, y: ca.SX, v: ca.SX, x: ca.SX) -> ca.SX:
            g = p.loop
            wanted = g.position_gain * g.velocity_gain * (r - y) - g.velocity_gain * v + g.integral_gain * x
            return ca.fmin(ca.fmax(wanted, -largest), largest)

        def limits(signal: SimpleNamespace) -> list[Limit]:
            bounds = ends if closed else (-largest, largest)
            return [
                Limit("drive", f"commanded {drive.label}", axes, drive.units[0], signal.drive, *bounds),
                Limit("stroke", "stage displacement", axes, length, signal.displacement, *ends),
            ]

        loop = None
        if self.loop is not None:
            command = AxisSignal("amplifier drive", unit, "u_", largest)
            loop = FeedbackLoop(control_law, lambda x, error: error, command, self.loop.measures)
        return InertialPhysics(
            axes=axes,
            components=axes,
            pose_units=(length,),
            pose_scale=(stroke,),
            drive=drive,
            state=integral if closed else None,
            rest=(0.0,) if closed else (),
            displacement_scale=stroke,
            travel_unit=length,
            force_scale=force_scale,
            force_unit="N*m" if self.mechanics.rotary else "N",
            mass=(m.mass,),
            dynamics=lambda drive, x, d, v: (a.force_constant * drive, ca.SX(0, 1)),
            restoring_force=lambda d: m.stiffness * d,
            damping_force=lambda v: m.damping * v,
            pose=lambda d: d,
            feedback=loop,
            limits=limits,
        )
