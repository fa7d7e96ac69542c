"""A number of the machine that changes with the temperature of the surroundings: of a drive, a spring or a scale."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class GainOfTemperature(Effect):
    """Delta u = c T u, T the rise of the surroundings' temperature above the one at which the drive does what the file says.

    Holds while c T is a few tenths and the surroundings change slowly against what they warm: a magnet, a ceramic.
    """

    title = "A drive whose gain changes with the temperature of the surroundings"
    place = Place.DRIVE
    family = Family.THERMAL
    requires = frozenset({"actuator", "ambient"})
    source = "definition; magnets lose 0.1 %/K: IEC 60404-8-1:2015"
    params = (Param("slope", "1/K", (-0.05, 0.05), "relative change of the drive per kelvin", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.slope * s.ambient * s.value


class StiffnessOfTemperature(Effect):
    """Delta F = -c T F_s(d), T the rise of the surroundings' temperature above the one at which the file's stiffness holds, F_s the force
    that the stage takes.

    Holds while c T is a few tenths and the surroundings change slowly against the flexure that they warm.
    """

    title = "A stage whose stiffness changes with the temperature of the surroundings"
    place = Place.FORCE
    family = Family.THERMAL
    requires = frozenset({"force", "ambient"})
    source = "definition; Young's modulus of metals falls by 0.02 to 0.06 %/K, of plastics by more"
    params = (Param("slope", "1/K", (-0.05, 0.05), "relative change of the stiffness per kelvin", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.slope * s.ambient * s.force


class ScaleOfTemperature(Effect):
    """Delta y = c T y, T the rise of the surroundings' temperature above the one at which the scale is right.

    Holds while the surroundings change slowly against what they warm: a scale or a screw that grows, a sensor's sensitivity.
    """

    title = "A scale or a screw that grows with the temperature of the surroundings"
    place = Place.SENSOR
    family = Family.THERMAL
    requires = frozenset({"ambient"})
    source = "definition; steel grows by 11 um/(m*K): ISO 230-3:2020"
    params = (Param("slope", "1/K", (-0.05, 0.05), "relative change of the reading per kelvin", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.slope * s.ambient * s.value
