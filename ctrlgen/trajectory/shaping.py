"""Input shaping: a set-point convolved with impulses after which a mode of the device is at rest.

    r_shaped(t) = sum_i A_i r(t - t_i),   A_i = C(m, i) K^i / (1 + K)^m,   t_i = i / (2 f_d),   i = 0 ... m,
    K = exp(-pi zeta / sqrt(1 - zeta^2)),   f_d = f sqrt(1 - zeta^2),

m = 1 for zero vibration (ZV), 2 where its derivative by the frequency is zero too (ZVD), 3 for the second one (ZVDD). Sources:
N. C. Singer, W. P. Seering, J. Dyn. Syst. Meas. Control 112 (1990) 76, eq. (12) and (15); W. Singhose, Int. J. Precis. Eng. Manuf.
10 (2009) 153.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, comb, exp, pi, sqrt
from typing import Annotated, Literal

import numpy as np

from ctrlgen.core.units import In, Quantity
from ctrlgen.devices.section import Section

ORDERS = {"ZV": 1, "ZVD": 2, "ZVDD": 3}
WHOLE = 1e-9  # of a sample, by which a shaper may be longer than whole samples


class Shaping(Section):
    """`[shaping]`: the path is convolved with impulses after which a mode does not vibrate; it then lasts longer by half a period of the
    mode for ZV, a whole one for ZVD."""

    kind: Literal["ZV", "ZVD", "ZVDD"]
    """ZV: no vibration left at the stated frequency. ZVD and ZVDD: little left at frequencies near it too, where it is not known well."""
    frequency: Annotated[Quantity, In("Hz", positive=True)] | None = None
    """Undamped natural frequency of the mode, at most half the `sample_rate`. Left out: that of the device's own mode which is damped
    least, at the end of the path."""
    damping_ratio: Annotated[Quantity, In("1", low=0.0, high=0.99)] | None = None
    """Its damping ratio. Left out: that of the device's own mode; with a `frequency`, zero."""


@dataclass(frozen=True)
class Shaper:
    """Impulses: `amplitudes` (m + 1,), whose sum is one, at the `times` (m + 1,) [s]; for the mode `frequency` [Hz], `damping_ratio`."""

    kind: str
    frequency: float
    damping_ratio: float
    amplitudes: np.ndarray
    times: np.ndarray

    def samples(self, sample_time: float) -> int:
        """The number of samples by which shaping makes a path longer."""
        return ceil(self.times[-1] / sample_time - WHOLE)


def shaper(kind: str, frequency: float, damping_ratio: float) -> Shaper:
    """The shaper of a `kind` for a mode: its undamped natural `frequency` [Hz] and `damping_ratio`."""
    m, root = ORDERS[kind], sqrt(1 - damping_ratio**2)
    K = exp(-pi * damping_ratio / root)
    i = np.arange(m + 1)
    amplitudes = np.array([comb(m, k) for k in i]) * K**i / (1 + K) ** m
    return Shaper(kind, frequency, damping_ratio, amplitudes, i / (2 * frequency * root))
