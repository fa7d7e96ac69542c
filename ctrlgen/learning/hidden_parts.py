"""What a run cannot tell because its zero or its clock was taken out.

A zero or a delay of one run is told from what it shows against another (`ctrlgen.learning.run_gate`), and so is taken out with it whatever
the device answered otherwise than described in the same direction: a constant, or the path's rate. In these directions the run says
nothing, as where two later runs are at odds about a zero. It is given what the nearest run that hides nothing makes of them, no step
is taken in them from it, and two runs are compared without the directions that one of them hides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ctrlgen.learning.repeatability import Repeated, Spectrum


def hidden_by(zero: np.ndarray, late: float, rate: np.ndarray) -> tuple[np.ndarray, ...]:
    """Deviations (n, n_y) in typical sizes in the direction of which a run says nothing: constants in channels whose `zero` (n_y,) is not
    known, and the `rate` (n, n_y) of the path where it was `late` [s]."""
    constants = [np.ones(rate.shape) * (np.arange(len(zero)) == i) for i in np.flatnonzero(zero)]
    return (*constants, *([rate] if late else []))


def orthonormal(parts: Sequence[np.ndarray], spectrum: Spectrum) -> np.ndarray:
    """(k, n, n_y) an orthonormal basis of coefficients of the span of deviations (n, n_y)."""
    if not parts:
        return np.zeros((0, spectrum.n, 1))
    columns = np.stack([spectrum.coefficients(part / np.linalg.norm(part)).ravel() for part in parts], axis=1)
    U, w, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(U[:, w > 1e-9 * w[0]].T.reshape(-1, *parts[0].shape))  # two records of one run hide the same


def along(Q: np.ndarray, mean: np.ndarray) -> np.ndarray:
    """(n, n_y) the part of coefficients in the span of `Q` (k, n, n_y)."""
    return np.asarray(np.tensordot(np.tensordot(Q, mean, axes=2), Q, axes=1)) if len(Q) else np.zeros(mean.shape)


def without(r: Repeated, Q: np.ndarray) -> Repeated:
    """The coefficients without their part in the span of `Q`, nor its noise."""
    if not len(Q):
        return r
    return replace(r, mean=r.mean - along(Q, r.mean), se=r.se * np.sqrt(np.clip(1 - np.sum(Q**2, axis=0), 0, 1)))


def told(repeated: Sequence[Repeated], models: Sequence[np.ndarray], hidden: Sequence[np.ndarray]) -> list[Repeated]:
    """The runs' errors with what each hides as the nearest run that hides nothing has it, by drives: `models` (n, n_y), coefficients of the
    model's own runs; `hidden`, the directions (k, n, n_y) of each."""
    open_ones, out = [i for i, Q in enumerate(hidden) if not len(Q)], list(repeated)
    for j, Q in enumerate(hidden):
        if len(Q) and open_ones:
            i = min(open_ones, key=lambda k: float(np.sum((models[k] - models[j]) ** 2)))
            seen = repeated[i].mean + models[j] - models[i]
            out[j] = replace(repeated[j], mean=repeated[j].mean + along(Q, seen - repeated[j].mean))
    return out
