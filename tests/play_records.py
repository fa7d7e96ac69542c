"""A servo axis whose displacement goes through plays: how it is told to move, and what it does."""

from __future__ import annotations

import numpy as np

N, NOISE = 600, 1e-8
SERVO = {"kind": "servo", "name": "servo", "title": "an axis", "source": "round numbers", "travel": "100 um"}


def moved(seed: int) -> np.ndarray:
    """Half a dozen sines that no period joins, from rest, within 70 um."""
    rng, t = np.random.default_rng(seed), np.linspace(0, 1, N)
    u = sum(rng.uniform(0.3, 1.0) * np.sin(2 * np.pi * rng.uniform(1, 9) * t) for _ in range(6))
    return 7e-5 * u / np.abs(u).max()


def lagging(u: np.ndarray, radii: np.ndarray, share: float = 0.15) -> np.ndarray:
    """Plays of these half widths that began in the middle, together `share` of the way."""
    play, out = np.zeros(len(radii)), []
    for d in u:
        play = np.clip(play, d - radii, d + radii)
        out.append((1 - share) * d + share * play.mean())
    return np.array(out)
