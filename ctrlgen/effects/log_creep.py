"""Creep by the same amount in every decade of time."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, itself
from ctrlgen.effects._relaxations import RELAXATIONS, SPECTRUM, relaxation_rates, relaxed, spacing, within


class LogCreep(Effect):
    """dz_j/dt = (d - z_j)/(10^(j s) tau), Delta d = g s sum_j w_j z_j, w_j = min(max(D/s - j, 0), 1), j = 0..8, s = max(1/2, D/9).

    After a step d: g d (log10(t/tau) + s/2 + 1/4) from 3 tau to 10^(D - 1.5) tau, to 3 % of one decade's creep (5 % of it beyond six
    decades); D g d in the end. Holds from tau to 10^D tau.
    """

    place = Place.DISPLACEMENT
    family = Family.CREEP
    order = 2  # what creeps is carried by the joints: behind their play and hysteresis
    source = "H. Jung, D.-G. Gweon, Rev. Sci. Instrum. 71 (2000) 1896: creep of piezoelectric actuators"
    params = (Param("gain", "1", (0.0, 0.5), "extra travel per decade of time, per travel", off=0.0), *SPECTRUM)
    at_bounds = itself("tau", "decades")
    states = RELAXATIONS

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.gain * spacing(p) * relaxed(s, within(p))

    def rates(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        return relaxation_rates(s, p)
