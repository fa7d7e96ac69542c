"""Limits of a path that hold for what is not known exactly: chance constraints with a back-off of each limit.

A limit with the margin M = b - y at a sample holds for a device of which the numbers, surroundings and drives differ where M is
larger than what they take of it. To first order that is normal: u_l is its sd by what lasts along the path, u_s by what is new at
every sample. With the share e of the risk 1 - p for what scatters, all N limited quantities hold at all n samples with probability p if

    sum_i Phi(-beta_i) <= (1 - e)(1 - p),   beta_i = min_k (M_ik - z_s u_s,ik)/u_l,ik,   1 - Phi(z_s) = e (1 - p)/(N n),

Boole's inequality over quantities, and of what scatters over samples. What lasts breaks a limit at its worst sample or not at all.
The back-off of a limit is z u_l + z_s u_s, z the quantile of (1 - e)(1 - p), or where the sum is larger the one to which the betas below
it must be raised. Sources: A. Nemirovski, A. Shapiro, SIAM J. Optim. 17 (2006) 969 (safe approximation of chance constraints); M. Ono,
B. C. Williams, Proc. 47th IEEE CDC (2008) 3427 (risk allocation).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from ctrlgen.budget.limits import Margins

SCATTER_RISK = 0.1  # of the risk, for what scatters: little of it is gained by more, as z grows with its logarithm


@dataclass(frozen=True)
class ChanceConstraint:
    """All limits of a path with the `margins` at the `probability`."""

    margins: Margins
    probability: float

    @property
    def _share(self) -> float:
        return SCATTER_RISK if self.margins.scattered.any() else 0.0

    @property
    def _allowed(self) -> float:
        return (1 - self._share) * (1 - self.probability)

    @cached_property
    def _scatter(self) -> np.ndarray:
        """What scatter takes of each margin: z_s u_s (n, channels) [SI]."""
        m = self.margins
        if not self._share:
            return m.scattered
        count = np.sum(np.isfinite(m.bounds)) * m.margin.shape[1]
        return np.asarray(-scipy.special.ndtri(self._share * (1 - self.probability) / count) * m.scattered)

    @cached_property
    def _beta(self) -> np.ndarray:
        """The least margin over its lasting uncertainty of each lower and upper bound: beta (2, channels)."""
        left = self.margins.margin - self._scatter
        with np.errstate(divide="ignore", invalid="ignore"):
            beta = np.where(self.margins.lasting > 0, left / self.margins.lasting, np.where(left < 0, -np.inf, np.inf))
        # that a limit without uncertainty holds is left to the solver
        return np.asarray(np.where(self.margins.sd > 0, beta, np.inf).min(axis=1))

    @cached_property
    def _risk(self) -> float:
        return float(scipy.special.ndtr(-self._beta).sum())

    @property
    def holds(self) -> bool:
        """Whether all limits hold at the probability."""
        return self._risk <= self._allowed

    @property
    def possible(self) -> float:
        """The probability with which they hold; zero or less where Boole's inequality gives none."""
        return 1 - self._risk / (1 - self._share)

    @cached_property
    def quantile(self) -> float:
        """The quantile z of the back-off z u that every bound takes."""
        z = float(-scipy.special.ndtri(self._allowed))

        def risk(raised: float) -> float:
            return float(scipy.special.ndtr(-np.maximum(self._beta, raised)).sum() - self._allowed)

        if self.holds or risk(z) <= 0:  # of a single limit that is short, but for rounding
            return z
        return float(scipy.optimize.brentq(risk, z, 1 - scipy.special.ndtri(self._allowed / self._beta.size)))

    @property
    def reserve(self) -> np.ndarray:
        """(2, n, channels) the back-off of each limit [SI]."""
        return np.asarray(self.quantile * self.margins.lasting + self._scatter)

    def left(self, z: float) -> np.ndarray:
        """(2, n, channels) what is left of the margins beside the back-off with a quantile z."""
        return np.asarray(self.margins.margin - z * self.margins.lasting - self._scatter)
