"""A motor whose force constant changes along the travel: the force factor Bl(x) of a voice coil, a galvanometer, a solenoid."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, itself


class ForceFactor(Effect):
    """Delta F = -b (d - d_0)^2 F: the force constant is k_f (1 - b (d - d_0)^2), at d_0 the one stated and largest, for b < 0 least.

    The second order of Bl(x) about its largest value, as the coil leaves the field of the gap. Holds where less than half of the force
    is lost. The force goes with the drive at every place, where that of a stiffening flexure goes with the place at every drive.
    """

    title = "A motor whose force constant changes along the travel"
    place = Place.FORCE
    family = Family.DRIVE
    requires = frozenset({"actuator", "force"})
    source = "W. Klippel, J. Audio Eng. Soc. 54 (2006) 907: loudspeaker nonlinearities, force factor Bl(x)"
    params = (
        Param("fall", "1/travel^2", (-2.0, 2.0), "b: share of the force that is lost, per square of the way", off=0.0),
        Param("centre", "travel", (-2.0, 2.0), "d_0: where the force constant is the one stated"),
    )
    at_bounds = itself("centre")

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.fall * (s.displacement - p.centre) ** 2 * s.value
