"""How far the generated C may be from what it is compared with, and why."""

from __future__ import annotations

import numpy as np

from ctrlgen.firmware.c.real import Real
from ctrlgen.verification.reference import ReferenceAnswers

# m: 0.01 nm, 0.1 nm: below the resolution of every sensor in the shipped devices
LENGTH_LIMIT = {Real.DOUBLE: 1e-11, Real.FLOAT: 1e-10}
# of a typical size: what these are of a micrometre. A machine of nanometres is held to less
LENGTH_SHARE = {Real.DOUBLE: 1e-5, Real.FLOAT: 1e-4}
# rad: 1e-8 rad moves the platform's rim by 0.02 nm
ANGLE_LIMIT = {Real.DOUBLE: 1e-12, Real.FLOAT: 1e-8}
# double C against CasADi: about 4500 roundings of the largest value, or of what it follows from
RELATIVE_LIMIT = 1e-12
# of a limit's bound: rounding
EXCESS_LIMIT = {Real.DOUBLE: 1e-9, Real.FLOAT: 1e-5}
# the same where effects remember: while the drives are limited a memory moves on under the displacement
EXCESS_LIMIT_WITH_MEMORY = 1e-3
# float C against CasADi: of the largest value, accumulated over one evaluation
ROUNDINGS = 16


def length_limit(real: Real, size: float) -> float:
    """[m] by how much C may be off in a signal of the typical `size` [m]."""
    return min(LENGTH_LIMIT[real], LENGTH_SHARE[real] * size)


def rounded(real: Real, poses: np.ndarray) -> float:
    """What the roundings of one evaluation leave in `poses` [SI]: an axis that moves by millimetres has more to round."""
    return ROUNDINGS * real.epsilon * float(np.abs(poses).max(initial=0.0))


def float_limit(role: str, size: float, ref: ReferenceAnswers) -> float:
    """What `ROUNDINGS` float roundings of the largest value amount to, or half as many of all that it follows from."""
    return max(ROUNDINGS * Real.FLOAT.epsilon * size, ref.moved(ROUNDINGS / 2 * Real.FLOAT.epsilon)[role])


def controller_limit(role: str, size: float, ref: ReferenceAnswers, real: Real, wider: float = 1.0) -> float:
    """Of the C against the controller evaluated by CasADi, for answers up to `size` [SI]; in float `wider` times as much."""
    if real is Real.DOUBLE:
        return max(RELATIVE_LIMIT * size, ref.moved(RELATIVE_LIMIT)[role])
    limit = float_limit(role, size, ref)
    return wider * (max(limit, length_limit(real, float(ref.model.z_scale.max()))) if role == "displacement" else limit)
