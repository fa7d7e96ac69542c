"""An amplifier, or its filter, of limited bandwidth."""

from ctrlgen.effects import Param, Place
from ctrlgen.effects._second_order import DAMPING, TAU, SecondOrderFilter


class AmplifierLag(SecondOrderFilter):
    """tau dw/dt = v, tau dv/dt = u - w - 2 D v, Delta u = g (w - u): g = 1 is a second-order amplifier; below, only that share is late.

    A large D is a single pole of time constant 2 D tau: a source's resistance and a piezo's capacitance, a coil's inductance over its
    resistance. A heated actuator, slow by itself, has `second_pole`. Holds below the amplifier's rate and limit.
    """

    place = Place.DRIVE
    order = 1  # of what is clipped, slews and is scaled
    requires = frozenset({"actuator", "unheated"})
    source = "A. J. Fleming, K. K. Leang, Design, Modeling and Control of Nanopositioning Systems (2014), ch. 14: electrical considerations"
    params = (Param("share", "1", (-0.5, 1.5), "share of the drive that is late", off=0.0), TAU, DAMPING)
