"""The platform's frame stands rotated against the drawing: one direction shows in another."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class FrameRotation(Effect, listed=False):
    """Components in a frame rotated by alpha about its `axis`, from direction a toward b: Delta v_a = (cos alpha - 1) v_a -
    sin alpha v_b, Delta v_b = (cos alpha - 1) v_b + sin alpha v_a, v = theta and v = delta. Acting on one channel, it changes
    that component alone.

    One law, named once per axis: the axis is part of `kind`, so that a device file and a finding say it in one word.
    """

    place = Place.POSE
    family = Family.GEOMETRY
    requires = frozenset({"spatial"})
    source = "definition"
    params = (Param("angle", "mrad", (-100.0, 100.0), "rotation of the platform's frame", off=0.0),)
    axis: int  # 0, 1, 2 for x, y, z

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        half, component = 3 * (s.index // 3), s.index % 3
        a, b = (self.axis + 1) % 3, (self.axis + 2) % 3
        if component == self.axis:
            return ca.SX(0)
        across = -s.all[half + b] if component == a else s.all[half + a]
        return ca.sin(p.angle) * across + (ca.cos(p.angle) - 1) * s.value


class FrameRotationX(FrameRotation):
    """About x: Delta v_y = (cos alpha - 1) v_y - sin alpha v_z. Holds for a rigid platform."""

    title = "The platform's frame stands rotated about x against the drawing"
    axis = 0


class FrameRotationY(FrameRotation):
    """About y: Delta v_z = (cos alpha - 1) v_z - sin alpha v_x. Holds for a rigid platform."""

    title = "The platform's frame stands rotated about y against the drawing"
    axis = 1


class FrameRotationZ(FrameRotation):
    """About z: Delta v_x = (cos alpha - 1) v_x - sin alpha v_y. Holds for a rigid platform."""

    title = "The platform's frame stands rotated about z against the drawing"
    axis = 2
