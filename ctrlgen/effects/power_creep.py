"""Creep that grows as a power of time."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, itself
from ctrlgen.effects._relaxations import CHAIN, RELAXATIONS, SPECTRUM, relaxation_rates, relaxed, spacing, within


class PowerCreep(Effect):
    """The chain of `log_creep` with amplitudes that rise by 10^p in each decade: Delta d = g s sum_j 10^(p s j) w_j z_j.

    t^p = p/Gamma(1 - p) int tau^(p - 1) (1 - exp(-t/tau)) dtau: after a step d it grows as t^p between tau and 10^(D - 1.5) tau; p = 0 is
    `log_creep`, p = 1/3 Andrade's creep; where p < 0 it slows down, as a relaxation does. Holds from tau to 10^D tau.
    """

    place = Place.DISPLACEMENT
    family = Family.CREEP
    order = 2  # as `log_creep`
    source = "E. N. da C. Andrade, Proc. R. Soc. Lond. A 84 (1910) 1: creep as the third root of time"
    params = (
        Param("gain", "1", (0.0, 0.5), "extra travel in the first decade of time, per travel", off=0.0),
        *SPECTRUM,
        Param("exponent", "1", (-0.5, 0.9), "p: exponent of time"),
    )
    at_bounds = itself("tau", "decades", "exponent")
    states = RELAXATIONS

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        rising = [w * 10.0 ** (p.exponent * spacing(p) * j) for j, w in zip(CHAIN, within(p), strict=True)]
        return p.gain * spacing(p) * relaxed(s, rising)

    def rates(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        return relaxation_rates(s, p)
