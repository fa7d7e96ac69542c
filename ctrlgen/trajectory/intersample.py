"""Where a device is between the samples of a path, while its drives are held."""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca
import numpy as np

from ctrlgen.model.discretisation import one_step_map
from ctrlgen.model.model import Model
from ctrlgen.model.simulation import Trace

PARTS = 4  # of a sample, at whose ends the motion between samples is looked at


def between_samples(
    model: Model, follow: str, samples: Trace, u: np.ndarray, sample_time: float
) -> Iterator[tuple[float, np.ndarray]]:
    """(share of a sample, signal `follow` (n, channels) [SI] so long after each of the `samples`) under the held drives u (n, n_u), by
    steps of the shipped integrator."""
    n = len(u)
    x, z, p = samples.x[:n].T, samples.z[:n].T, np.tile(model.p_nominal[:, None], (1, n))
    for k in range(1, PARTS):
        after = one_step_map(model, k / PARTS * sample_time)
        signal = ca.substitute(model.signals[follow].expr, ca.vertcat(model.x, model.z), ca.vertcat(after.x, after.z))
        # the drive that is held, where it acts without delay
        signal = ca.substitute(signal, after.u_next, model.u)
        reached = ca.Function("between", [model.x, model.z, model.u, model.p], [signal]).map(n)
        yield k / PARTS, reached(x, z, u.T, p).full().T
