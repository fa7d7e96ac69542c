"""Reference vectors of corrections for the self test: targets with what is added to them, and what three runs teach."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ctrlgen.controller.correction import EARLY, CorrectionLearning, Corrections
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.online.corrected import stored

TARGETS = 12
SHARE = 0.75  # of the bound, that the numbers of the vectors use: a quarter is left for what is learnt
ERRORS = (0.25, 0.125, 0.2)  # of the bound, in three runs: the third is worse than the second
ROUNDINGS = 16  # of the largest number, as everywhere in the comparison


def correction_vectors(corrections: Corrections, context: Mapping[str, Any], real: Real) -> dict[str, Any]:
    """What selftest_correction.c.j2 needs; `context` is that of the correction's own templates."""
    values = _values(corrections)
    targets = _targets(corrections, real)
    expected = corrections.corrected(values, targets)
    samples = 2 * corrections.fewest
    learnt = _learnt(corrections, samples)
    # sums over a run round once a sample; what is measured of an angle or a way is rounded itself
    longest = max(abs(c.basis.origin) + c.basis.length for c in corrections.each)
    off = max(ROUNDINGS, samples) * real.epsilon * max(c.bound for c in corrections.each)
    off += ROUNDINGS * real.epsilon * longest
    return {
        "rows": list(zip(targets, expected, strict=True)),
        "near": tolerance(corrections, values, targets, real),
        "samples": samples,
        "early": EARLY,
        "errors": ERRORS,
        "learnt": learnt,
        "learnt_near": max(off, float(np.finfo(np.float32).tiny)),
        "bytes": stored(context["mark"], values),
        "terms": context["terms"],
        "swept": {term["over"]: term for term in context["terms"]},
        "mark": context["mark"],
        "sums": context["sums"],
        "numbers": corrections.count,
        "channels": corrections.channels,
        "order": corrections.order,
    }


def tolerance(corrections: Corrections, values: np.ndarray, targets: np.ndarray, real: Real) -> np.ndarray:
    """(channels * (order + 1),) [SI] by how much a corrected target may be off: roundings of what it is a sum of, and what the correction
    changes where its channel is rounded."""
    moved = targets * (1 + ROUNDINGS / 2 * real.epsilon)
    expected, then = corrections.corrected(values, targets), corrections.corrected(values, moved)
    slope = np.abs((then - moved) - (expected - targets)).max(axis=0)
    size = np.maximum(np.abs(expected).max(axis=0), np.abs(expected - targets).max(axis=0))
    # harmonics are sums of sums: one rounding each
    terms = max(c.basis.count for c in corrections.each)
    off = ROUNDINGS * real.epsilon * size + 4 * slope + terms * real.epsilon * np.abs(expected - targets).max(axis=0)
    return np.asarray(off + np.finfo(np.float32).tiny)  # of a channel that stays at zero


def _values(corrections: Corrections) -> np.ndarray:
    """Numbers within their bounds that differ from one another, exact in float."""
    parts = []
    for c in corrections.each:
        n = c.basis.count
        shares = 2 * (7 * np.arange(n) % n + 1) / n - 1
        parts.append(SHARE * c.bound * shares / (1 if c.basis.kind == "table" else n))
    return np.float32(np.concatenate(parts)).astype(float)


def _targets(corrections: Corrections, real: Real) -> np.ndarray:
    """(TARGETS, channels * (order + 1)) over one and a half lengths of each correction, and as fast."""
    rng = np.random.default_rng(7)
    targets = np.zeros((TARGETS, corrections.channels, corrections.order + 1))
    for c in corrections.each:
        at = c.basis.origin + c.basis.length * np.linspace(-0.25, 1.25, TARGETS)
        targets[:, c.over, 0] = at
        targets[:, c.over, 1:] = c.basis.length * rng.uniform(-1, 1, (TARGETS, corrections.order))
    flat = targets.transpose(0, 2, 1).reshape(TARGETS, -1)
    return flat if real is Real.DOUBLE else np.float32(flat).astype(float)


def _learnt(corrections: Corrections, samples: int) -> list[np.ndarray]:
    """The numbers after each of the runs, as the self test makes them."""
    k = np.arange(samples)
    targets = np.zeros((samples, corrections.channels))
    for c in corrections.each:
        targets[:, c.over] = c.basis.origin + c.basis.length * (2 * k + 1) / (2 * samples)
    learning, found = CorrectionLearning.begin(corrections), []
    for share in ERRORS:
        measured = targets.copy()
        for c in corrections.each:
            measured[:, c.of] += share * c.bound * ((7 * k % samples) / samples + 2)
        learning, _ = learning.after_run(targets, measured)
        found.append(learning.values)
    return found
