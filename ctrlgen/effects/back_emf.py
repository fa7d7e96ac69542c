"""A coil at a voltage: its current comes late, and its motion takes part of the voltage."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, ShapeBounds, State


class BackEmf(Effect):
    """tau dw/dt = u - e v - w, Delta u = g (w - u): w is the voltage at the coil's resistance, tau = L/R; g = 1: all of the drive.

    From L di/dt + R i + e v = u, w = R i, on a device whose force goes with u: the back EMF damps by e k_f, and no longer above 1/tau.
    Holds for an amplifier that gives a voltage, and an inductance that is the same everywhere.
    """

    place = Place.DRIVE
    family = Family.TIMING
    order = 1  # as `amplifier_lag`
    requires = frozenset({"actuator", "unheated", "velocity", "voltage"})
    source = "R. Munnig Schmidt, G. Schitter, J. van Eijk, The Design of High Performance Mechatronics (2014): Lorentz actuators"
    params = (
        Param("share", "1", (0.0, 1.5), "g: 1 for a coil at the voltage of the drive", off=0.0),
        Param("emf", "channel*s/travel", (1e-4, 10.0), "e: voltage per speed, as large as the force per current"),
        Param("tau", "s", (1e-4, 1e2), "L/R", paced=True),
    )
    at_bounds = {
        "emf": ShapeBounds(low="amplifier_lag", untold="amplifier_lag"),
        "tau": ShapeBounds(low="viscous damping"),
    }
    states = (State("w", "channel", 1.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.share * (s.states.w - s.value)

    def rates(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        return {"w": (s.value - p.emf * s.velocity - s.states.w) / p.tau}
