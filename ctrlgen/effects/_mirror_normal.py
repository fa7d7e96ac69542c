"""The normal of a mirror that turns with the platform."""

import casadi as ca

from ctrlgen.effects._law_inputs import Expression
from ctrlgen.physics.screw import turned


def turned_normal(theta: Expression, axis: int) -> Expression:
    """exp([theta x]) e_axis, shape (3, 1), for a rotation vector `theta` (3,) [rad] of at most a full turn."""
    e = ca.DM.eye(3)[:, axis]
    return e + turned(theta, e)
