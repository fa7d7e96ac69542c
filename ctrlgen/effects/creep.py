"""A flexure or its glue keeps moving after the load has settled."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, ShapeBounds, State, itself

RATIO = 4.0  # slow over fast relaxation time: two octaves, which a mixture of the two covers evenly


class Creep(Effect):
    """dz/dt = (d - z)/tau, dw/dt = (d - w)/(4 tau), Delta d = g ((1 - s) z + s w): two relaxations in series with the spring.

    Holds for dwells of 0.1 tau to 10 tau; s = 0 is a single relaxation. Over more decades use `log_creep`.
    """

    place = Place.DISPLACEMENT
    family = Family.CREEP
    order = 2  # what creeps is carried by the joints: behind their play and hysteresis
    source = (
        "W. N. Findley et al., Creep and Relaxation of Nonlinear Viscoelastic Materials (1976), chain of Kelvin solids"
    )
    params = (
        Param("gain", "1", (0.0, 3.0), "extra travel after infinite time, per travel", off=0.0),
        Param("tau", "s", (1e-3, 1e5), "relaxation time", paced=True),
        Param("slow", "1", (0.0, 0.5), "s: share that relaxes four times as slowly"),
    )
    # what has followed within a millisecond crept nowhere
    at_bounds = {"tau": ShapeBounds(low="a gain, or a lag"), **itself("slow")}
    states = (State("z", "travel", 1.0), State("w", "travel", 1.0))

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.gain * ((1 - p.slow) * s.states.z + p.slow * s.states.w)

    def rates(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        return {"z": (s.value - s.states.z) / p.tau, "w": (s.value - s.states.w) / (RATIO * p.tau)}
