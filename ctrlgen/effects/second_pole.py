"""A second thermal mass between heater and beams: part of the heat comes late."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, State, itself


class SecondPole(Effect):
    """dw/dt = (P - w)/tau, Delta P = g (w - P): a share g of the power reaches the actuator through a second lag.

    Holds for one more thermal mass; the model needs at least one sample per tau.
    """

    place = Place.HEAT
    family = Family.THERMAL
    requires = frozenset({"heat"})
    source = "J. H. Lienhard, A Heat Transfer Textbook (2019), chapter 5: lumped bodies"
    params = (
        Param("share", "1", (0.0, 1.2), "share of the power that comes late", off=0.0),
        Param("tau", "s", (1e-3, 1e4), "time constant", paced=True),
    )
    at_bounds = itself("tau")
    states = (State("w", "channel", 1.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.share * (s.states.w - s.value)

    def rates(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        return {"w": (s.value - s.states.w) / p.tau}
