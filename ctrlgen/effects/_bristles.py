"""Bristles: a contact that bends, then slides; with a force that may fall with the speed."""

from __future__ import annotations

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, ShapeBounds, State, itself

STILL = 1e-6  # of v_s: keeps speed/tanh(speed) from being 0/0 at rest
SHARPEST = 1e-6  # of the speed that occurs: v_s of a contact that does not creep, as Dahl's
CONTACT = (
    Param("force", "channel", (0.0, 1.0), "force of sliding", off=0.0),
    Param("reach", "travel", (1e-6, 0.03), "displacement over which the contact yields"),
    Param("smoothing", "travel/s", (SHARPEST, 100.0), "v_s, below which it creeps"),
)
FALLING = (
    Param("force", "channel", (0.0, 1.0), "force of sliding at speed", off=0.0),
    Param("breakaway", "1", (1.0, 5.0), "b: breakaway force per sliding force at speed"),
    Param("speed", "travel/s", (1e-5, 100.0), "v_s: Stribeck speed, above which the excess has decayed"),
    Param("reach", "travel", (1e-6, 0.03), "displacement over which the contact yields"),
)
BRISTLES: tuple[State, ...] = (State("z", "1", 1.0),)

# tanh(v/v_s) far below v_s is v/v_s, and the force grows as v_s does; a contact that yields farther, or not at all, is one still
CREEPS = {"smoothing": ShapeBounds(high="viscous damping", as_size="viscous damping"), **itself("reach")}
# an excess over sliding that is none, or lasts at every speed
_STEADY = "dry friction that does not fall with speed"
FALLS = {"breakaway": ShapeBounds(low=_STEADY), "speed": ShapeBounds(high=_STEADY), **itself("reach")}


def bristle_rate(s: LawInputs, p: LawNumbers) -> Expression:
    """dz/dt = v (1 - z/tanh(v/v_s))/r: z from -1 to 1, over about the reach r."""
    speed = ca.sqrt((s.velocity / p.smoothing) ** 2 + STILL**2)
    return (s.velocity - p.smoothing * speed / ca.tanh(speed) * s.states.z) / p.reach


def falling_rate(s: LawInputs, p: LawNumbers) -> Expression:
    """dz/dt = (v - |v| z/g(v))/r, g = 1 + (b - 1) exp(-(v/v_s)^2): z from -b to b, sliding at g(v)."""
    level = 1 + (p.breakaway - 1) * ca.exp(-((s.velocity / p.speed) ** 2))
    return (s.velocity - ca.fabs(s.velocity) * s.states.z / level) / p.reach


class RegionalFriction(Effect, listed=False):
    """Delta F = -f z in a region, z Dahl's bristles of `coulomb`: one law, named once per region."""

    place = Place.FORCE
    family = Family.FRICTION
    set_valued = True
    requires = frozenset({"velocity"})
    source = "P. R. Dahl, AIAA Journal 14 (1976) 1675: solid friction damping; in a region"
    states = BRISTLES

    def rates(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        return {"z": bristle_rate(s, p)}


class FallingFriction(RegionalFriction, listed=False):
    """Delta F = -f z in a region, z of `falling_rate`: one law, named once per region."""

    source = "C. Canudas de Wit et al., IEEE Trans. Autom. Control 40 (1995) 419, eqs. (1)-(4); in a region"

    @classmethod
    def from_plainer(cls, numbers: dict[str, float]) -> dict[str, float]:
        # friction alike at every speed is between that at rest and that at speed
        return numbers | {"force": numbers["force"] * 2 / (1 + numbers.get("breakaway", 1.0))}

    def rates(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        return {"z": falling_rate(s, p)}
