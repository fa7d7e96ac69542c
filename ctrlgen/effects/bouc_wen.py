"""Hysteresis of a material or joint that yields smoothly."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, State, either, itself


class Yielding(Effect, listed=False):
    """dz = dd (1 - (b sgn(dd z) + 1 - b) |z|/r), n = 1; b = beta/(beta + gamma), r = 1/(beta + gamma): one law, named twice.

    Solved exactly over each step of the displacement, hence rate-independent; |z| is at most r. b = 1/2 unloads linearly, b = 1
    is Dahl's law.
    """

    source = "Y. K. Wen, J. Eng. Mech. Div. ASCE 102 (1976) 249; R. Bouc (1967)"
    family = Family.HYSTERESIS
    states = (State("z", "travel", 0.1, stepped=True, free=True), State("d", "travel", 1.0, stepped=True))

    def update(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        step = s.displacement - s.states.d
        way, zeta, c = ca.fabs(step) / p.reach, ca.sign(step) * s.states.z / p.reach, 2 * p.loop - 1
        below, above = ca.fmax(-zeta, 0), ca.fmax(zeta, 0)
        to_zero = ca.log(1 + c * below) / c
        back, on = ca.fmin(way, to_zero), ca.fmax(way - to_zero, 0)
        change = (1 + c * below) * (1 - ca.exp(-c * back)) / c + (1 - above) * (1 - ca.exp(-on))
        return {"z": s.states.z + ca.sign(step) * p.reach * change, "d": s.displacement}


_SHAPE = (
    Param("reach", "travel", (1e-3, 5.0), "travel over which it settles"),
    Param("loop", "1", (0.55, 1.0), "b: share of the law that depends on the direction"),
)


class BoucWen(Yielding):
    """F = -k z, z of `Yielding`: a force, which dissipates for every b in its bounds. Holds for reversals farther apart than a sample."""

    title = "Hysteresis of a material or joint that yields smoothly"
    place = Place.FORCE
    requires = frozenset({"force"})
    params = (Param("stiffness", "channel/travel", (0.0, 1e2), "stiffness right after a reversal", off=0.0), *_SHAPE)
    at_bounds = {"reach": either("dry friction, or a spring"), **itself("loop")}

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.stiffness * s.states.z


class DisplacementBoucWen(Yielding):
    """Delta d = -g z, z of `Yielding`: a lag behind the stage; in a set of poses the memory goes from pose to pose. Holds as above."""

    title = "A joint behind the stage that yields smoothly"
    place = Place.DISPLACEMENT
    order = 1
    requires = frozenset({"actuator"})
    params = (Param("share", "1", (-0.999, 0.999), "share of the displacement that lags", off=0.0), *_SHAPE)
    at_bounds = {"reach": either("a gain"), **itself("loop")}

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.share * s.states.z
