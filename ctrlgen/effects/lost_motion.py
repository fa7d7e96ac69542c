"""A lever that bends under the force it transmits."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class LostMotion(Effect):
    """Delta d = -c F, F is the force that the stage takes at d: the lever bends by c F before the stage moves.

    On a stage of constant stiffness it equals a wrong lever ratio; on one that stiffens it grows along the stroke.
    Holds for elastic levers and c F below a tenth of d.
    """

    place = Place.DISPLACEMENT
    family = Family.ELASTIC
    requires = frozenset({"force"})
    source = "S. T. Smith, Flexures: Elements of Elastic Mechanisms (2000): levers"
    params = (Param("compliance", "travel/force", (-5.0, 5.0), "lost travel per force", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.compliance * s.force
