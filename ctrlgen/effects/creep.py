"""A flexure or its glue keeps moving after the load has settled."""

from ctrlgen.effect import Effect, Param, Place, State


class Creep(Effect):
    """dz/dt = (d - z)/tau, Delta d = g z: one relaxation.

    Holds for holds between 0.1 tau and 10 tau; use several, a decade apart, for logarithmic creep.
    """

    place = Place.DISPLACEMENT
    rough = 0.01
    family = "creep"
    source = "W. N. Findley et al., Creep and Relaxation of Nonlinear Viscoelastic Materials (1976), standard solid"
    params = (
        Param("gain", "1", (0.0, 0.2), "extra travel after infinite time, per travel", off=0.0),
        Param("tau", "s", (1e-3, 1e5), "relaxation time", grid=(0.03, 0.3, 3.0, 30.0, 300.0)),
    )
    states = (State("z", "travel", 1.0),)

    def term(self, s, p):
        return p.gain * s.z

    def rates(self, s, p):
        return {"z": (s.value - s.z) / p.tau}
