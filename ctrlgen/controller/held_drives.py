"""What drives that are held over a sample leave of the smooth motion of a stage with inertia, though nothing rings.

A drive that is held over a sample T has the mean of the one that fits, sinc(w T/2) = 1 - (w T)^2/24 + ..., so that displacements are off by
T^2/24 z''. Beside that the device answers to the saw-tooth between the two, e' = A e + (t - T/2) B du/dt, in one sample as in the next. As
B du/dt = y'' - A y', of which y'' is left out, both are linear in y'. y = (x, z), y' = A y + B u, is linear as at rest.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

PARTS = 32  # of a sample, at whose ends it is looked where the device is


def left_by_held_drives(
    A: np.ndarray, positions: np.ndarray, told: np.ndarray, size: np.ndarray, sample_time: float
) -> np.ndarray:
    """(n_y,) how far a held drive leaves any number that is `told` at most, in its `size`, per change of each number in a sample."""
    n, h = len(A), sample_time
    pushed = A.copy()
    pushed[positions] = 0.0  # z' = v has no drive in it
    scaled = A / size[:, None] * size
    ramp = np.zeros((3 * n, 3 * n))  # e' = A e + s, s' = c
    ramp[:n, :n], ramp[:n, n : 2 * n], ramp[n : 2 * n, 2 * n :] = scaled, np.eye(n), np.eye(n)

    def after(t: float) -> tuple[np.ndarray, np.ndarray]:
        of_start, of_s, of_c = np.hsplit(expm(t * ramp)[:n], 3)
        return of_start, of_c - h / 2 * of_s

    whole, own = after(h)
    start = np.linalg.lstsq(np.eye(n) - whole, own, rcond=None)[0]  # of one sample and the next alike
    parts = (after(t) for t in np.linspace(0.0, h, PARTS + 1))
    left = np.max([np.abs((free @ start + own) @ (pushed / size[:, None] * size)) for free, own in parts], axis=0) / h
    left[positions] += h / 24 * np.abs(scaled[positions])  # T^2/24 z'', z' = v
    return np.asarray(np.max(left[told], axis=0))
