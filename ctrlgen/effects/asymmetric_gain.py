"""An amplifier, or motor, that is stronger in one direction."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class AsymmetricGain(Effect):
    """Delta u = g |u|: gain 1 + g for u > 0, 1 - g for u < 0. Holds below saturation."""

    place = Place.DRIVE
    family = Family.DRIVE
    requires = frozenset({"actuator", "bipolar"})
    source = "definition"
    params = (Param("gain", "1", (-0.5, 0.5), "half the difference of the gains", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.gain * ca.fabs(s.value)
