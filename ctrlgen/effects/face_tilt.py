"""The face that an autocollimator reads does not stand square: the turn about its own axis shows in the reading."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class FaceTilt(Effect):
    """Delta theta_a = -eta theta_b: an autocollimator reads the turn about a from a face whose normal should be b and leans by eta toward
    a, n = e_b + eta e_a; of the change theta x n it sees theta_a n_b - theta_b n_a.

    Holds for small eta: the neglected part is eta^2/2 of the angle. Second order of the rotation itself is `autocollimator`.
    """

    place = Place.SENSOR
    family = Family.GEOMETRY
    pairs = True
    channel_unit = "rad"
    partner_unit = "channel"
    source = "S0 section 3.2 and Fig. 5: an autocollimator on faces of a cube that are orthogonal within 1.4E-3 deg"
    params = (
        Param("tilt", "mrad", (-100.0, 100.0), "lean of the face's normal toward the axis that is read", off=0.0),
    )

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.tilt * s.all[s.partner]
