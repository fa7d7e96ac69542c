"""A drive that does less, or more, in the course of time: an actuator that loses strength, a screw that warms up."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, itself
from ctrlgen.effects._incipient import CLOCK, lost_share


class Degradation(Effect):
    """Delta u = -r T (1 - exp(-t/T)) u, t from the common zero of the records' clock: r per second at first, r T in the end.

    With T far beyond the recording the loss grows steadily. Holds while the loss is below 0.3.
    """

    place = Place.DRIVE
    family = Family.EVENTS
    requires = frozenset({"actuator"})
    source = "R. Isermann, Fault-Diagnosis Systems (2006): incipient faults"
    params = (
        Param("rate", "1/s", (-0.1, 0.1), "relative loss per time, at first", off=0.0, paced=True),
        Param("levels_off", "s", (0.3, 1e6), "T: time constant with which the loss levels off", paced=True),
    )
    at_bounds = itself("levels_off")
    states = CLOCK

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -lost_share(s, p) * s.value
