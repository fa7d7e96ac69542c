"""A sensor whose scale is off."""

from ctrlgen.effects import Effect, Param, Place


class SensorGain(Effect):
    """Delta y = g y. Holds in the sensor's linear range."""

    place = Place.SENSOR
    source = "definition"
    params = (Param("gain", "1", (-0.5, 0.5), "relative excess of the reading", off=0.0),)

    def term(self, s, p):
        return p.gain * s.value
