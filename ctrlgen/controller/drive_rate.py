"""Limits on how fast drives change, kept from one sample to the next.

From the last drives u- a controller goes toward the wanted ones u by the largest common share that every rate r allows,

    u- + s (u - u-),   s = min(1, r_i T / (u_i - u-_i)),

on the straight line between two drives that keep their own limits, which the answer then does too. All drives wait for the slowest, so
that a path is left along itself and not to its side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

FREE = 1e18  # SI: the change written for a drive without a limit on its rate; its square is still a float
LONGEST = 10**6  # samples


@dataclass(frozen=True, eq=False)
class RateLimiter:
    """`fall` and `rise` (n_u,): the largest changes of the drives in one sample [SI], `FREE` where there is no limit; a change beyond
    them by no more than `slack` is no excess."""

    fall: np.ndarray
    rise: np.ndarray
    slack: np.ndarray

    def toward(self, last: np.ndarray, wanted: np.ndarray) -> tuple[np.ndarray, float, bool, bool]:
        """Drives (n_u,) toward the `wanted` ones from the `last`, the share s, whether that changed them, and by more than slack."""
        change = wanted - last
        touched = ~((change <= self.rise) & (change >= self.fall))  # also where a change is no number
        if not touched.any():
            return wanted, 1.0, False, False
        excess = ~((change <= self.rise + self.slack) & (change >= self.fall - self.slack))
        allowed = np.where(change > 0, self.rise, self.fall)[touched]
        share = float(np.min(allowed / change[touched], initial=1.0))
        return last + share * change, share, True, bool(excess.any())

    def samples(self, low: np.ndarray, high: np.ndarray) -> int:
        """In how many samples the drives have come from anywhere in their range (n_u,) to anywhere in it, at most `LONGEST`."""
        slowest = np.min(np.minimum(self.rise, -self.fall) / (high - low))
        return int(min(np.ceil(1 / slowest) + 1 if slowest > 0 else LONGEST, LONGEST))
