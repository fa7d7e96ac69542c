"""A sensor that does not stand in line with the point it should measure."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class AbbeArm(Effect):
    """Delta y = a theta: the arm a between sensor and point times the rotation `of`.

    Holds for angles below 50 mrad: first order, the neglected part is a theta^2/2. The arm is up to a metre to either side.
    """

    place = Place.SENSOR
    family = Family.GEOMETRY
    pairs = True
    channel_unit = "m"
    partner_unit = "rad"
    source = "J. B. Bryan, Precision Engineering 1 (1979) 129: the Abbe principle revisited"
    params = (Param("arm", "um/urad", (-1.0, 1.0), "distance between sensor and point", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.arm * s.all[s.partner]
