"""Of more drives than axes those of the smallest expected error: the weights that make the least effort the least error.

The error that gain g_i of drive i causes is C B_i u_i g_i, that of a number q that acts on this drive alone C (dB_i/dq) u_i; C is the
compliance at home, in typical sizes of the signal. So their sum of squares is least with the weights w_i / r_i^2 = sum_q sd_q^2
|C dB_i/dq|^2. What all drives share acts on the forces, whichever of them make these.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np

from ctrlgen.budget.uncertainty import Uncertainties
from ctrlgen.devices.quantities import shared_path
from ctrlgen.model.allocation import drive_ranges
from ctrlgen.model.assembly import build_model, movable
from ctrlgen.model.model import Model

LEAST_WEIGHT = 1e-6  # of the largest: of a drive of which everything is known


def of_least_error(model: Model, stated: Uncertainties, follow: str) -> Model:
    """`model`, whose drives of least effort are those of the smallest expected error of the signal `follow`."""
    able = set(movable(model.device))
    free = tuple(p for line in stated.lines if line.kind == "number" for p in line.paths if shared_path(p) in able)
    symbolic = build_model(model.device, free)
    signal, n_u = symbolic.signals[follow], model.u.numel()
    B = ca.jacobian(symbolic.balance, symbolic.u)
    K = ca.jacobian(symbolic.balance, symbolic.z)
    J = ca.jacobian(signal.expr, symbolic.z)
    at = [symbolic.x, symbolic.z, symbolic.u, symbolic.p]
    slopes = ca.Function("push", at, [B, K, J, ca.jacobian(ca.vec(ca.densify(B)), symbolic.p)])
    home = (symbolic.rest, np.zeros(len(model.axes)), np.clip(0.0, *model.u_bounds), symbolic.p_nominal)
    pushed, stiff, seen, by_number = (v.full() for v in slopes(*home))
    C = seen @ np.linalg.inv(stiff) / np.array(signal.scale)[:, None]
    by_number = by_number.reshape(n_u, len(model.axes), len(free)).transpose(1, 0, 2)
    variance = np.zeros(n_u)
    for line in stated.lines:
        if line.kind == "channel_gain":
            variance += np.array(line.sds) ** 2 * np.sum((C @ pushed) ** 2, axis=0)
        elif line.kind == "number":
            for path, sd in zip(line.paths, line.sds, strict=True):
                deviation = C @ by_number[:, :, free.index(path)] if path in free else np.zeros((1, n_u))
                size = np.sum(deviation**2, axis=0) * sd**2
                variance += size if np.count_nonzero(size) == 1 else 0.0
    weights = variance * drive_ranges(model) ** 2
    if not weights.any():
        return model
    return replace(model, drive_weights=np.maximum(weights / weights.max(), LEAST_WEIGHT))
