"""The bent-beam thermal actuator of a mechanism: its beams as an element, its heater as what pushes their bar."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Annotated, Literal

from pydantic import model_validator

from ctrlgen.core.names import Name
from ctrlgen.core.units import In, Quantity
from ctrlgen.devices.mechanism.flexures import Flexible, FlexureSection
from ctrlgen.devices.mechanism.joining import Length
from ctrlgen.devices.section import Section
from ctrlgen.devices.travel import Travel
from ctrlgen.physics import thermal_actuator
from ctrlgen.physics.screw import Matrix, inverse


class BentBeam(Flexible):
    """A chevron: pairs of inclined beams from the frame to a bar, whose end is `at` and which they push along x when they are hot."""

    kind: Literal["bent_beam"]
    """The beams of a thermal actuator (S1 section 3.1); its stress is not computed."""
    beams: Annotated[Quantity, In("1", low=1, whole=True)]
    """n: beams on each side of the bar."""
    beam_length: Length
    """Length of one beam."""
    beam_width: Length
    """Width of one beam, in the plane of motion."""
    beam_gap: Length
    """Distance between two beams."""
    bar_width: Length
    """Width of a beam as measured along the bar; beams stand beam_gap + bar_width/2 apart."""
    bar_half_height: Length
    """Distance from the bar's middle line to the roots of its beams."""
    beam_angle: Annotated[Quantity, In("rad", positive=True, high=0.5)]
    """Angle of the beams to the normal of the bar; the force grows with its sine."""
    thickness: Length
    """Of the beams along z, across the plane of motion."""

    def compliance(self, p: SimpleNamespace, m: SimpleNamespace) -> Matrix:
        """[C] about the bar's end (6, 6). Source: S1 eq. (5), (6)."""
        return inverse(thermal_actuator.stiffness(SimpleNamespace(**vars(p) | vars(m))))

    def sections(self, p: SimpleNamespace) -> tuple[FlexureSection, ...]:
        """None: what heat and bending make of its stress is not computed."""
        return ()


class ThermalActuator(Section):
    """`[[actuator]]` of kind "thermal": heats the beams of a `bent_beam` element, which push their bar; one-sided, cooled passively."""

    name: Name
    """Of the axis and its heater."""
    kind: Literal["thermal"]
    """A heater."""
    on: str
    """The bent_beam element that is heated."""
    ambient: Annotated[Quantity, In("degC", low=200.0, high=400.0)]
    """Temperature at which the beams are without force and to which they cool."""
    temperature_limit: Annotated[Quantity, In("degC", positive=True, high=3700.0)]  # tungsten melts
    """Largest average temperature of the beams; a limit."""
    thermal_resistance: Annotated[Quantity, In("K/W", positive=True)]
    """Temperature rise per heater power in the steady state."""
    time_constant: Annotated[Quantity, In("ms", positive=True)]
    """Time constant of heating and of cooling, first order."""
    power_limit: Annotated[Quantity, In("W", positive=True)]
    """Largest heater power; the smallest is 0."""
    heater_resistance: Annotated[Quantity, In("ohm", positive=True)] | None = None
    """Where it is given, the drive is the heater's voltage, P = V^2/R; left out: its power."""
    travel: Travel
    """Largest travel of the bar to both sides, as others may push it back, or its ends, such as ["0 um", "60 um"]; a limit."""
    pattern: str = ""
    """The pattern by which it is copied."""

    @model_validator(mode="after")
    def _heats(self) -> ThermalActuator:
        if self.temperature_limit.si <= self.ambient.si:
            raise ValueError("temperature_limit: must be above ambient, because a heater can only heat")
        return self
