"""Corrections of the generated C against their reference: what is added in every sample of three runs, and what each run teaches."""

from __future__ import annotations

import numpy as np

from ctrlgen.controller.correction import CorrectionLearning, Corrections
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.online.corrected import corrections_of
from ctrlgen.firmware.online.correction_vectors import ERRORS, ROUNDINGS, tolerance
from ctrlgen.verification.compared_program import ComparedProgram
from ctrlgen.verification.comparison_entry import ComparisonEntry, ComparisonKind, entry_of

WAYS = 4  # samples of a run, over the fewest from which is learnt


def correction_rows(program: ComparedProgram) -> list[ComparisonEntry]:
    """All comparisons of the corrections of one build; none where the scenario has no correction."""
    ref, real = program.reference, program.real
    corrections = corrections_of(ref.scenario, ref.controller.kernels)
    if corrections is None or not isinstance(real, Real):  # the controller in integers has none
        return []
    targets, measured = _runs(corrections, real)
    n = targets.shape[1]
    ends = (np.arange(n) == n - 1).astype(float)[:, None]
    records = np.vstack([np.hstack([ends, t, m]) for t, m in zip(targets, measured, strict=True)])
    answer = program.run("learn", records, targets.shape[2] + corrections.count)
    learning, status, added, numbers, near = CorrectionLearning.begin(corrections), [], [], [], []
    for run, of in enumerate(zip(targets, measured, strict=True)):
        rows = answer[run * n : (run + 1) * n]
        added.append(rows[:, 1 : 1 + targets.shape[2]] - corrections.corrected(learning.values, of[0]))
        near.append(tolerance(corrections, learning.values, of[0], real))
        learning, ended = learning.after_run(*of)
        status.append([rows[:-1, 0].any() + abs(rows[-1, 0] - ended)])
        numbers.append(rows[-1, 1 + targets.shape[2] :] - learning.values)
    off = np.abs(np.vstack(added)) / np.max(near, axis=0)  # of what each channel may be off
    bounds = np.concatenate([np.full(c.basis.count, c.bound) for c in corrections.each])
    rounded = max(ROUNDINGS, n) * real.epsilon  # sums round once a sample
    return [
        entry_of(program.build, ComparisonKind.LEARNT, "status", "1", np.array(status), 0.0),
        entry_of(program.build, ComparisonKind.CORRECTED, "share of what is allowed", "1", off, 1.0),
        entry_of(program.build, ComparisonKind.LEARNT, "share of the bound", "1", np.vstack(numbers) / bounds, rounded),
    ]


def _runs(corrections: Corrections, real: Real) -> tuple[np.ndarray, np.ndarray]:
    """Targets (3, n, channels * (order + 1)) and what is measured (3, n, channels), as the arithmetic holds them."""
    rng, runs, n = np.random.default_rng(8), len(ERRORS), WAYS * corrections.fewest
    flat = np.zeros((runs, n, corrections.channels * (corrections.order + 1)))
    for c in corrections.each:
        flat[:, :, c.over] = c.basis.origin + c.basis.length * np.sort(rng.uniform(-0.2, 1.2, n))
        for k in range(1, corrections.order + 1):
            flat[:, :, c.over + k * corrections.channels] = c.basis.length * rng.uniform(-1, 1, n)
    measured = flat[:, :, : corrections.channels].copy()
    for c in corrections.each:
        shape = rng.uniform(-1, 1, n)
        measured[:, :, c.of] += c.bound * (np.outer(ERRORS, shape) + 1)
    if real is Real.FLOAT:
        flat, measured = np.float32(flat).astype(float), np.float32(measured).astype(float)
    return flat, measured
