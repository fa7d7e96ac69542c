"""A sensor, or its filter, of limited bandwidth."""

from ctrlgen.effects import Param, Place
from ctrlgen.effects._second_order import DAMPING, TAU, SecondOrderFilter


class LowPass(SecondOrderFilter):
    """tau dw/dt = v, tau dv/dt = y - w - 2 D v, Delta y = g (w - y): g = 1 is a second-order filter; below, only that share is filtered.

    D < 1 rings, D = 1/sqrt(2) is Butterworth's, a large D is a single pole of time constant 2 D tau. Holds where
    the sampling resolves tau.
    """

    place = Place.SENSOR
    order = 2
    source = "A. J. Fleming, Sensors and Actuators A 190 (2013) 106: sensor bandwidth"
    params = (Param("share", "1", (-0.5, 1.5), "share of the reading that is filtered", off=0.0), TAU, DAMPING)
