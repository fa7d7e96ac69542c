"""A sensor that flattens, or steepens, toward both ends of its range."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class CubicSensor(Effect):
    """Delta y = c y^3. Holds while the sensor's nonlinearity is a few per cent of the reading."""

    place = Place.SENSOR
    family = Family.GEOMETRY
    order = -1  # before `cyclic`: the fringes of a bent scale are counted along the bent scale
    source = "A. J. Fleming, Sensors and Actuators A 190 (2013) 106: calibration and nonlinearity"
    params = (Param("curvature", "1/channel^2", (-0.3, 0.3), "nonlinearity per reading cubed", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.curvature * s.value**3
