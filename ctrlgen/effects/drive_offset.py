"""An amplifier that delivers something when it is told nothing."""

from ctrlgen.effects import Effect, Param, Place


class DriveOffset(Effect):
    """Delta u = b, constant. Holds while the amplifier is on, at rest too."""

    place = Place.DRIVE
    requires = frozenset({"actuator"})
    source = "definition"
    params = (Param("offset", "channel", (-0.5, 0.5), "drive at command zero", off=0.0),)

    def term(self, s, p):
        return p.offset
