"""Creep that never ends: as much in every decade of time."""

from ctrlgen.effect import Effect, Param, Place, State

DECADES = 4


class LogCreep(Effect):
    """dz_j/dt = (d - z_j)/(10^j tau), Delta d = g sum_j z_j, j = 0..3: after a step d g log10(t/tau), within 4 %.

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
    states = tuple(State(f"z{j}", "travel", 1.0) for j in range(DECADES))

    def term(self, s, p):
        return p.gain * sum(getattr(s, f"z{j}") for j in range(DECADES))

    def rates(self, s, p):
        return {f"z{j}": (s.value - getattr(s, f"z{j}")) / (10**j * p.tau) for j in range(DECADES)}
