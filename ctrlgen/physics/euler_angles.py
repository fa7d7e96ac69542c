"""Euler angles of a stated order and the rotation vector of the same rotation.

An order such as "xyz intrinsic" turns about x, then about the y that has turned with the body, then about the z that has: R = X Y Z.
"xyz extrinsic" turns about the axes that stay, in this order: R = Z Y X. Every order of three different axes (Tait-Bryan angles).

The vector is theta = a n, R = I + sin a [n x] + (1 - cos a) [n x]^2, 0 <= a <= pi. Back from it the middle angle is within 90 deg of
zero. At 90 deg the first and the last angle turn about one line: only their sum or difference is determined, and `angles_of` refuses.

Source: M. D. Shuster, A survey of attitude representations, J. Astronaut. Sci. 41 (1993) 439, sections on the rotation vector and on
Euler angles; computed by SciPy's `Rotation`.
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
import scipy  # its spatial takes a while to import, and comes when it is used

Order = Literal[
    "xyz intrinsic",
    "xzy intrinsic",
    "yxz intrinsic",
    "yzx intrinsic",
    "zxy intrinsic",
    "zyx intrinsic",
    "xyz extrinsic",
    "xzy extrinsic",
    "yxz extrinsic",
    "yzx extrinsic",
    "zxy extrinsic",
    "zyx extrinsic",
]
ORDERS: tuple[str, ...] = get_args(Order)
SINGULAR = 1e-6  # rad from where two of the angles are one: a rounding of 1e-16 then moves each by 1e-10


def rotation_vector_of(angles: np.ndarray, order: str) -> np.ndarray:
    """theta (..., 3) [rad] of `angles` (..., 3) [rad] about the axes of the `order`, one of `ORDERS`."""
    return np.asarray(scipy.spatial.transform.Rotation.from_euler(_sequence(order), angles).as_rotvec())


def angles_of(theta: np.ndarray, order: str) -> np.ndarray:
    """The angles (..., 3) [rad] about the axes of the `order` whose rotation has the vector `theta` (..., 3) [rad].

    Raises ValueError where the first and the last of them turn about one line (gimbal lock).
    """
    R = scipy.spatial.transform.Rotation.from_rotvec(theta).as_matrix()
    first, last = ("xyz".index(order[k]) for k in ((0, 2) if order.endswith("intrinsic") else (2, 0)))
    # the part of the last axis, turned, that is across the first: the cosine of the middle angle
    across = np.linalg.norm(np.delete(R[..., last], first, axis=-1), axis=-1)
    if np.any(across < SINGULAR):
        raise ValueError(
            f"the middle angle of {order!r}, about {order[1]}, is at 90 deg to one side: the first and the last turn about one line there, "
            "and only their sum or difference is determined; choose another order"
        )
    return np.asarray(scipy.spatial.transform.Rotation.from_rotvec(theta).as_euler(_sequence(order)))


def _sequence(order: str) -> str:
    """SciPy's name of an order: capitals are intrinsic."""
    axes, _, kind = order.partition(" ")
    return axes.upper() if kind == "intrinsic" else axes
