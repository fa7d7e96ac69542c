"""What the controller in integers is off, against real numbers: every rounding, every polynomial, and what is cut off drives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ctrlgen.controller.fixed_maps import RealMaps


@dataclass(frozen=True)
class Bits:
    """Of each number of the interface: V counts 2^-bits of its unit."""

    target: np.ndarray
    displacement: np.ndarray
    state: np.ndarray
    drive: np.ndarray


@dataclass(frozen=True)
class Off:
    """Bounds, SI: `displacement` (n,), `state` (n_s,) and `drive` (n_u,) of an answer, against real numbers and the same target; `stage`
    (n,), the displacement of a device as described under these drives, against the target; `target` (n,), what rounding a target to
    integers makes of the displacement."""

    target: np.ndarray
    displacement: np.ndarray
    state: np.ndarray
    drive: np.ndarray
    stage: np.ndarray


def error_bounds(
    real: RealMaps, bits: Bits, rounding: tuple[np.ndarray, np.ndarray, np.ndarray], slack: np.ndarray
) -> Off:
    """The bounds from the roundings of displacement, state and drive, in counts."""
    z, s, u = (off * 2.0**-b for off, b in zip(rounding, (bits.displacement, bits.state, bits.drive), strict=True))
    n, places = len(s), [i for i, _ in real.state]
    flattest, steepest, proved = (
        np.array([getattr(p, name) for _, p in real.state]) for name in ("flattest", "steepest", "off")
    )
    state = s + flattest * proved + steepest * z[places]
    gain = np.abs(real.by_state)
    to_state = np.linalg.solve(np.eye(n) - gain, np.abs(real.by_drive) @ (u + slack * 2.0**-bits.drive))
    stage = z.copy()
    np.add.at(stage, places, proved + (s + to_state) / flattest)
    by_both = np.abs(real.step[0])
    drive = u + np.maximum(np.abs(real.settle[0]) @ state, by_both[:, :n] @ state + by_both[:, n:] @ state)
    return Off(np.abs(real.M) @ (0.5 * 2.0**-bits.target), z, state, drive, stage)
