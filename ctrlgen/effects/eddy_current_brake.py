"""A viscous force that falls above a speed: an eddy-current brake, or grease that shears thin."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, ShapeBounds

_STEADY = "viscous damping"


class EddyCurrentBrake(Effect):
    """Delta F = -c v / (1 + (v/v_0)^2): damping c at low speed, the largest force c v_0/2 at the critical speed v_0, less beyond.

    It always dissipates. Holds for a conductor that is thinner than the depth to which its currents reach.
    """

    title = "A viscous force that falls above a speed: eddy-current braking, or grease that shears thin"
    place = Place.FORCE
    family = Family.DYNAMICS
    requires = frozenset({"velocity"})
    source = "J. H. Wouterse, IEE Proc. B 138 (1991) 153: critical torque and speed of an eddy current brake"
    params = (
        Param("damping", "channel*s/travel", (0.0, 100.0), "c: damping at low speed", off=0.0),
        Param("speed", "travel/s", (1e-4, 100.0), "v_0: critical speed, at which the force is largest"),
    )
    at_bounds = {"speed": ShapeBounds(high=_STEADY, untold=_STEADY, as_size=_STEADY)}

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.damping * s.velocity / (1 + (s.velocity / p.speed) ** 2)
