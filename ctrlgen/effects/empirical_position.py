"""A smooth function of an axis' displacement, measured and not explained."""

from ctrlgen.effects import Effect, Expression, LawInputs, LawNumbers, Param, Place
from ctrlgen.effects._spline import cubic_spline, weight_params


class EmpiricalPosition(Effect):
    """Delta y = A S((d - l)/w), d the displacement of the axis `of`, S a cubic spline of the weights c_1 ... c_17 over l ... l + w.

    It names no cause: a diagnosis writes it where what is left is a function of a displacement and no law reaches it. Holds in
    the range l ... l + w; beyond, S is held.
    """

    place = Place.POSE
    pairs = True
    partner_place = Place.DISPLACEMENT
    source = "C. de Boor, A Practical Guide to Splines (1978); the weights from a recording"
    params = (
        Param("size", "channel", (0.0, 10.0), "A: what the weights are counted in", off=0.0),
        Param("low", "travel", (-10.0, 10.0), "l: lower end of the range"),
        Param("width", "travel", (1e-4, 20.0), "w: width of the range"),
        *weight_params("weight of one bend, evenly spaced over the range"),
    )

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.size * cubic_spline((s.displacements[s.partner] - p.low) / p.width, p)
