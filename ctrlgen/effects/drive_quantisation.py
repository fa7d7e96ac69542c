"""A drive in steps: a converter of few bits, pulses of few widths, commands that are rounded on their way."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, itself


class DriveQuantisation(Effect):
    """Delta u = g q S(u/q - p), S(x) = -atan(r sin(2 pi x)/(1 + r cos(2 pi x)))/pi, r = 1 - e: the levels q (k + p), the nearest acts.

    e rounds the jumps over about e of a step, as noise of the drive does, so that there is a slope along q; with e = 0 S would be
    round(x) - x, and 1e-6 is that. What is cut off, and not rounded, has p = 1/2 and a `drive_offset` of -q/2 beside it. Holds for steps
    that are all alike and levels that are taken at once. No controller can drive between the levels: it leaves the law out.
    """

    place = Place.DRIVE
    family = Family.DRIVE
    order = -3  # what is limited or scaled is what the converter gives
    requires = frozenset({"actuator", "sample_time"})
    inverted = False
    source = "B. Widrow, I. Kollar, Quantization Noise (2008)"
    params = (
        Param("share", "1", (0.0, 1.5), "g: 1 where every drive is one of the levels", off=0.0),
        Param("quantum", "channel", (1e-6, 0.5), "q: step"),
        Param("grid", "1", (-1.5, 1.5), "p: from zero drive to the nearest level, in steps"),
        Param("rounding", "1", (1e-6, 0.5), "e: share of a step over which it jumps"),
    )
    at_bounds = itself("quantum", "grid", "rounding")

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        angle, most = 2 * ca.pi * (s.value / p.quantum - p.grid), 1 - p.rounding
        return -p.share * p.quantum / ca.pi * ca.atan(most * ca.sin(angle) / (1 + most * ca.cos(angle)))
