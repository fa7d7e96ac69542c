"""A 3-RRR stage by the direct stiffness method: every link a rigid body, every hinge an element. Knows nothing of ours.

Bodies: 0 the platform about Point o; 1 + 2a and 2 + 2a the lower and upper link of arm a about Point 1 of that arm.
"""

from __future__ import annotations

from typing import Any

import numpy as np

ARMS = (0.0, -2 * np.pi / 3, 2 * np.pi / 3)


def turned(angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])


def carried(point: np.ndarray) -> np.ndarray:
    """Displacement of a body at `point` per displacement about its origin."""
    return np.array([[1, 0, -point[1]], [0, 1, point[0]], [0, 0, 1]])


def assemble(hinges: list[np.ndarray], g: Any) -> np.ndarray:
    """Compliance of the stage, (dx, dy, dalpha, u_1, u_2, u_3) per (F_x, F_y, M_z, F_1, F_2, F_3), (6, 6).

    All in the frame of arm 1, then turned by g.frame_angle.
    """
    K = np.zeros((21, 21))
    load = np.zeros((21, 6))
    load[:3, :3] = np.eye(3)
    centre = np.array([g.l1 - g.l6, g.l4])  # Point o as seen from Point 1
    for a, angle in enumerate(ARMS):
        lower, upper = slice(3 + 6 * a, 6 + 6 * a), slice(6 + 6 * a, 9 + 6 * a)
        o_prime = np.array([g.l1, g.l4])
        point_3 = o_prime - [0, g.l3]
        point_2 = point_3 - [0, 2 * g.R3 + g.l2]
        free_ends = (
            (hinges[0], 0.0, np.zeros(2), None, lower),
            (hinges[1], np.pi / 2, point_2, lower, upper),
            (hinges[2], np.pi / 2, point_3, upper, "platform"),
        )
        for C, direction, point, before, after in free_ends:
            relative = np.zeros((3, 21))  # displacement of `after` less that of `before`, at the hinge's free end
            if after == "platform":
                relative[:, :3] += carried(point - centre) @ turned(angle).T
            else:
                relative[:, after] += carried(point)
            if before is not None:
                relative[:, before] -= carried(point)
            relative = turned(direction).T @ relative
            K += relative.T @ np.linalg.inv(C) @ relative
        load[lower, 3 + a] = carried(np.array([g.l5, 0])).T @ [0, -1, 0]
    scale = 1 / np.sqrt(np.diag(K))
    displacement = scale[:, None] * np.linalg.solve(scale[:, None] * K * scale, scale[:, None] * load)
    full = load.T @ displacement
    T = np.eye(6)
    T[:3, :3] = turned(g.frame_angle)
    return T @ full @ T.T
