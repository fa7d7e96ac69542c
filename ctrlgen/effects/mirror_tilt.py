"""A mirror that an interferometer reads does not stand square: another direction shows in the reading."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class MirrorTilt(Effect):
    """Delta y_a = eps y_b: the beam along a meets a plane mirror whose normal leans by eps toward b, n = e_a + eps e_b, and reads the
    motion along that normal, n . delta.

    Holds for small eps: the neglected part is eps^2/2 of the motion. Two faces of a cube that are a right angle less eps have one such
    number. What the mirror's rotation adds is `plane_mirror`; what the same lean does to an autocollimator is `face_tilt`.
    """

    place = Place.SENSOR
    family = Family.GEOMETRY
    pairs = True
    channel_unit = "m"
    partner_unit = "channel"
    source = "S0 section 3.1: interferometers on the faces of a cube, which are orthogonal within 1.4E-3 deg"
    params = (
        Param("tilt", "mrad", (-100.0, 100.0), "lean of the mirror's normal toward the other direction", off=0.0),
    )

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.tilt * s.all[s.partner]
