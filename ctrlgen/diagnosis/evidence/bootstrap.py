"""How sure the numbers of a finding are, without trusting the noise's model: a residual block bootstrap.

Each replicate is a recording that could have been: what the chosen structure predicts, plus its own residuals in blocks
drawn with replacement (blocks keep what neighbouring samples and channels have in common), plus stated numbers drawn
anew within their deviations. The structure is fitted to it again. Intervals are percentiles of the replicates.

H. R. Kuensch, Ann. Statist. 17 (1989) 1217. The intervals hold given the structure: they do not ask for another cause.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ctrlgen.core.parallel import Failure, run_all, sendable
from ctrlgen.core.units import from_si
from ctrlgen.diagnosis.estimation.fit import Fitter
from ctrlgen.diagnosis.estimation.noise import Noise
from ctrlgen.diagnosis.estimation.structure import FreeParameter, Structure
from ctrlgen.diagnosis.selection.result import Diagnosis, Estimate
from ctrlgen.diagnosis.settings import BOOTSTRAP
from ctrlgen.recordings.recording import Record, Recording

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Bootstrap:
    """`values` percentile intervals by path, as in `Diagnosis.values`; `replicates` refitted, `failed` with reasons.

    `vanished` is the share of replicates, by finding, in which its amplitude stands on a bound or at nothing.
    """

    replicates: int
    block: tuple[int, ...]
    values: dict[str, Estimate]
    vanished: dict[str, float]
    failed: tuple[str, ...]
    note: str


@dataclass(frozen=True, eq=False)
class _Drawn(Structure):
    """A structure whose stated numbers were stated a little differently."""

    stated: tuple[float, ...] = ()

    @cached_property
    def free_parameters(self) -> tuple[FreeParameter, ...]:
        """As of the structure, with other nominal numbers, where those have a deviation."""
        base = Structure(self.device, self.causes, self.starts).free_parameters
        return tuple(
            replace(u, nominal=nominal) if u.sd else u for u, nominal in zip(base, self.stated, strict=True)
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Replicate:
    """One replicate's fit, as a function of its seed; what all have in common travels with it."""

    structure: Structure
    theta: np.ndarray
    recording: Recording
    noise: Noise
    predicted: tuple[np.ndarray, ...]
    blocks: tuple[int, ...]
    token: str

    def __call__(self, seed: list[int]) -> np.ndarray:
        """The refitted unknowns [SI]."""
        rng = np.random.default_rng(seed)
        records = tuple(
            replace(r, observed=y + redrawn(r, y, block, rng))
            for r, y, block in zip(self.recording.records, self.predicted, self.blocks, strict=True)
        )
        fitter = Fitter(replace(self.recording, records=records), self.noise)
        if self.token not in _COMPILED:
            _COMPILED.clear()
            _COMPILED[self.token] = {}
        fitter.cache = _COMPILED[self.token]
        s = self.structure
        stated = tuple(
            float(np.clip(value + u.sd * rng.standard_normal(), u.low, u.high)) if u.sd else u.nominal
            for u, value in zip(s.free_parameters, self.theta, strict=True)
        )
        return fitter.fit(_Drawn(s.device, s.causes, s.starts, stated=stated), self.theta).theta


_COMPILED: dict[str, dict] = {}  # of the one bootstrap at hand: every replicate of it integrates the same expressions


def redrawn(record: Record, predicted: np.ndarray, block: int, rng: np.random.Generator) -> np.ndarray:
    """Centred residuals (n, n_y) in blocks from anywhere in the record; what is not valid there counts as zero."""
    left = np.where(record.valid, record.observed - predicted, np.nan)
    with np.errstate(all="ignore"):
        count = np.maximum(np.isfinite(left).sum(axis=0), 1)
        left = left - np.nansum(left, axis=0) / count
    n = len(left)
    begins = rng.integers(0, n, -(-n // block))
    rows = ((begins[:, None] + np.arange(block)) % n).ravel()[:n]  # circular, so that every sample is drawn alike
    return np.nan_to_num(left[rows])


def block_length(record: Record, predicted: np.ndarray) -> int:
    """Twice the lag beyond which no residual correlates, n^(1/3) at the least; 1 for settled poses."""
    n = len(record.time)
    if not np.isfinite(record.sample_time):
        return 1
    longest = 1
    for i in range(predicted.shape[1]):
        e = np.where(record.valid[:, i], record.observed[:, i] - predicted[:, i], 0.0)
        e = e - e.mean()
        lags = np.arange(1, min(BOOTSTRAP.longest_lag, n // 4) + 1)
        r = np.array([e[:-k] @ e[k:] for k in lags]) / max(float(e @ e), 1e-300)
        loud = np.flatnonzero(np.abs(r) > BOOTSTRAP.correlated / np.sqrt(n))
        longest = max(longest, int(lags[loud[-1]]) if len(loud) else 1)
    return int(np.clip(max(2 * longest, round(n ** (1 / 3))), 1, max(n // BOOTSTRAP.fewest_blocks, 1)))


def bootstrap(
    diagnosis: Diagnosis,
    replicates: int = 200,
    seed: int = 0,
    scheduler: str | None = None,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> Bootstrap:
    """Percentile intervals of every fitted number of `diagnosis`; the same for a seed wherever it runs.

    A device whose functions cannot be sent to another process (lambdas of a user's device) is refitted here.
    """
    fit, fitter = diagnosis.search.chosen.fit, diagnosis.fitter
    recording = replace(fitter.recording, records=tuple(fitter.fit_records))
    predicted = tuple(fitter.predict(fit, r) for r in recording.records)
    blocks = tuple(block_length(r, y) for r, y in zip(recording.records, predicted, strict=True))
    work = Replicate(fit.structure, fit.theta, recording, fitter.noise, predicted, blocks, os.urandom(8).hex())
    if scheduler is None and not sendable(work):
        jobs = 0
    items = [[seed, k] for k in range(replicates)]
    results: list[Any] = [None] * replicates
    if len(fit.theta):
        for k, found in run_all(work, items, scheduler, jobs, progress):
            results[k] = found
    thetas = [r for r in results if isinstance(r, np.ndarray)]
    failed = tuple(dict.fromkeys(r.what for r in results if isinstance(r, Failure)))
    return _summary(fit.structure, fit.theta, np.array(thetas), blocks, failed)


def _summary(
    structure: Structure, theta: np.ndarray, drawn: np.ndarray, blocks: tuple[int, ...], failed: tuple[str, ...]
) -> Bootstrap:
    """Percentiles by path; the shares in which a finding vanished."""
    values, vanished = {}, {}
    for i, unknown in enumerate(structure.free_parameters):
        if not len(drawn):
            break
        ends = np.percentile(drawn[:, i], BOOTSTRAP.percentiles)
        shown = [float(from_si(v, unknown.unit)) for v in (theta[i], *ends)]
        values[unknown.path] = Estimate(shown[0], (shown[1], shown[2]), unknown.unit)
        if unknown.amplitude and unknown.cause is not None:
            cause, span = structure.causes[unknown.cause], 1e-6 * (unknown.high - unknown.low)
            v, nominal = drawn[:, i], unknown.nominal
            gone = (v <= unknown.low + span) | (v >= unknown.high - span)
            gone |= np.sign(v - nominal) != np.sign(theta[i] - nominal)
            vanished[f"{cause.effect} at {cause.location}"] = float(np.mean(gone))
    few = (
        f"; fewer than {BOOTSTRAP.fewest_replicates} replicates are too few for 95 % intervals"
        if len(drawn) < BOOTSTRAP.fewest_replicates
        else ""
    )
    note = f"residual blocks of {', '.join(map(str, sorted(set(blocks))))} samples, the structure held{few}"
    return Bootstrap(len(drawn), blocks, values, vanished, failed, note)
