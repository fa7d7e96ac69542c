"""An amplifier whose output changes at most so fast."""

from ctrlgen.effects import Param, itself
from ctrlgen.effects._slewing import SHARE, Slewing


class SlewRate(Slewing):
    """dv/dt = R sign(u - v) until v = u; Delta u = g (v - u): g = 1 is limited throughout.

    Holds for a rate that is the same both ways and a drive held from sample to sample.
    """

    params = (SHARE, Param("rate", "channel/s", (1e-3, 1e6), "R: fastest change of what is delivered", paced=True))
    at_bounds = itself("rate")
