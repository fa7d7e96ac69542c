"""A sensor that does not read zero at home."""

from ctrlgen.effects import Effect, Param, Place


class HomeOffset(Effect):
    """Delta y = b, constant. Holds from the first sample to the last: one that begins later is a step."""

    place = Place.SENSOR
    source = "definition"
    params = (Param("offset", "channel", (-1e3, 1e3), "reading at home", off=0.0),)

    def term(self, s, p):
        return p.offset
