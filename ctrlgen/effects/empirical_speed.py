"""A smooth function of an axis' speed, measured and not explained."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, LawInputs, LawNumbers, Param, Place
from ctrlgen.effects._spline import cubic_spline, weight_params


class EmpiricalSpeed(Effect):
    """Delta y = A S((1 + v/sqrt(v^2 + v_c^2))/2), v the speed of the axis `of`, S a cubic spline of the weights c_1 ... c_17.

    Speeds far below v_c count in proportion, those far above by their direction alone. It names no cause: a diagnosis writes it
    where what is left is a function of speed or of its direction and no law reaches it. Holds up to the speeds recorded.
    """

    place = Place.POSE
    pairs = True
    partner_place = Place.DISPLACEMENT
    requires = frozenset({"velocity"})
    source = "C. de Boor, A Practical Guide to Splines (1978); the weights from a recording"
    params = (
        Param("size", "channel", (0.0, 10.0), "A: what the weights are counted in", off=0.0),
        Param("speed", "travel/s", (1e-5, 1e4), "v_c"),
        *weight_params("weight of one bend, evenly spaced from fast backward to fast forward"),
    )

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        v = s.velocities[s.partner]
        return p.size * cubic_spline((1 + v / ca.sqrt(v**2 + p.speed**2)) / 2, p)
