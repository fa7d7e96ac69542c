"""What a machine is made of: its actuator, what stands between it and the reading, and the sensor; stated, or inferred from the file.

Nothing of this enters the model. A diagnosis offers no law that such a machine cannot have, and names laws in its words.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from pydantic import ValidationInfo, field_validator

from ctrlgen.core.units import same_dimension
from ctrlgen.devices.device_physics import BalancedPhysics, DevicePhysics, ImposedPhysics
from ctrlgen.devices.part_names import name_of_part
from ctrlgen.devices.section import Section

ActuatorName = Literal[
    "voice coil",
    "linear motor",
    "servo motor",
    "servo",
    "stepper",
    "galvanometer",
    "solenoid",
    "piezo stack",
    "piezo ceramic",
    "piezo motor",
    "thermal",
    "electrostatic",
    "hydraulic",
    "pneumatic",
    "pump",
]
TransmissionName = Literal[
    "none", "flexure", "lever", "linkage", "screw", "gear", "harmonic drive", "belt", "rack", "cable"
]
SensorName = Literal[
    "capacitive",
    "eddy current",
    "LVDT",
    "interferometer",
    "encoder",
    "resolver",
    "potentiometer",
    "strain gauge",
    "load cell",
    "tachometer",
    "camera",
    "autocollimator",
    "laser triangulation",
    "accelerometer",
]
# By what an actuator works. A servo, as a servo motor with its own controller is called for short, works as its motor does.
FAMILIES: Mapping[str, str] = {
    **dict.fromkeys(
        ("voice coil", "linear motor", "servo motor", "servo", "stepper", "galvanometer", "solenoid"), "electromagnetic"
    ),
    **dict.fromkeys(("piezo stack", "piezo ceramic"), "piezo"),
    "piezo motor": "stepping piezo",
    "thermal": "thermal",
    "electrostatic": "electrostatic",
    **dict.fromkeys(("hydraulic", "pneumatic", "pump"), "fluid"),
}
# Names that are said without an article
ADJECTIVES = frozenset({"thermal", "electrostatic", "hydraulic", "pneumatic"})
# A ceramic strains by 0.1 to 0.15 % (Physik Instrumente, piezo tutorial), so that 2 mm take a stack of 1.4 m, or one of 0.1 m behind a
# lever of 14; a tilting stage of twice 50 um over 5 mm does 0.02 rad. Twice as much is no piezo.
LONGEST_PIEZO, WIDEST_PIEZO = 2e-3, 0.04


class Machine(Section):
    """`[machine]`: the parts of the machine. Each key may be left out; `ctrlgen check` says what is then inferred. Other words of the field
    for a part, such as a ball screw or a linear scale, are understood (`part_names`)."""

    actuator: ActuatorName | None = None
    """What moves it."""
    transmission: TransmissionName | tuple[TransmissionName, ...] | None = None
    """What stands between actuator and reading, one name or several; "none" for a direct drive."""
    sensor: SensorName | None = None
    """What the readings come from."""

    @field_validator("actuator", "transmission", "sensor", mode="before")
    @classmethod
    def _by_its_name(cls, given: object, info: ValidationInfo) -> object:
        names = {"actuator": ActuatorName, "transmission": TransmissionName, "sensor": SensorName}[str(info.field_name)]
        if isinstance(given, list | tuple):
            return tuple(name_of_part(word, names) for word in given)
        return name_of_part(given, names)


@dataclass(frozen=True)
class MachineParts:
    """The parts of a machine as far as they are known.

    actuator, transmission, sensor: as stated, None where not. family: by what the actuator works, a value of `FAMILIES`, "none"
    where the motion is imposed, None where it is not known. excluded: families that it cannot be, with the reason. flexible:
    whether its stage stands on flexures, None where not known. position: whether its drive is the position that it shall have. imposed:
    whether its motion is imposed and its force read.
    """

    actuator: str | None = None
    transmission: tuple[str, ...] | None = None
    sensor: str | None = None
    family: str | None = None
    excluded: tuple[tuple[str, str], ...] = ()
    flexible: bool | None = None
    position: bool = False
    imposed: bool = False

    def cannot_be(self, families: frozenset[str]) -> str:
        """Why its actuator is none of the `families`; empty where it may be one."""
        if self.family is not None:
            named = self.actuator or self.family
            kind = f"a {named}" if self.actuator and named not in ADJECTIVES else named
            return (
                ""
                if self.family in families
                else f"its actuator is {kind}"
                if self.family != "none"
                else "its motion is imposed"
            )
        reasons = dict(self.excluded)
        return reasons[next(iter(sorted(families)))] if families <= reasons.keys() else ""

    @property
    def words(self) -> frozenset[str]:
        """Every word that is known of it: names of parts, the family of its actuator, "position" for a drive that is one, "flexible"
        for a stage on flexures, "imposed" for a motion that is."""
        known = (self.family, self.actuator, self.sensor, *(self.transmission or ()))
        marks = {"position": self.position, "flexible": self.flexible, "imposed": self.imposed}
        return frozenset(word for word in (*known, *(mark for mark, holds in marks.items() if holds)) if word)

    @property
    def text(self) -> str:
        """What is known in words, such as 'piezo stack (stated), flexure (stated), no sensor stated'."""
        if self.actuator:
            moved = f"{self.actuator} (stated)"
        elif self.family == "none":
            moved = "motion imposed"
        elif self.family:
            moved = f"{self.family} actuator (inferred)"
        else:
            nots = "; ".join(f"no {family} one: {why}" for family, why in self.excluded)
            moved = f"actuator not stated{f' ({nots})' if nots else ''}"
        if self.transmission:
            between = f"{' and '.join(self.transmission)} (stated)"
        else:
            between = "on flexures (inferred)" if self.flexible else "transmission not stated"
        return f"{moved}, {between}, {f'{self.sensor} (stated)' if self.sensor else 'sensor not stated'}"


def machine_parts(
    stated: Machine | None,
    physics: DevicePhysics,
    works_by: str | None,
    on_flexures: bool | None,
    excluded: Mapping[str, str],
) -> MachineParts:
    """The parts of a device of this `physics`, as stated, else as its kind says (`works_by`, `on_flexures`), else as its units do.

    `excluded` are families that its kind rules out, with the reason.
    """
    given = stated or Machine()
    between = (given.transmission,) if isinstance(given.transmission, str) else given.transmission
    family, reasons, flexible = works_by, dict(excluded), on_flexures
    units = physics.drive.units
    if isinstance(physics, ImposedPhysics):
        family = "none"
    elif isinstance(physics, BalancedPhysics) and physics.power is not None:
        family = "thermal"
    elif all(same_dimension(unit, "A") for unit in units):
        family = "electromagnetic"
    elif any(same_dimension(unit, told) for unit in units for told in ("N", "N*m")):
        reasons |= dict.fromkeys(("piezo", "thermal"), "its drive is a force")
    farthest = {"m": (LONGEST_PIEZO, "2 mm"), "rad": (WIDEST_PIEZO, "40 mrad")}
    way = next(
        (unit for unit in farthest if same_dimension(physics.travel_unit, unit)), None
    )  # None: counted in drives
    if way is not None and physics.displacement_scale > farthest[way][0]:
        reasons.setdefault("piezo", f"its travel is beyond {farthest[way][1]}")
    if between is not None:
        flexible = "flexure" in between
    imposed = isinstance(physics, ImposedPhysics)
    position = way is not None and all(same_dimension(unit, physics.travel_unit) for unit in units)
    return MachineParts(
        actuator=given.actuator,
        transmission=between,
        sensor=given.sensor,
        family=FAMILIES[given.actuator] if given.actuator else family,
        excluded=tuple(reasons.items()),
        flexible=flexible,
        position=position and not imposed,
        imposed=imposed,
    )
