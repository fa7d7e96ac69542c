"""Smooth hysteresis whose knee is sharper than an exponential."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, State, either, itself
from ctrlgen.effects._yielding_steps import let_go, taken_up


class YieldingOfPower(Effect, listed=False):
    """dz = dd (1 - (b sgn(dd z) + 1 - b) |z/r|^n); b = beta/(beta + gamma), r^-n = beta + gamma: n = 1 is `bouc_wen`, n large a corner.

    Solved over each step of the displacement to 0.1 % of r, hence rate-independent; |z| is at most r.
    """

    family = Family.HYSTERESIS
    source = "Y. K. Wen, J. Eng. Mech. Div. ASCE 102 (1976) 249, eq. (6); R. Bouc (1967)"
    states = (State("z", "travel", 0.1, stepped=True, free=True), State("d", "travel", 1.0, stepped=True))

    def update(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        step = s.displacement - s.states.d
        way, zeta = ca.fabs(step) / p.reach, ca.sign(step) * s.states.z / p.reach
        to_zero, back = let_go(ca.fmax(-zeta, 0), way, 2 * p.loop - 1, p.power)
        on = taken_up(ca.fmax(zeta, 0), ca.fmax(way - to_zero, 0), p.power)
        return {"z": s.states.z + ca.sign(step) * p.reach * (back + on), "d": s.displacement}


_SHAPE = (
    Param("reach", "travel", (1e-3, 5.0), "travel over which it settles"),
    Param("loop", "1", (0.55, 1.0), "b: share of the law that depends on the direction"),
    Param("power", "1", (1.0, 5.0), "n: how sharp the knee is"),
)


class BoucWenOfPower(YieldingOfPower):
    """F = -k z, z of `YieldingOfPower`: a force that dissipates. Holds for reversals farther apart than a sample."""

    title = "Hysteresis of a material or joint that yields smoothly, at a knee of its own"
    place = Place.FORCE
    requires = frozenset({"force"})
    params = (Param("stiffness", "channel/travel", (0.0, 1e2), "stiffness right after a reversal", off=0.0), *_SHAPE)
    at_bounds = {"reach": either("dry friction, or a spring"), **itself("loop", "power")}

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.stiffness * s.states.z


class DisplacementBoucWenOfPower(YieldingOfPower):
    """Delta d = -g z, z of `YieldingOfPower`: a lag behind the stage; in poses the memory goes from one to the next. Holds as above."""

    title = "A joint behind the stage that yields smoothly, at a knee of its own"
    place = Place.DISPLACEMENT
    order = 1
    requires = frozenset({"actuator"})
    params = (Param("share", "1", (-0.999, 0.999), "share of the displacement that lags", off=0.0), *_SHAPE)
    at_bounds = {"reach": either("a gain"), **itself("loop", "power")}

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.share * s.states.z
