"""A constant offset: of an amplifier or a sensor."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class Offset(Effect, listed=False):
    """Delta x = b, x the signal at the place: one law, named once per place."""

    source = "definition"
    family = Family.GAIN

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.offset


class DriveOffset(Offset):
    """Delta u = b, constant. Holds while the amplifier is on, at rest too."""

    title = "An amplifier that delivers something when it is told nothing"
    place = Place.DRIVE
    requires = frozenset({"actuator"})
    params = (Param("offset", "channel", (-0.5, 0.5), "drive at command zero", off=0.0),)


class HomeOffset(Offset):
    """Delta y = b, constant. Holds from the first sample to the last: one that begins later is a `sensor_step`."""

    title = "A sensor that does not read zero at home"
    place = Place.SENSOR
    params = (Param("offset", "channel", (-1e3, 1e3), "reading at home", off=0.0),)
