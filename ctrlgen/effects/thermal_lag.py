"""A share of the actuator's action that needs time to build up."""

from ctrlgen.effect import Effect, Param, Place, State


class ThermalLag(Effect):
    """dv/dt = (u - v)/tau, dw/dt = (v - w)/(r tau), Delta u = g (w - u): a share g of the drive acts late.

    Holds for two thermal masses in a row, the second smaller; r = 0.01 is one mass alone, a larger one the rounded onset
    of a long body. A heated actuator has its own time constant, and `second_pole` for another one.
    """

    place = Place.DRIVE
    stage = 1
    rough = 0.02
    needs = frozenset({"actuator", "unheated"})
    source = "J. H. Lienhard, A Heat Transfer Textbook (2019), chapter 5: lumped bodies"
    params = (
        Param("share", "1", (0.0, 1.2), "part that acts late", off=0.0),
        Param("tau", "s", (1e-3, 1e4), "time constant", grid=(0.01, 0.05, 0.3, 1.0, 3.0, 10.0, 60.0)),
        Param("second", "1", (0.01, 1.0), "r: the second time constant, per first", grid=(0.05, 0.3)),
    )
    states = (State("v", "channel", 1.0), State("w", "channel", 1.0))

    def term(self, s, p):
        return p.share * (s.w - s.value)

    def rates(self, s, p):
        return {"v": (s.value - s.v) / p.tau, "w": (s.v - s.w) / (p.second * p.tau)}
