"""A guide that is wavy: the stage moves across as it goes along another axis."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, itself


class Waviness(Effect):
    """Delta y_i = A sin(2 pi y_j/Lambda + phi): the straightness of axis j, seen across it by the reading of axis i. One wave an effect.

    Balls that come round, a screw that is bent and wires of a guide repeat after their own ways. Holds while the stage follows its
    guide; of a slow bend `arcuate_motion` says as much.
    """

    place = Place.SENSOR
    family = Family.CROSS_TALK
    pairs = True
    channel_unit = "m"
    partner_unit = "m"
    source = "A. H. Slocum, Precision Machine Design (1992), ch. 2: straightness errors of a linear axis"
    params = (
        Param("amplitude", "channel", (-1.0, 1.0), "largest deviation across", off=0.0),
        Param("period", "partner", (1e-4, 10.0), "way of the other axis after which it repeats"),
        Param("phase", "deg", (-360.0, 360.0), "phase at home of the other axis"),
    )
    at_bounds = itself("period", "phase")

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.amplitude * ca.sin(2 * ca.pi * s.all[s.partner] / p.period + p.phase)
