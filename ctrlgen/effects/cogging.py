"""A force that repeats along the way: cogging of a motor, its slots, ripple of a screw."""

import math

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, itself


class Cogging(Effect):
    """F = -A sin(2 pi d/Lambda + phi), of a potential, so that it takes and gives back. One harmonic; several take several effects.

    Holds where a period fits into the travel: part of a longer one is a stiffness and an offset.
    """

    place = Place.FORCE
    family = Family.PERIODIC
    requires = frozenset({"force", "velocity"})  # what stands in balance has a flexure, and no motor with slots
    source = (
        "T. Sebastian, V. Gangla, IEEE Trans. Ind. Appl. 32 (1996) 730: cogging torque, periodic in the slots and poles"
    )
    params = (
        Param("force", "channel", (-2.0, 2.0), "A: largest force", off=0.0),
        Param("period", "travel", (1e-4, 2.0), "Lambda: way of one period"),
        Param("phase", "deg", (-360.0, 360.0), "phi: phase at home"),
    )
    at_bounds = itself("period", "phase")

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.force * ca.sin(2 * math.pi * s.displacement / p.period + p.phase)


class CoggingFromHome(Cogging):
    """F = -A (sin(2 pi d/Lambda + phi) - sin(phi)): home, where the displacement is zero, is where the stage rests with its drive off.

    A spring holds a stage that is pulled into a slot off its own middle. Holds as `cogging`, and where the reading was set to zero there.
    """

    title = "A force that repeats along the way, of a stage whose reading is zero where it rests"
    requires = Cogging.requires | {"actuator"}

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return super().term(s, p) + p.force * ca.sin(p.phase)
