"""Axes whose motion is imposed by a test machine, or measured, while the force, or the torque, is read."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Annotated, ClassVar, Literal

import casadi as ca
from pydantic import Field, model_validator

from ctrlgen.core.names import Name
from ctrlgen.core.units import In, Quantity, same_dimension, written_unit
from ctrlgen.devices.base import Device
from ctrlgen.devices.device_physics import ImposedPhysics, imposed_motion
from ctrlgen.devices.limit import Limit
from ctrlgen.devices.section import Section

Mass = Annotated[Quantity, In("kg", low=0.0)] | Annotated[Quantity, In("kg*m^2", low=0.0)]
Damping = Annotated[Quantity, In("N*s/m", low=0.0)] | Annotated[Quantity, In("N*m*s/rad", low=0.0)]
Stiffness = Annotated[Quantity, In("N/um", low=0.0)] | Annotated[Quantity, In("N*m/rad", low=0.0)]
Stroke = Annotated[Quantity, In("um", positive=True)] | Annotated[Quantity, In("rad", positive=True)]
Speed = Annotated[Quantity, In("um/s", positive=True)] | Annotated[Quantity, In("rad/s", positive=True)]
Force = Annotated[Quantity, In("N", positive=True)] | Annotated[Quantity, In("N*m", positive=True)]
# Units of (mass, damping, stiffness, stroke, speed, force).
LINEAR, ROTARY = (
    {"mass": "kg", "damping": "N*s/m", "stiffness": "N/um", "stroke": "um", "speed": "um/s", "force": "N"},
    {
        "mass": "kg*m^2",
        "damping": "N*m*s/rad",
        "stiffness": "N*m/rad",
        "stroke": "rad",
        "speed": "rad/s",
        "force": "N*m",
    },
)


class Mechanics(Section):
    """Mass, damping and stiffness, each of which may be zero, and typical sizes of the test.

    An axis is rotary where its `stroke` is an angle; the other numbers are then an inertia, N*m*s/rad, N*m/rad, rad/s
    and N*m.
    """

    domain: ClassVar[str] = "stage"
    relative_sd: ClassVar[float | None] = 1.0

    mass: Mass
    """Mass m, or moment of inertia, that is accelerated with the motion."""
    damping: Damping
    """Viscous damping c: the reading contains +c v."""
    stiffness: Stiffness
    """Stiffness k: the reading contains +k d."""
    stroke: Stroke
    """Largest displacement to either side of d = 0; a limit, and the scale of the displacement."""
    speed: Speed
    """Typical largest speed; a scale of the computation, not a limit."""
    force: Force
    """Typical largest force; a scale of the computation, not a limit."""

    @property
    def rotary(self) -> bool:
        """Whether the displacement is an angle."""
        return same_dimension(written_unit(self.stroke.text), "rad")

    @property
    def units(self) -> dict[str, str]:
        """The unit of each number in reports."""
        return ROTARY if self.rotary else LINEAR

    @model_validator(mode="after")
    def _one_kind_of_motion(self) -> Mechanics:
        faults = [
            f"{key} = {getattr(self, key).text!r} should be in {unit}"
            for key, unit in self.units.items()
            if not same_dimension(written_unit(getattr(self, key).text), unit)
        ]
        if faults:
            kind, dimension = ("rotary", "an angle") if self.rotary else ("linear", "a length")
            raise ValueError(f"the axis is {kind}, because its stroke is {dimension}: {'; '.join(faults)}")
        return self


class NamedAxis(Mechanics):
    """One `[[axis]]` of several: its name beside the numbers of a single one."""

    name: Name
    """Name of the axis; its columns are `drive.NAME_position`, `drive.NAME_velocity`, `drive.NAME_acceleration` and
    `reading.NAME`.
    """


class TestedAxis(Device):
    """Imposed displacement, velocity and acceleration -> force F = m a + c v + k d."""

    kind: Literal["tested_axis"]
    """An axis whose motion is imposed and whose force is read."""
    mechanics: Mechanics
    """What resists the motion."""

    def physics(self, p: SimpleNamespace) -> ImposedPhysics:
        """Newton's second law, solved for the force."""
        return _physics((self.mechanics,), (p.mechanics,), None)


class TestedAxes(Device):
    """The imposed motion of several axes -> the force of each, F_i = m_i a_i + c_i v_i + k_i d_i."""

    kind: Literal["tested_axes"]
    """Several axes whose motion is imposed and whose forces are read; what joins them is left to effects."""
    axis: Annotated[tuple[NamedAxis, ...], Field(min_length=1)]
    """`[[axis]]` tables: what resists the motion of each. All are linear, or all are rotary."""

    @model_validator(mode="after")
    def _axes_belong_together(self) -> TestedAxes:
        names = [axis.name for axis in self.axis]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"two axes are named {twice[0]!r}; name each once")
        other = next((axis for axis in self.axis if axis.rotary != self.axis[0].rotary), None)
        if other is not None:
            raise ValueError(
                f"axis {names[0]!r} and {other.name!r} are not both linear or both rotary; describe them in two files"
            )
        return self

    def physics(self, p: SimpleNamespace) -> ImposedPhysics:
        """Newton's second law of each axis, solved for the force."""
        return _physics(self.axis, p.axis, tuple(axis.name for axis in self.axis))


def _physics(
    axes: Sequence[Mechanics], values: Sequence[SimpleNamespace], names: tuple[str, ...] | None
) -> ImposedPhysics:
    """The physics of the `axes` with the numbers `values`; `names` is None for the only axis of a device."""
    n, units = len(axes), axes[0].units
    mass, damping, stiffness = (
        ca.vertcat(*(getattr(v, key) for v in values)) for key in ("mass", "damping", "stiffness")
    )
    stroke, speed, force = (tuple(getattr(axis, key).si for axis in axes) for key in ("stroke", "speed", "force"))
    accelerations = tuple(v**2 / d for v, d in zip(speed, stroke, strict=True))
    kept = names or ("axis",)

    def limits(signal: SimpleNamespace) -> list[Limit]:
        return [
            Limit(
                "stroke" if names is None else f"stroke_{axis}",
                "stage displacement",
                (axis,),
                units["stroke"],
                d,
                -largest,
                largest,
            )
            for axis, d, largest in zip(kept, ca.vertsplit(signal.displacement), stroke, strict=True)
        ]

    return ImposedPhysics(
        axes=kept,
        components=names or ("force",),
        pose_units=(units["force"],) * n,
        pose_scale=force,
        drive=imposed_motion(names, units["stroke"], (*stroke, *speed, *accelerations)),
        displacement_scale=max(stroke),
        travel_unit=units["stroke"],
        force_scale=max(force),
        force_unit=units["force"],
        force=lambda motion, d: mass * motion[2 * n :] + damping * motion[n : 2 * n],
        restoring_force=lambda d: stiffness * d,
        pose=lambda f: f,
        limits=limits,
    )
