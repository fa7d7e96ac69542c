"""An amplifier that delivers more or less than it is told."""

from ctrlgen.effects import Effect, Param, Place


class DriveGain(Effect):
    """Delta u = g u. Holds while the amplifier is linear, that is below its saturation."""

    place = Place.DRIVE
    requires = frozenset({"actuator"})
    source = "definition"
    params = (Param("gain", "1", (-0.5, 0.5), "relative excess of the delivered drive", off=0.0),)

    def term(self, s, p):
        return p.gain * s.value
