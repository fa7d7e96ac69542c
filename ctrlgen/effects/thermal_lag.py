"""A share of the actuator's action that needs time to build up."""

from ctrlgen.effect import Effect, Param, Place, State


class ThermalLag(Effect):
    """dw/dt = (u - w)/tau, Delta u = g (w - u): a share g of the drive acts late.

    Holds for one thermal mass. A heated actuator has its own time constant, and `second_pole` for another one.
    """

    place = Place.DRIVE
    needs = frozenset({"actuator", "unheated"})
    source = "definition: one thermal mass"
    params = (
        Param("share", "1", (-0.5, 1.0), "part that acts late", off=0.0),
        Param("tau", "s", (1e-3, 1e4), "time constant", grid=(0.01, 0.05, 0.3, 1.0, 3.0, 10.0, 60.0)),
    )
    states = (State("w", "channel", 1.0),)

    def term(self, s, p):
        return p.share * (s.w - s.value)

    def rates(self, s, p):
        return {"w": (s.value - s.w) / p.tau}
