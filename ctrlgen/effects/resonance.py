"""A second mass on a spring: a payload, a cable, the frame."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, ShapeBounds, State, itself


class Resonance(Effect):
    """q'' = w^2 (d - q) + 2 zeta w (d' - q'), Delta F = k (q - d) + 2 zeta k/w (q' - d'), w = 2 pi f; its mass is k/w^2.

    States q and p = q'/w. Holds for one mode; the sampling must resolve f.
    """

    place = Place.FORCE
    family = Family.DYNAMICS
    requires = frozenset({"velocity"})
    source = "J. P. Den Hartog, Mechanical Vibrations (1956), chapter 3: two degrees of freedom"
    params = (
        Param("stiffness", "channel/travel", (0.0, 1e2), "spring of the second mass", off=0.0),
        Param("frequency", "Hz", (0.5, 2e3), "resonance with the stage held", paced=True),
        Param("damping", "1", (1e-3, 1.0), "damping ratio"),
    )
    # a mass that stands still is a part of the ground
    at_bounds = {"frequency": ShapeBounds(low="a stiffness or a damping"), **itself("damping")}
    states = (State("q", "travel", 1.0), State("p", "travel", 1.0))

    @classmethod
    def contradiction(cls, p: dict[str, float]) -> str:
        return (
            f"a damping ratio of {p['damping']:.2g} leaves no resonance, only a lag" if p["damping"] > 0.5**0.5 else ""
        )

    @classmethod
    def inertia(cls, numbers: dict[str, float]) -> float | None:
        return float(numbers["stiffness"] / (2 * ca.pi * numbers["frequency"]) ** 2)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        w = 2 * ca.pi * p.frequency
        return p.stiffness * (s.states.q - s.displacement + 2 * p.damping * (s.states.p - s.velocity / w))

    def rates(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        w = 2 * ca.pi * p.frequency
        return {
            "q": w * s.states.p,
            "p": w * (s.displacement - s.states.q + 2 * p.damping * (s.velocity / w - s.states.p)),
        }
