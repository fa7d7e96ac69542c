"""What a drive does is no straight line: the first even and the first odd term of a curve."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class SquareDrive(Effect):
    """Delta u = c u^2. Holds while c u is a few tenths; with |c u| > 1/2 more drive would do less."""

    title = "A drive that does more one way than the other: the first even term of its curve"
    place = Place.DRIVE
    family = Family.DRIVE
    requires = frozenset({"actuator"})
    source = "definition; the attraction of a magnet or a plate about a bias: S. D. Senturia, Microsystem Design (2001)"
    params = (Param("curvature", "1/channel", (-0.5, 0.5), "nonlinearity per drive squared", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.curvature * s.value**2


class CubicDrive(Effect):
    """Delta u = c u^3. Holds while c u^2 is a few tenths; with c u^2 < -1/3 more drive would do less."""

    title = "A drive whose gain falls, or rises, with its size"
    place = Place.DRIVE
    family = Family.DRIVE
    requires = frozenset({"actuator"})
    source = "definition; iron: R. Isermann, Fault-Diagnosis Systems (2006): actuators"
    params = (Param("curvature", "1/channel^2", (-0.3, 0.3), "nonlinearity per drive cubed", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.curvature * s.value**3
