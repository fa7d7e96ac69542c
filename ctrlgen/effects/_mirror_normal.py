"""The normal of a mirror that turns with the platform."""

import casadi as ca

from ctrlgen.effects._law_inputs import Expression


def turned_normal(theta: Expression, axis: int) -> Expression:
    """exp([theta x]) e_axis = e + (sin a/a) theta x e + 2 (sin(a/2)/a)^2 theta x (theta x e), a = |theta| [rad], shape (3, 1).

    1e-30 is added to a^2, so that value and slope exist at home.
    """
    a = ca.sqrt(ca.sumsqr(theta) + 1e-30)
    e = ca.SX(ca.DM.eye(3)[:, axis])
    across = ca.cross(theta, e)
    return e + ca.sin(a) / a * across + 2 * (ca.sin(a / 2) / a) ** 2 * ca.cross(theta, across)
