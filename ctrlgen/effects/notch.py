"""A notch in the drive: the filter with which a controller spares a resonance."""

from ctrlgen.effects import Expression, LawInputs, LawNumbers, Param, Place
from ctrlgen.effects._second_order import DAMPING, TAU, SecondOrderFilter


class Notch(SecondOrderFilter):
    """tau dw/dt = v, tau dv/dt = u - w - 2 D v, Delta u = -2 D g v: a band about 1/(2 pi tau), as wide as 2 D of it, is taken out.

    g = 1 takes out all of its middle. Holds for one notch, whose zeros and poles are at one frequency, below the controller's rate.
    """

    place = Place.DRIVE
    order = 1
    requires = frozenset({"actuator", "unheated"})
    source = (
        "R. Munnig Schmidt, G. Schitter, J. van Eijk, The Design of High Performance Mechatronics (2014): notch filters"
    )
    params = (Param("share", "1", (0.0, 1.5), "g: share of the middle that is taken out", off=0.0), TAU, DAMPING)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -2 * p.damping * p.share * s.states.v
