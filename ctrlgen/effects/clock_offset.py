"""Two recorders whose clocks do not agree"""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class ClockOffset(Effect):
    """y(t) = reading under u(t + tau), tau > 0: the readings come before the drive that causes them, as from two recorders that
    were started one after the other. Holds for clocks that run alike.

    A property of how a recording was made, not of the device: it shifts the recorded drive in simulations of recordings (see
    `estimation.simulator`) and adds nothing to the model's equations, so the C does not change. A reading that comes late is a
    `delay`.
    """

    place = Place.SENSOR
    family = Family.TIMING
    requires = frozenset({"sample_time"})
    source = "definition"
    params = (Param("offset", "ms", (0.0, 3.6e6), "how far the readings are ahead of the drive", off=0.0),)
    shifts_drive = True
    moves_in_time = True
    late_by = -1.0

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return 0.0 * p.offset
