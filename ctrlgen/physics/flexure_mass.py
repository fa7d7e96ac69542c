"""The mass of a flexure of uniform pieces whose ends move: its kinetic energy in the shapes that it has at rest.

Between its ends it is deformed by its load there alone, so that a section at x moves by the twist

    T(x) = T_1 + C(x) W,

T_1 that of the fixed end carried on rigidly, C(x) the compliance of what lies between the fixed end and the section, W the load, both
about the section. Of a uniform beam these are the cubic shapes of the consistent mass matrix,

    M = sum over pieces of integral T(x)' m(x) T(x) dx,    m = rho (I_y + I_z, I_y, I_z, A, A, A),

with the inertia of the sections against turning; of pieces in line (wire, rod, wire) those of all, condensed to the ends. Source: J. S.
Przemieniecki, Theory of Matrix Structural Analysis (1968), chapter 11; R. J. Guyan, AIAA J. 3 (1965) 380.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from ctrlgen.physics.flexure import Segment, segment_compliance
from ctrlgen.physics.screw import Matrix, Scalar, inverse_adjoint, move

# Exact to the seventh degree; squared cubic shapes are of the sixth.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(4)


def flexure_mass(
    segments: Sequence[Segment], density: Scalar, R: Matrix, end: Matrix, first: Matrix, load: Matrix
) -> Matrix:
    """(m, m): twice the kinetic energy per motions of a flexure of `segments` from its fixed end, density [kg/m^3] and Young's modulus
    [Pa] given, with frame `R` (3, 3) at its free `end` [m]; `first` (6, m) the twist of its fixed end and `load` (6, m) the wrench on its
    free end, in the global frame."""
    length = sum(s.length for s in segments)
    begun: Scalar = 0.0
    passed: list[tuple[Scalar, Matrix]] = []  # where each piece before ends, and its compliance there
    M = ca.SX.zeros(first.shape[1], first.shape[1])
    for s in segments:
        inertia = ca.vertcat(s.I_y + s.I_z, s.I_y, s.I_z, s.area, s.area, s.area) * density  # per length
        for node, weight in zip(NODES, WEIGHTS, strict=True):
            within = s.length * (1 + node) / 2
            x = begun + within
            C = segment_compliance(s, within)
            C += sum((move(compliance, None, (at - x, 0, 0)) for at, compliance in passed), ca.DM.zeros(6, 6))
            here = inverse_adjoint(R, end - (length - x) * R[:, 0])
            T = ca.mtimes(here, first) + ca.mtimes([C, here, load])
            M += ca.mtimes([T.T, ca.diag(inertia * s.length * weight / 2), T])
        begun = begun + s.length
        passed.append((begun, segment_compliance(s)))
    return M
