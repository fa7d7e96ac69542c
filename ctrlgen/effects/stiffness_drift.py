"""A stage that softens, or stiffens, in the course of time."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, itself
from ctrlgen.effects._incipient import CLOCK, lost_share


class StiffnessDrift(Effect):
    """Delta F = r T (1 - exp(-t/T)) F_s(d), t from the common zero of the records' clock, F_s the force that the stage takes: it softens
    by r per second at first, by r T in the end.

    With T far beyond the recording it softens steadily. Holds while the change is below 0.3: a flexure that warms, glue that gives way.
    """

    place = Place.FORCE
    family = Family.EVENTS
    requires = frozenset({"force"})
    source = "R. Isermann, Fault-Diagnosis Systems (2006): incipient faults, of a parameter of the process"
    params = (
        Param("rate", "1/s", (-0.1, 0.1), "relative loss of stiffness per time, at first", off=0.0, paced=True),
        Param("levels_off", "s", (0.3, 1e6), "T: time constant with which the loss levels off", paced=True),
    )
    at_bounds = itself("levels_off")
    states = CLOCK

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return lost_share(s, p) * s.force
