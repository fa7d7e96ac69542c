"""An interferometer reads a plane mirror that turns with the platform: its beam meets another point of it."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place
from ctrlgen.effects._mirror_normal import turned_normal


class PlaneMirror(Effect):
    """Delta y_a = g ((n . delta + R)/n_a - R - delta_a), n = exp([theta x]) e_a: where the beam along a, through the point whose pose is
    read, meets a plane mirror that stands R before that point; g = 1 for such a mirror, 0 for a reading of the point itself.

    Holds for a flat mirror and any rotation that the beam survives; of second order it adds
    delta_b theta_c - delta_c theta_b + R (theta_b^2 + theta_c^2)/2, (a, b, c) in cyclic order.
    """

    place = Place.SENSOR
    family = Family.GEOMETRY
    requires = frozenset({"spatial"})
    channel_unit = "m"
    source = "S0 section 3.1 and Fig. 4: beams along x and y on a cube; the plane n . (X - X_0) = 0 that turns with it"
    params = (
        Param("share", "1", (-2.0, 2.0), "1 for a plane mirror", off=0.0),
        Param(
            "position", "mm", (-500.0, 500.0), "R: where the mirror stands, from the point that is read, along the beam"
        ),
    )

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        turn, way, a = s.all[:3], s.all[3:6], s.index - 3
        normal = turned_normal(turn, a)
        met = (ca.dot(normal, way) + p.position) / normal[a] - p.position
        return p.share * (met - way[a])
