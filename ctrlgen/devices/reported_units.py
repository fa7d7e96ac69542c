"""The physics of a device with the units in which a reader wants its numbers, such as those of the columns of a recording.

Units are for text: no number of the physics changes, in SI or as a share of its typical size.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from ctrlgen.core.units import same_dimension, to_si
from ctrlgen.devices.device_physics import BalancedPhysics, DevicePhysics

DERIVATIVES = {1: "/s", 2: "/s^2"}


def in_units_of(physics: DevicePhysics, units: Mapping[str, str]) -> DevicePhysics:
    """`physics` told in the `units` of signals, such as {'drive.axis': 'V', 'reading.axis': 'mm'}.

    A signal that has none of its own, such as the displacement of a stage whose pose is read, is told in the first unit of its
    dimension, of recorded displacements, then of readings, then of drives. A unit of another dimension, or one that does not count
    from zero, is left out.
    """
    given = [
        unit
        for role in ("displacement.", "reading.", "drive.")
        for name, unit in units.items()
        if name.startswith(role)
    ]
    # of a motion whose speed alone was recorded, the displacement is in that unit without "/s"
    known = [*given, *(unit.removesuffix(end) for unit in given for end in DERIVATIVES.values() if unit.endswith(end))]

    def told(name: str, unit: str) -> str:
        own = units.get(name)
        return next((u for u in ((own,) if own else known) if serves(u, unit)), unit)

    drive = physics.drive
    told_drive = replace(
        drive, units=tuple(told(f"drive.{c}", u) for c, u in zip(drive.channels, drive.units, strict=True))
    )
    changes: dict[str, object] = {
        "pose_units": tuple(
            told(f"reading.{c}", u) for c, u in zip(physics.components, physics.pose_units, strict=True)
        ),
        "drive": told_drive,
        "travel_unit": told("", physics.travel_unit),
        "force_unit": told("", physics.force_unit),
    }
    if (more := physics.sensed) is not None:
        rows = zip(more.channels, more.units, strict=True)
        changes["sensed"] = replace(more, units=tuple(told(f"reading.{c}", u) for c, u in rows))
    if isinstance(physics, BalancedPhysics) and physics.power is not None:
        changes["power"] = replace(physics.power, unit=told("", physics.power.unit))
    return replace(physics, **changes)  # type: ignore[arg-type]  # of these fields


def derived_unit(unit: str, order: int) -> str:
    """The unit of the derivative in time of a signal in `unit`, or of its integral where `order` is -1."""
    if order > 0:
        return f"{unit}{DERIVATIVES[order]}" if unit.isalnum() else f"({unit}){DERIVATIVES[order]}"
    return unit.removesuffix("/s") if unit.endswith("/s") else f"({unit})*s"


def serves(unit: str, of: str) -> bool:
    """Whether numbers that are told in the unit `of` can be told in `unit`."""
    try:
        return same_dimension(unit, of) and to_si(0.0, unit) == 0.0
    except ValueError:
        return False
