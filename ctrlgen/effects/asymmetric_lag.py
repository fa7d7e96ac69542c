"""Asymmetric hysteresis of a joint or a stack: the loop is wider on one of its branches or sides."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, Plainer, itself
from ctrlgen.effects._play_operators import BESIDE_GAIN, NO_LAG, kept_between, play_states, radii, weighted_lag


class AsymmetricLag(Effect, listed=False):
    """Delta s = g (sum_j w_j P_j - s + k s), P_j within s - a_j ... s + b_j, r_j = r j/8, w_j ~ j^-q, sum w_j = 1, j = 1..8.
    a_j = r_j + (l |s| + t s) r_j/r and b_j = r_j + (u |s| + t s) r_j/r, no less than 0: generalised plays, whose edges widen each in
    its own way. Holds for |u| + |t| and |l| + |t| below 1: the edges then rise with s, and no way between two samples matters.
    """

    order = 1
    source = "M. Al Janaideh, S. Rakheja, C.-Y. Su, IEEE/ASME Trans. Mechatron. 16 (2011) 734: generalised plays"
    at_bounds = {"reach": NO_LAG, "reversible": BESIDE_GAIN, **itself("taper", "upper", "lower", "side")}
    family = Family.HYSTERESIS

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.share * (weighted_lag(s, s.value, p.reach, p.taper) - p.reversible * s.value)

    def update(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        widths = radii(p.reach)
        a, b = (ca.fmax(1 + (rise * ca.fabs(s.value) + p.side * s.value) / p.reach, 0.0) for rise in (p.lower, p.upper))
        return kept_between(s, [s.value - a * r for r in widths], [s.value + b * r for r in widths], widths)


def _shape(unit: str) -> tuple[Param, ...]:
    return (
        Param("reach", unit, (1e-4, 10.0), "r: way after which all plays follow, at home"),
        Param("taper", "1", (-3.0, 3.0), "q: weight of the narrow plays over the wide ones"),
        Param("reversible", "1", (-0.5, 1.5), "k: reversible part over the share that lags"),
        Param("upper", "1", (-0.6, 0.6), "u: widening of the branch that comes down, per way from home"),
        Param("lower", "1", (-0.6, 0.6), "l: widening of the branch that goes up, per way from home"),
        Param("side", "1", (-0.35, 0.35), "t: widening of both toward the positive side"),
    )


class AsymmetricDisplacementHysteresis(AsymmetricLag):
    """s = d, the displacement, Delta d as of `AsymmetricLag`; in a set of poses the memory goes from pose to pose. Holds as above."""

    title = "Asymmetric hysteresis of a joint behind the stage"
    place = Place.DISPLACEMENT
    requires = frozenset({"actuator"})
    params = (Param("share", "1", (-0.999, 0.999), "share of the displacement that lags", off=0.0), *_shape("travel"))
    plainer = Plainer("displacement_hysteresis", {"upper": 0.0, "lower": 0.0, "side": 0.0})
    states = play_states("travel")


class AsymmetricDriveHysteresis(AsymmetricLag):
    """s = u, the drive: Delta u as of `AsymmetricLag`. Holds as above, on actuators that push."""

    title = "Asymmetric hysteresis of a piezo stack"
    place = Place.DRIVE
    requires = frozenset({"actuator", "force"})
    params = (Param("share", "1", (-0.999, 0.999), "share of the drive that lags", off=0.0), *_shape("channel"))
    plainer = Plainer("drive_hysteresis", {"upper": 0.0, "lower": 0.0, "side": 0.0}, left={"reversible": "drive_gain"})
    states = play_states("channel")
