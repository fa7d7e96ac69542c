"""A lever that gives way under the force it carries."""

from ctrlgen.effects import Effect, Param, Place


class LostMotion(Effect):
    """Delta d = -c F, F the force that the stage takes at d. The lever bends by c F before the stage moves.

    On a stage with constant stiffness the same as a lever ratio; on one that stiffens it grows along the stroke.
    Holds for elastic levers and c F below a tenth of d.
    """

    place = Place.DISPLACEMENT
    requires = frozenset({"force"})
    source = "S. T. Smith, Flexures: Elements of Elastic Mechanisms (2000): levers"
    params = (Param("compliance", "um/N", (-100.0, 100.0), "lost travel per force", off=0.0),)

    def term(self, s, p):
        return -p.compliance * s.force
