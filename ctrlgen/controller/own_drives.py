"""Whether each drive leads one displacement of its own, so that what one sample can reach is a box.

Where the drive u_i that a displacement needs follows from z_i alone and rises with it throughout the range, or falls, the drives between
two limits lead to the displacements between two others: those that the device comes to under the limits themselves. The farthest point of
a straight line that can be reached in one sample follows in closed form, without a search. That the slope du_i/dz_i has one sign is shown
by interval arithmetic, piece by piece of the range.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from ctrlgen.controller.quick_state import of_one_displacement
from ctrlgen.model.inverse import Inverse
from ctrlgen.model.model import Model
from ctrlgen.numerics.proven_polynomial import is_monotonic


def has_own_drives(model: Model, kernels: Inverse) -> bool:
    """Whether that holds for the `kernels` of a `model`, for every state."""
    n = len(model.axes)
    if model.redundant or not model.u.numel() == model.x.numel() == model.n_states == n:
        return False
    return _follows(kernels.state, model) and _is_linear_in_the_state(kernels.drive, model)


def _follows(kernel: ca.Function, model: Model) -> bool:
    """Whether each row of a `kernel` (x, z, wanted) is a function of its own displacement alone whose slope has one sign."""
    rows, ranges = of_one_displacement(kernel), zip(*model.z_bounds, strict=True)
    return all(
        row is not None and row[0] == i and is_monotonic(row[1], low, high)
        for i, (row, (low, high)) in enumerate(zip(rows, ranges, strict=True))
    )


def _is_linear_in_the_state(kernel: ca.Function, model: Model) -> bool:
    """Whether each drive follows from the actuator state of its own that is wanted, its slope by it a number."""
    x, z, wanted, state = (ca.SX.sym(name, *kernel.size_in(name)) for name in kernel.name_in()[:4])
    drive = kernel(x, z, wanted, state)
    slope = ca.jacobian(drive, state)
    if ca.depends_on(drive, wanted) or ca.symvar(slope) or not slope.sparsity().is_diag():
        return False
    return bool(np.all(ca.evalf(ca.densify(ca.diag(slope))).full() != 0))
