"""A frame that stands turned: the rotation that several effects share."""

from __future__ import annotations

from types import SimpleNamespace

import casadi as ca


def turned(s: SimpleNamespace, angle: ca.SX, a: int, b: int) -> ca.SX:
    """Change of component `s.index` of a twist (theta, delta) where axis a turns toward axis b (0, 1, 2) by `angle` [rad].

    Delta v_a = (cos angle - 1) v_a - sin angle v_b, Delta v_b = (cos angle - 1) v_b + sin angle v_a, of both halves.
    """
    half = 3 * (s.index // 3)
    across = {half + a: -s.all[half + b], half + b: s.all[half + a]}
    if s.index not in across:
        return ca.SX(0)
    return ca.sin(angle) * across[s.index] + (ca.cos(angle) - 1) * s.value
