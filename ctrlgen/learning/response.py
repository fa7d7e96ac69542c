"""Whether the device answers changes of its drives as described: the change of the signal between runs against the predicted one.

Between two runs the drive of actuator i changed by du_i. The described device would move by Y_i = y(u + du_i) - y(u); what was seen is
regressed on that,

    y(u_2) - y(u_1) = sum_i g_i Y_i + e,

by least squares over all samples and channels of all pairs of runs, with the standard error of g that holds for correlated e (W. K. Newey,
K. D. West, Econometrica 55 (1987) 703). g_i = 1 is the device as described, -1 one that moves the other way. Learning with the
sensitivities as described brings the error down only where 0 < g_i < 2. What one of the two runs hides (`ctrlgen.learning.hidden_parts`) is
left out on both sides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.stats import norm

from ctrlgen.learning.hidden_parts import along
from ctrlgen.learning.lifted import Lifted

CONFIDENCE = 0.999  # with which an actuator must contradict before learning refuses
LEAST_GAIN = 0.3  # below it the error falls by less than a third of what a step means to take away
MOST_GAIN = 2.0  # from it on a step takes away more than twice the error
LAG = 0.05  # of a run, over which residuals are taken to be correlated
SWAPPED = 0.25  # of what the described device leaves unexplained, that exchanged actuators may leave
UNEXPLAINED = 0.5  # of the observed change, from which on exchanged actuators are thought of
MOVED = 1e-6  # of the largest response: a drive that moved less says nothing


@dataclass(frozen=True)
class Response:
    """`gain` (n_u,) of each actuator, its standard error `se`, NaN where it did not move; `unexplained`, share of the observed change that
    the device as described leaves; `exchanged`, two actuators that were taken one for the other; `reasons` to refuse, by drive."""

    gain: np.ndarray
    se: np.ndarray
    unexplained: float
    exchanged: tuple[int, int] | None
    reasons: dict[str, str]


@dataclass(frozen=True)
class Change:
    """From one run to the next: drives `u` and `then` (n, n_u), the observed change `y` (n, n_y) of the signal and its noise `sd` (n_y,)
    per sample; `observed` (n_y,); `hidden` (k, n, n_y), orthonormal in typical sizes: the directions that one of the two runs hides."""

    u: np.ndarray
    then: np.ndarray
    y: np.ndarray
    sd: np.ndarray
    observed: np.ndarray
    hidden: np.ndarray

    def shown(self, y: np.ndarray, scale: np.ndarray) -> np.ndarray:
        """What both runs show of a change (n, n_y) [SI], in typical sizes `scale` (n_y,): of the channels that were observed."""
        scaled = y / scale * self.observed
        return np.asarray((scaled - along(self.hidden, scaled))[:, self.observed])


def response(lifted: Lifted, changes: Sequence[Change]) -> Response | None:
    """What all `changes` say together; None without any."""
    if not changes:
        return None
    scale = np.array(lifted.signal.scale)
    X, seen = list[np.ndarray](), list[np.ndarray]()
    for change in changes:
        du, base = change.then - change.u, lifted.run(change.u)
        parts = [lifted.run(change.u + du * unit) - base for unit in np.eye(du.shape[1])]
        X.append(np.stack([change.shown(part, scale) for part in parts], axis=2))
        seen.append(change.shown(change.y, scale))
    size = np.sqrt(sum(np.sum(x**2, axis=(0, 1)) for x in X))
    moved = size > MOVED * max(size.max(), 1e-300)
    gain, se = np.full(len(size), np.nan), np.full(len(size), np.nan)
    if not moved.any():
        return Response(gain, se, 0.0, None, {})
    gain[moved], se[moved] = regressed([x[:, :, moved] for x in X], seen)
    total = sum(float(np.sum(y**2)) for y in seen)
    noise = sum(float(np.sum((c.sd / scale)[c.observed] ** 2)) * len(c.y) for c in changes)
    left = _left(X, seen, np.ones(len(size)))
    unexplained = max(left - noise, 0.0) / max(total - noise, 1e-300) if total > 2 * noise else 0.0
    exchanged = (
        _exchanged(lifted, changes, X, seen, np.where(moved, gain, 0.0), noise) if unexplained > UNEXPLAINED else None
    )
    return Response(gain, se, unexplained, exchanged, _reasons(lifted, gain, se, exchanged))


def regressed(X: Sequence[np.ndarray], y: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """g and its standard error from parts (n, n_y, m) and observations (n, n_y) of each pair of runs."""
    normal = sum(np.einsum("kci,kcj->ij", x, x) for x in X)
    inverse = np.linalg.pinv(normal, hermitian=True)
    gain = inverse @ sum(np.einsum("kci,kc->i", x, v) for x, v in zip(X, y, strict=True))
    spread = np.zeros_like(normal)
    for x, v in zip(X, y, strict=True):
        score = np.einsum("kci,kc->ki", x, v - x @ gain)
        lag = max(1, round(LAG * len(score)))
        spread += score.T @ score
        for j in range(1, lag + 1):
            crossed = score[j:].T @ score[:-j]
            spread += (1 - j / (lag + 1)) * (crossed + crossed.T)
    return gain, np.sqrt(np.maximum(np.diag(inverse @ spread @ inverse), 0.0))


def _left(X: Sequence[np.ndarray], y: Sequence[np.ndarray], gain: np.ndarray) -> float:
    return sum(float(np.sum((v - x @ gain) ** 2)) for x, v in zip(X, y, strict=True))


def _exchanged(
    lifted: Lifted,
    changes: Sequence[Change],
    X: Sequence[np.ndarray],
    seen: Sequence[np.ndarray],
    gain: np.ndarray,
    noise: float,
) -> tuple[int, int] | None:
    """The two actuators whose exchange explains what gains alone do not; None where none does."""
    scale, best = np.array(lifted.signal.scale), None
    least = SWAPPED * max(_left(X, seen, gain) - noise, 0.0)
    for pair in combinations(range(len(gain)), 2):
        order = np.arange(len(gain))
        order[list(pair)] = pair[::-1]
        left = 0.0
        for change, y in zip(changes, seen, strict=True):
            moved = lifted.run(change.then[:, order]) - lifted.run(change.u[:, order])
            left += float(np.sum((y - change.shown(moved, scale)) ** 2))
        if left - noise < least:
            least, best = left - noise, pair
    return best


def _reasons(lifted: Lifted, gain: np.ndarray, se: np.ndarray, exchanged: tuple[int, int] | None) -> dict[str, str]:
    """Why learning would not converge, by drive."""
    names, k, reasons = lifted.model.signals["drive"].channels, float(norm.ppf(0.5 + CONFIDENCE / 2)), dict[str, str]()
    if exchanged is not None:
        a, b = (names[i] for i in exchanged)
        reasons[f"drive.{a}, drive.{b}"] = (
            f"the change from run to run is that of a device in which {a} and {b} are exchanged; check their wiring, or the columns of the "
            "recording"
        )
        return reasons
    for name, g, s in zip(names, gain, se, strict=True):
        if not np.isfinite(g):
            continue
        seen = f"from run to run it moved the pose by {g:.2f} ± {k * s:.2f} of what was predicted ({100 * CONFIDENCE:g} % confidence)"
        if g + k * s < -LEAST_GAIN:
            reasons[f"drive.{name}"] = (
                f"{seen}: it acts the other way; check its polarity, its wiring and the sign of the column"
            )
        elif g + k * s < LEAST_GAIN:
            reasons[f"drive.{name}"] = (
                f"{seen}: it hardly acts, or the other way; check that it is connected, or describe what holds it"
            )
        elif g - k * s > MOST_GAIN:
            reasons[f"drive.{name}"] = (
                f"{seen}: a step would overshoot and grow from run to run; correct its gain in the device file first"
            )
    return reasons
