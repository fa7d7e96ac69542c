"""A flexure or its glue keeps moving after the load has settled."""

from ctrlgen.effects import Effect, Param, Place, State

RATIO = 4.0  # of the two relaxation times: between them lie two octaves, which a mixture of both spans evenly


class Creep(Effect):
    """dz/dt = (d - z)/tau, dw/dt = (d - w)/(4 tau), Delta d = g ((1 - s) z + s w): a chain of two relaxations.

    Holds for holds between 0.1 tau and 10 tau; s = 0 is one relaxation alone. Over more decades creep is logarithmic.
    """

    place = Place.DISPLACEMENT
    source = (
        "W. N. Findley et al., Creep and Relaxation of Nonlinear Viscoelastic Materials (1976), chain of Kelvin solids"
    )
    params = (
        Param("gain", "1", (0.0, 1.0), "extra travel after infinite time, per travel", off=0.0),
        Param("tau", "s", (1e-3, 1e5), "relaxation time"),
        Param("slow", "1", (0.0, 0.5), "s: part of it that takes four times as long"),
    )
    states = (State("z", "travel", 1.0), State("w", "travel", 1.0))

    def term(self, s, p):
        return p.gain * ((1 - p.slow) * s.z + p.slow * s.w)

    def rates(self, s, p):
        return {"z": (s.value - s.z) / p.tau, "w": (s.value - s.w) / (RATIO * p.tau)}
