"""Which limits of a device a motion would break: where, when and by how much."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ctrlgen.devices import Limit
from ctrlgen.model.model import Model

NEGLIGIBLE = (
    1e-7  # of a limit: 5 pm of a stroke of 50 um; less is rounding, or what IPOPT's relaxed bounds (1e-8) leave
)


@dataclass(frozen=True)
class Violation:
    """A limit that one channel would break: `beyond` (n,) [SI] by how much at each sample, zero where it is kept, `value` (n,)
    the limited quantity. `bound` is the side that is broken most, `share` what is missing there, of the limit's range."""

    limit: Limit
    channel: int
    bound: float
    value: np.ndarray
    beyond: np.ndarray
    share: float

    @property
    def worst(self) -> int:
        """The sample at which most is missing."""
        return int(np.argmax(self.beyond))

    @property
    def samples(self) -> np.ndarray:
        """The samples (m,) at which the limit is broken."""
        return np.flatnonzero(self.beyond)


@dataclass(frozen=True)
class Before:
    """The `drive` (n, n_u) [SI] that is held before each sample, and the `sample_time` [s] for which it is."""

    drive: np.ndarray
    sample_time: float


def limited_values(
    model: Model, x: np.ndarray, z: np.ndarray, u: np.ndarray, before: Before | None = None
) -> list[tuple[Limit, np.ndarray]]:
    """Every limit with the limited quantity (n, channels) [SI] under the states x (n, n_x), displacements z (n, n_axes) and drives u
    (n, n_u); those on the rates of drives where the drives `before` are given."""
    limited = list(zip(model.limits, model.limited_values(x, z, u), strict=True))
    if before is not None and model.rate_limits:
        rates = model.limited_rates(u, before.drive, before.sample_time)
        limited += [(limit, rate[:, None]) for limit, rate in zip(model.rate_limits, rates, strict=True)]
    return limited


def violations(
    model: Model, x: np.ndarray, z: np.ndarray, u: np.ndarray, margin: float = 0.0, before: Before | None = None
) -> list[Violation]:
    """Every limit that the states x (n, n_x), displacements z (n, n_axes) and drives u (n, n_u) [SI] break, channel by channel,
    those that miss most first; with a `margin`, a share of the limit's range (of the limit, where there is one) by which it is to be kept.
    The rates of drives are looked at where the drives `before` are given.

    A value that is not finite breaks no limit: where the equations end, a displacement is out of range.
    """
    broken = []
    for limit, values in limited_values(model, x, z, u, before):
        unit = limit.span or model.force_scale
        low, high = limit.bounds[0] + margin * unit, limit.bounds[1] - margin * unit
        for i, value in enumerate(values.T):
            beyond = np.nan_to_num(np.maximum(low - value, value - high), nan=0.0, posinf=np.finfo(float).max)
            beyond[beyond < NEGLIGIBLE * unit] = 0.0
            if beyond.any():
                k = int(np.argmax(beyond))
                broken.append(
                    Violation(limit, i, low if value[k] < low else high, value, beyond, float(beyond[k] / unit))
                )
    return sorted(broken, key=lambda e: -e.share)
