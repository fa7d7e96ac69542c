"""Whether a residual goes with the motion, whatever the size and the colour of the noise in it.

Physics that was left out is a function of what the device did: of its place and speed, of the drive, of where they turned, of the drive
some time ago. Noise is of none, however large and slow. With X (n, m) such functions along the records, e (n,) the residual of one
channel and W the filter that whitens e by its own autoregression (noise and physics together, so that W takes too much rather than too
little),

    F = (|P W e|^2 / m) / (|W e - P W e|^2 / (n - m)),   P the projection onto the range of W X,

has Fisher's distribution where e is autoregressive noise that has nothing to do with X (generalised least squares: A. C. Aitken, Proc. R.
Soc. Edinburgh 55 (1936) 42; the filter from the residual: D. Cochrane, G. H. Orcutt, J. Am. Stat. Assoc. 44 (1949) 32). A slow residual and
a slow motion are alike by chance in the plain samples, not in the whitened ones.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import stats
from scipy.linalg import block_diag
from scipy.signal import lfilter

from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.noise import autoregression
from ctrlgen.estimation.settings import DISCREPANCY, MOTION
from ctrlgen.recordings.recording import Record


def goes_with_motion(fitter: Fitter, left: Sequence[tuple[Fit, Record]], i: int) -> float:
    """p that noise goes so well with the motion by chance as does channel i of what fits leave of records of a series, all together."""
    return p_by_chance([_of_record(fitter, fit, record, i) for fit, record in left])


def p_by_chance(parts: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> float:
    """The same of the residual (n,), which samples are valid (n,), and the signals (n, k) of each record. 1 where the samples are too few
    to tell.

    Of every signal its `functions_of` are used. Each record has a zero of its own.
    """
    e = [np.where(good, residual, 0.0) for residual, good, _ in parts]
    if not any(good.any() for _, good, _ in parts):
        return 1.0
    _, a = autoregression([x - np.mean(x) for x in e])
    taps = np.concatenate([[1.0], -a])
    y, Z, zeros = [], [], []
    for x, (_, good, _), columns in zip(e, parts, functions_of([signals for *_, signals in parts]), strict=True):
        usable = np.convolve(~good, np.ones(len(taps)))[: len(good)] == 0
        usable[: len(a)] = False
        y.append(lfilter(taps, [1.0], x)[usable])
        Z.append(lfilter(taps, [1.0], columns, axis=0)[usable])
        zeros.append(np.ones((int(usable.sum()), 1)))
    white, functions = (_beside(np.concatenate(v), block_diag(*zeros)) for v in (y, Z))
    sd = np.std(white)
    white = np.clip(white, -DISCREPANCY.huber_corner * sd, DISCREPANCY.huber_corner * sd)
    Q = _range_of(functions)
    m = Q.shape[1]
    if m == 0 or sd == 0 or len(white) < MOTION.samples_per_function * m:
        return 1.0
    taken, whole, free = float(np.sum((Q.T @ white) ** 2)), float(white @ white), len(white) - m - len(parts)
    return float(stats.f.sf((taken / m) / ((whole - taken) / free), m, free))


def _of_record(fitter: Fitter, fit: Fit, record: Record, i: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    predicted = fitter.predict(fit, record)
    good = record.valid[:, i] & np.isfinite(predicted[:, i])
    return record.observed[:, i] - predicted[:, i], good, np.column_stack([predicted[:, i], record.drive])


def functions_of(signals: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Functions (n, m) of the `signals` (n, k) of each record, each over its range in all records: powers of the signal and of its rate,
    the sign of the rate, its second derivative, the product with the rate, plays, and low-passes."""
    every = np.vstack(signals)
    low, span = every.min(axis=0), np.ptp(every, axis=0)
    there = span > 0
    scaled = [2 * (s[:, there] - low[there]) / span[there] - 1 for s in signals]
    rates = [np.gradient(s, axis=0) for s in scaled]
    fastest = np.maximum(np.abs(np.vstack(rates)).max(axis=0), 1e-300) if there.any() else np.ones(0)
    return [
        np.hstack([_functions(s, v / top) for s, v, top in zip(one.T, rate.T, fastest, strict=True)])
        if one.size
        else np.zeros((len(one), 0))
        for one, rate in zip(scaled, rates, strict=True)
    ]


def _functions(s: np.ndarray, v: np.ndarray) -> np.ndarray:
    """The functions of one signal within -1 ... 1 and its rate within the same."""
    powers = np.polynomial.legendre.legvander(s, MOTION.degree)[:, 1:]
    signs = v / (np.abs(v) + MOTION.standing)
    moving = np.column_stack([v, v**2, v**3, np.abs(v), signs, np.gradient(v), s * v, s * signs])
    plays = np.column_stack([_play(s, width) for width in MOTION.plays])
    lags = np.column_stack([lfilter([1 / T], [1.0, 1 / T - 1], s - s[0]) for T in MOTION.lags])
    return np.hstack([powers, moving, plays, lags])


def _play(s: np.ndarray, half_width: float) -> np.ndarray:
    """What a gear with so much play makes of `s` (n,), which begins in the middle of it."""
    out, now = np.empty_like(s), s[0]
    for k, x in enumerate(s):
        now = min(max(now, x - half_width), x + half_width)
        out[k] = now
    return out


def _beside(values: np.ndarray, others: np.ndarray) -> np.ndarray:
    """`values` (n, ...) without their regression on `others` (n, k)."""
    return values - others @ np.linalg.lstsq(others, values, rcond=None)[0]


def _range_of(Z: np.ndarray) -> np.ndarray:
    """An orthonormal basis (n, m) of the columns, each over its size; directions that are nearly others are left out."""
    size = np.linalg.norm(Z, axis=0)
    Z = Z[:, size > 0] / size[size > 0]
    if not Z.size:
        return np.zeros((len(Z), 0))
    squares, directions = np.linalg.eigh(Z.T @ Z)
    kept = squares > MOTION.alike**2 * squares[-1]
    return Z @ directions[:, kept] / np.sqrt(squares[kept])
