"""How a flexure rings by itself, between ends that do not move: what a mechanism whose flexures move as at rest cannot show.

A uniform beam of length l bends at 4.730^2/(2 pi l^2) sqrt(E I/(rho A)) and twists at 1/(2 l) sqrt(G J/(rho I_p)); each half of a blade
that twists is one whose two ends do not warp, as its middle does not (`held_flexure.warping_share`). Pieces in line bend as Hermitian
elements do, `PARTS` a piece. Plates of finite elements have the same to 1.6 %, and to 3 % where they twist, up to twice as wide as
long, to 6 % at four times (`tests/test_flexures_alone.py`).

Source: R. D. Blevins, Formulas for Natural Frequency and Mode Shape (1979), tables 8-1 and 8-16.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.linalg

from ctrlgen.physics.flexure import Segment

PARTS = 8  # elements a piece: the lowest frequency is right to 1e-5


def lowest_bending(segments: Sequence[Segment], density: float) -> float:
    """[Hz] of pieces in line between held ends, in the plane in which they are softer; `density` [kg/m^3]."""
    return min(_bending(segments, density, plane) for plane in ("EI_z", "EI_y"))


def lowest_twist(halves: Sequence[Segment], density: float) -> float:
    """[Hz] of a uniform flexure of which this is one half, between held ends: GJ that of the half."""
    (half,) = halves
    inertia = density * float(half.I_y + half.I_z)
    return float(np.sqrt(float(half.GJ) / inertia) / (4 * float(half.length)))


def _bending(segments: Sequence[Segment], density: float, plane: str) -> float:
    count = PARTS * len(segments)
    K, M = np.zeros((2 * count + 2,) * 2), np.zeros((2 * count + 2,) * 2)
    for k in range(count):
        s = segments[k // PARTS]
        l, at = float(s.length) / PARTS, slice(2 * k, 2 * k + 4)
        stiffness = [[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]]
        mass = [[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]]
        lengths = np.array([1.0, l, 1.0, l])
        K[at, at] += float(getattr(s, plane)) / l**3 * np.array(stiffness) * np.outer(lengths, lengths)
        M[at, at] += density * float(s.area) * l / 420 * np.array(mass) * np.outer(lengths, lengths)
    inner = slice(2, -2)
    lowest = scipy.linalg.eigh(K[inner, inner], M[inner, inner], eigvals_only=True, subset_by_index=[0, 0])[0]
    return float(np.sqrt(lowest) / (2 * np.pi))
