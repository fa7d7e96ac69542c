"""A share of the actuator's action that builds up slowly, as heat spreads through a body."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, State, itself

THIRD = 9 / 25  # third over second time constant: those of a rod heated at one end are as 1, 1/9, 1/25


class ThermalLag(Effect):
    """dv/dt = (u - v)/tau, dw/dt = (v - w)/(r tau), dx/dt = (w - x)/(0.36 r tau), Delta u = g (x - u): a share g acts late.

    The first three factors of 1/cosh(sqrt(s L^2/a)), a rod heated at one end and felt at the other, where r = 1/9; r = 0.01
    is one mass alone. Holds where heat passes one body. For a heated actuator, which has a time constant in its model, use `second_pole`.
    """

    place = Place.DRIVE
    family = Family.THERMAL
    order = 1
    requires = frozenset({"actuator", "unheated"})
    source = "H. S. Carslaw, J. C. Jaeger, Conduction of Heat in Solids (1959), section 3.4: rod, one end insulated"
    params = (
        Param("share", "1", (0.0, 1.2), "share that acts late", off=0.0),
        Param("tau", "s", (1e-3, 1e4), "time constant", paced=True),
        Param("second", "1", (0.01, 1.0), "r: second over first time constant"),
    )
    at_bounds = itself("tau", "second")
    states = (State("v", "channel", 1.0), State("w", "channel", 1.0), State("x", "channel", 1.0))

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.share * (s.states.x - s.value)

    def rates(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        second = p.second * p.tau
        return {
            "v": (s.value - s.states.v) / p.tau,
            "w": (s.states.v - s.states.w) / second,
            "x": (s.states.w - s.states.x) / (THIRD * second),
        }
