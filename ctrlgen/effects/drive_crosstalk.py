"""What is asked of one actuator acts at another one too: by amplifiers, leads, valves of one supply."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class DriveCrosstalk(Effect):
    """Delta u_i = c u_j: a share of the drive `of` acts at this actuator, in both of its signs; each direction has a number of its own.

    Holds for what acts at once: heat that arrives later is `heat_crosstalk`, a stage that is carried along `coupling`.
    """

    place = Place.DRIVE
    family = Family.CROSS_TALK
    pairs = True
    requires = frozenset({"actuator"})
    source = (
        "definition; the off-diagonal gains of S. Skogestad, I. Postlethwaite, Multivariable Feedback Control (2005)"
    )
    params = (Param("share", "channel/partner", (-0.5, 0.5), "c: drive here per drive of the other actuator", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.share * s.all[s.partner]
