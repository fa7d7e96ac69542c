"""Creep that never ends: as much in every decade of time."""

from ctrlgen.effect import Effect, Param, Place, State

TIMES = tuple(10 ** (j / 2) for j in range(7))  # of relaxation, per shortest one


class LogCreep(Effect):
    """dz_j/dt = (d - z_j)/(10^(j/2) tau), Delta d = g/2 sum_j z_j, j = 0..6: from 3 tau to 100 tau after a step
    d g (log10(t/tau) + 0.5), within one percent of a decade's.

    Holds from tau to 1000 tau.
    """

    place = Place.DISPLACEMENT
    rough = 0.01
    family = "creep"
    source = "H. Jung, D.-G. Gweon, Rev. Sci. Instrum. 71 (2000) 1896: creep of piezoelectric actuators"
    params = (
        Param("gain", "1", (0.0, 0.1), "extra travel per decade of time, per travel", off=0.0),
        Param("tau", "s", (1e-3, 1e2), "shortest relaxation time", grid=(0.01, 0.1, 1.0)),
    )
    states = tuple(State(f"z{j}", "travel", 1.0) for j in range(len(TIMES)))

    def term(self, s, p):
        return p.gain / 2 * sum(getattr(s, state.name) for state in self.states)

    def rates(self, s, p):
        slow = zip(self.states, TIMES, strict=True)
        return {z.name: (s.value - getattr(s, z.name)) / (times * p.tau) for z, times in slow}
