"""Exact test by sign flips: the chance of a sum so large if each of its parts had either sign with equal chance.

For parts t_b of unknown but symmetric distributions, independent of one another, the signs are independent of the sizes, and

    p = P(sum_b eps_b t_b >= sum_b t_b) = P(sum over a random half of them, b in F, of t_b <= 0),   eps_b = +-1 with equal chance

is at most u with chance at most u, whatever the distributions and however few parts there are (R. A. Fisher, The Design of Experiments,
1935, ch. 3; J. P. Romano, J. Am. Stat. Assoc. 85 (1990) 686). All 2^n signs count: their distribution is built part by part on a
lattice (M. Pagano, D. Tritchler, J. Am. Stat. Assoc. 78 (1983) 435), so that p is known as far down as 2^-n without drawing any.
"""

from __future__ import annotations

import numpy as np

CELLS = 128
"""Cells of the lattice for each part: of a hundred parts, rounding moves the limit by less than a fiftieth of a standard deviation."""


def sign_flip_p(parts: np.ndarray) -> float:
    """p (see the module) of `parts` (n,), one-sided: that their sum is positive by chance. 1 where no part differs from zero.

    Parts are rounded down to the lattice, so that p is never too small. Raises ValueError where a part is not finite.
    """
    if not np.isfinite(parts).all():
        raise ValueError("a part is not finite")
    t = parts[parts != 0]
    if not len(t):
        return 1.0
    k = np.floor(t / np.sum(np.abs(t)) * CELLS * len(t)).astype(int)
    lowest = -int(k[k < 0].sum())
    chance = np.zeros(lowest + int(k[k > 0].sum()) + 1)
    chance[lowest] = 1.0
    for step in k:
        flipped = np.zeros_like(chance)
        if step >= 0:
            flipped[step:] = chance[: len(chance) - step]
        else:
            flipped[:step] = chance[-step:]
        chance = (chance + flipped) / 2
    return float(min(chance[: lowest + 1].sum(), 1.0))
