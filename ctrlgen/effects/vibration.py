"""A vibration of one frequency in the reading."""

import math
from typing import ClassVar

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, State, itself


class Vibration(Effect):
    """Delta y = A sin(2 pi f t + phi), t from the common zero of the records' clock.

    Holds for a steady source, such as mains or a pump; one frequency an effect.
    """

    place = Place.SENSOR
    family = Family.EVENTS
    source = "definition"
    params = (
        Param("amplitude", "channel", (-1.0, 1.0), "amplitude of the vibration", off=0.0),
        Param("frequency", "Hz", (1e-6, 1e9), "frequency of the vibration"),
        Param("phase", "deg", (-360.0, 360.0), "phase at time zero"),
    )
    at_bounds = itself("frequency", "phase")
    states: ClassVar[tuple[State, ...]] = (State("t", "s", 1.0, clock=True),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.amplitude * ca.sin(2 * ca.pi * p.frequency * s.states.t + p.phase)


class VibrationPerRecord(Vibration):
    """Delta y = A sin(2 pi f t + phi + theta), d theta/dt = 0: theta is constant within a record, another in each, and fitted there.

    Nothing starts a recorder on the phase of the mains. Holds as `vibration`; outside a diagnosis theta = 0.
    """

    title = "A vibration of one frequency in the reading, of another phase in each record"
    states = (*Vibration.states, State("theta", "1", 2 * math.pi, per_record=True, arbitrary=True))

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.amplitude * ca.sin(2 * ca.pi * p.frequency * s.states.t + p.phase + s.states.theta)
