"""A coil that its own current heats: the same voltage drives it less."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, State, itself


class CoilHeating(Effect):
    """dw/dt = (u^2/(1 + c w) - w)/tau, Delta u = -u c w/(1 + c w): the resistance rises by the share c w.

    Power compression: copper gains 0.39 % of its resistance a kelvin, and the power of a voltage, of which w is the lagged one in terms of
    the cold coil, falls as the resistance rises. Holds for one thermal mass, at the temperature of its surroundings when a record begins,
    well below the corner L/R, and for no amplifier that controls the current.
    """

    place = Place.DRIVE
    family = Family.THERMAL
    requires = frozenset({"actuator", "unheated", "voltage"})
    source = "D. J. Button, J. Audio Eng. Soc. 40 (1992) 32: heat dissipation and power compression in loudspeakers"
    params = (
        Param("rise", "1/channel^2", (-0.1, 1.0), "c: relative rise of the resistance per voltage squared", off=0.0),
        Param("tau", "s", (1e-2, 1e5), "time constant", paced=True),
    )
    at_bounds = itself("tau")
    states = (State("w", "channel^2", 1.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -s.value * p.rise * s.states.w / (1 + p.rise * s.states.w)

    def rates(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        return {"w": (s.value**2 / (1 + p.rise * s.states.w) - s.states.w) / p.tau}
