"""A sensor with curvature: the first even term of its nonlinearity."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class Bow(Effect):
    """Delta y = b y^2. Holds while the sensor's nonlinearity is a few per cent of the reading; with |b| > 1/2 the reading would turn
    back within its range.
    """

    place = Place.SENSOR
    family = Family.GEOMETRY
    order = -1  # before `cyclic`: the fringes of a bent scale are counted along the bent scale
    source = "A. J. Fleming, Sensors and Actuators A 190 (2013) 106: calibration and nonlinearity"
    params = (Param("curvature", "1/channel", (-0.5, 0.5), "nonlinearity per reading squared", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.curvature * s.value**2
