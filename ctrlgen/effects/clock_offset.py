"""Two recorders whose clocks do not agree"""

from ctrlgen.effects import Effect, Param, Place


class ClockOffset(Effect):
    """y(t) = reading under u(t + tau): the recorder of the readings is late by tau on the drive's clock. Holds for clocks that
    run alike.

    A property of how a recording was made, not of the device: it shifts the recorded drive in simulations of recordings (see
    `estimation.simulator`) and adds nothing to the model's equations, so the C does not change. A reading that comes late can
    be a `delay` as well; one that comes early can be nothing else.
    """

    place = Place.SENSOR
    requires = frozenset({"sample_time"})
    source = "definition"
    params = (Param("offset", "ms", (-50.0, 50.0), "how far the readings are ahead of the drive", off=0.0),)
    shifts_drive = True

    def term(self, s, p):
        return 0.0 * p.offset
