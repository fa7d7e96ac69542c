"""Creep by the same amount in every decade of time."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, State, itself

CHAIN = range(9)


class LogCreep(Effect):
    """dz_j/dt = (d - z_j)/(10^(j s) tau), Delta d = g s sum_j w_j z_j, w_j = min(max(D/s - j, 0), 1), j = 0..8, s = max(1/2, D/9).

    After a step d: g d (log10(t/tau) + s/2 + 1/4) from 3 tau to 10^(D - 1.5) tau, to 3 % of one decade's creep (5 % of it beyond six
    decades); D g d in the end. Holds from tau to 10^D tau.
    """

    place = Place.DISPLACEMENT
    family = Family.CREEP
    order = 2  # what creeps is carried by the joints: behind their play and hysteresis
    source = "H. Jung, D.-G. Gweon, Rev. Sci. Instrum. 71 (2000) 1896: creep of piezoelectric actuators"
    params = (
        Param("gain", "1", (0.0, 0.5), "extra travel per decade of time, per travel", off=0.0),
        Param("tau", "s", (1e-3, 1e2), "shortest relaxation time"),
        Param("decades", "1", (1.0, 7.0), "D: decades after which it ends"),
    )
    at_bounds = itself("tau", "decades")
    states = tuple(State(f"z{j}", "travel", 1.0) for j in CHAIN)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        apart = self._apart(p)
        weights = [ca.fmin(ca.fmax(p.decades / apart - j, 0.0), 1.0) for j in CHAIN]
        return p.gain * apart * sum(w * getattr(s.states, f"z{j}") for j, w in zip(CHAIN, weights, strict=True))

    def rates(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        ratio = 10.0 ** self._apart(p)
        return {f"z{j}": (s.value - getattr(s.states, f"z{j}")) / (ratio**j * p.tau) for j in CHAIN}

    @staticmethod
    def _apart(p: LawNumbers) -> Expression:
        """Decades between two relaxation times: half a one, or more where nine of them have more to cover."""
        return ca.fmax(p.decades / len(CHAIN), 0.5)
