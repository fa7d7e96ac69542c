"""A pose stated of another point of the same body: where the body turns about a pivot that is given with the target.

A signal states the body's rotation vector theta and the displacement delta of one point. Where the body turns by R = exp(theta x) and the
point that was at `arm` from it at home, the pivot, is displaced by delta_p, the stated point is displaced by

    delta = delta_p - (R - I) arm

(`ctrlgen.physics.screw.turned`), exact for every rotation vector up to a full turn; the arm is fixed at home, in the axes of the pose.
Rotations that a signal does not have are taken as zero, displacements that it does not have are not asked for.

Source: M. D. Shuster, A survey of attitude representations, J. Astronaut. Sci. 41 (1993) 439, rotation vector.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import casadi as ca
import numpy as np

from ctrlgen.physics.screw import TWIST, Matrix, turned


def can_turn(channels: Sequence[str]) -> bool:
    """Whether a pose with these channels has a rotation and a displacement that depends on the point: along another axis."""
    axes = [[name[-1] for name in names if name in channels] for names in (TWIST[:3], TWIST[3:])]
    return any(turn != along for turn in axes[0] for along in axes[1])


def of_stated_point(channels: Sequence[str], pose: Matrix, pivot: Matrix) -> Matrix:
    """The pose (channels,) of the stated point where the `pose` (channels,) [rad, m] is that of the `pivot` (3,) [m], from it at home."""
    parts = dict(zip(channels, ca.vertsplit(pose), strict=True))
    theta = ca.vertcat(*(parts.get(name, 0) for name in TWIST[:3]))
    moved = dict(zip(TWIST[3:], ca.vertsplit(turned(theta, pivot)), strict=True))
    return ca.vertcat(*(parts[name] - moved[name] if name in moved else parts[name] for name in channels))


@lru_cache(maxsize=16)
def pivoted(channels: tuple[str, ...], order: int) -> ca.Function:
    """(pose (channels * (order + 1),), pivot (3,)) -> the same of the stated point: the pose, and by the chain rule its derivatives by
    time, one after the other as the online controller takes them."""
    n, pivot = len(channels), ca.SX.sym("pivot", 3)
    pose = ca.SX.sym("pose", n * (order + 1))
    rows = [of_stated_point(channels, pose[:n], pivot)]
    for k in range(order):
        rows.append(ca.jtimes(rows[-1], pose[: n * (k + 1)], pose[n : n * (k + 2)]))
    return ca.Function("about", [pose, pivot], [ca.vertcat(*rows)], ["pose", "pivot"], ["about"], {"cse": True})


def about(channels: tuple[str, ...], tables: np.ndarray, pivot: np.ndarray) -> np.ndarray:
    """`tables` (order + 1, n, channels) [rad, m] of the pose of a `pivot` (3,) [m] and its derivatives, of the stated point."""
    order, n = tables.shape[0] - 1, tables.shape[1]
    rows = np.concatenate(list(tables), axis=1).T
    moved = pivoted(channels, order).map(n)(rows, np.tile(pivot[:, None], n)).full().T
    return np.stack(np.split(moved, order + 1, axis=1))
