"""Creep by the same amount in every decade of time."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, LawInputs, LawNumbers, Param, Place, State

TIMES = tuple(10 ** (j / 2) for j in range(9))  # relaxation times per shortest one


class LogCreep(Effect):
    """dz_j/dt = (d - z_j)/(10^(j/2) tau), Delta d = g/2 sum_j w_j z_j, w_j = min(max(2 D - j, 0), 1), j = 0..8.

    After a step d: g d (log10(t/tau) + 1/2) from 3 tau to 10^(D - 1.5) tau, to 3 % of one decade's creep; D g d in the end.
    Holds from tau to 10^4 tau.
    """

    place = Place.DISPLACEMENT
    order = 2  # what creeps is carried by the joints: behind their play and hysteresis
    source = "H. Jung, D.-G. Gweon, Rev. Sci. Instrum. 71 (2000) 1896: creep of piezoelectric actuators"
    params = (
        Param("gain", "1", (0.0, 0.5), "extra travel per decade of time, per travel", off=0.0),
        Param("tau", "s", (1e-3, 1e2), "shortest relaxation time"),
        Param("decades", "1", (1.0, 4.5), "D: decades after which it ends"),
    )
    states = tuple(State(f"z{j}", "travel", 1.0) for j in range(len(TIMES)))

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        weights = [ca.fmin(ca.fmax(2 * p.decades - j, 0.0), 1.0) for j in range(len(TIMES))]
        return p.gain / 2 * sum(w * getattr(s.states, z.name) for w, z in zip(weights, self.states, strict=True))

    def rates(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        slow = zip(self.states, TIMES, strict=True)
        return {z.name: (s.value - getattr(s.states, z.name)) / (times * p.tau) for z, times in slow}
