"""How far from a path a device is between set-points, while its drives are held."""

from __future__ import annotations

import numpy as np

from ctrlgen.path_timing.curve import Curve
from ctrlgen.trajectory.intersample import between_samples
from ctrlgen.trajectory.inverse.clock import in_time
from ctrlgen.trajectory.solution import Solution

CHORDS = 16  # of the curve from one set-point to the next, to which distances are measured


def error_between(curve: Curve, solution: Solution, share: np.ndarray) -> np.ndarray:
    """(channels,) the largest distance [SI] from the curve in each channel between samples at these shares (N + 1,), at the place of the
    curve that is nearest in typical sizes, wherever it is in time."""
    model, follow, n = solution.model, curve.scenario.file.follow, len(share) - 1
    scale, h = np.array(model.signals[follow].scale), in_time(solution.scenario.clock).sample_time
    inner = share[:-1, None] + np.diff(share)[:, None] * np.linspace(-0.5, 1.5, 2 * CHORDS + 1)
    inner = inner % 1.0 if curve.closed else np.clip(inner, 0.0, 1.0)
    points = curve.samples(inner.ravel()).reshape(n, 2 * CHORDS + 1, -1) / scale
    chord = np.diff(points, axis=1)
    worst = np.zeros(len(scale))
    for _, reached in between_samples(model, follow, solution.trace, solution.drive[:n], h):
        off = (reached / scale)[:, None] - points[:, :-1]
        along = np.sum(off * chord, axis=2) / np.maximum(np.sum(chord**2, axis=2), 1e-300)
        off = off - np.clip(along, 0.0, 1.0)[:, :, None] * chord
        nearest = np.argmin(np.sum(off**2, axis=2), axis=1)
        worst = np.maximum(worst, np.abs(off[np.arange(n), nearest]).max(axis=0))
    return worst * scale
