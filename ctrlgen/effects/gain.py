"""A wrong gain: of an amplifier, a lever or a sensor."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class Gain(Effect, listed=False):
    """Delta x = g x, x the signal at the place: one law, named once per place."""

    source = "definition"
    family = Family.GAIN

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.gain * s.value


class DriveGain(Gain):
    """Delta u = g u. Holds while the amplifier is linear, that is below its saturation."""

    title = "An amplifier that delivers more or less than it is told"
    place = Place.DRIVE
    requires = frozenset({"actuator"})
    params = (Param("gain", "1", (-0.5, 0.5), "relative excess of the delivered drive", off=0.0),)


class LeverRatio(Gain):
    """Delta d = g d: the mechanism is carried g further than the stage model says. Holds for small lever angles."""

    title = "A lever whose arms are not as drawn"
    place = Place.DISPLACEMENT
    params = (Param("gain", "1", (-0.3, 0.3), "relative excess of travel", off=0.0),)


class SensorGain(Gain):
    """Delta y = g y. Holds in the sensor's linear range."""

    title = "A sensor whose scale is off"
    place = Place.SENSOR
    params = (Param("gain", "1", (-0.5, 0.5), "relative excess of the reading", off=0.0),)
