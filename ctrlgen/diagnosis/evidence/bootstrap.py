"""Confidence intervals that do not rest on the noise model: a residual block bootstrap.

Each replicate is a synthetic recording: the prediction of the chosen model, plus its residuals in blocks drawn with
replacement. Blocks keep the correlation between neighbouring samples and between channels. Parameters that the device
file states with a standard deviation get new stated values, drawn within it. The model is refitted to each replicate;
the intervals are percentiles of the refitted parameters. They are conditional on the model: other causes are not tried.

Source: H. R. Kuensch, Ann. Statist. 17 (1989) 1217.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydantic import Field

from ctrlgen.core.parallel import Failure, run_all, sendable
from ctrlgen.core.percent import percent
from ctrlgen.core.units import from_si
from ctrlgen.diagnosis.selection.findings import Estimate
from ctrlgen.diagnosis.selection.search_result import SearchResult
from ctrlgen.diagnosis.settings import BOOTSTRAP
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Record, Recording
from ctrlgen.reporting.result_file import FiniteOrNull, Keys

Progress = Callable[[int, int], None]


class Bootstrap(Keys):
    """Percentile intervals of a diagnosis: what bootstrap.json holds."""

    replicates: int = Field(description="Recordings that were refitted.")
    block: tuple[int, ...] = Field(description="Length of the blocks [samples] of each record to fit.")
    values: dict[str, Estimate] = Field(
        description="Estimate and 95 % interval by parameter path, as in `Diagnosis.values`."
    )
    vanished: dict[str, FiniteOrNull] = Field(
        description="Share of the replicates, by finding, whose amplitude lies on a bound or has the other sign."
    )
    failed: tuple[str, ...] = Field(description="Reasons of replicates that could not be refitted, each once.")
    note: str = Field(description="How it was done, and whether there are too few replicates.")

    def sentences(self) -> list[str]:
        """How often each finding vanished, and why replicates failed."""
        vanished = [f"{name} vanished in {percent(share)} of them" for name, share in self.vanished.items()]
        return [*vanished, *(f"some failed: {reason}" for reason in self.failed)]


@dataclass(frozen=True, eq=False)
class Replicate:
    """The refit of one replicate as a function of its seed; it can be sent to another process."""

    structure: Structure
    theta: np.ndarray
    recording: Recording
    fitter: Fitter
    predicted: tuple[np.ndarray, ...]
    blocks: tuple[int, ...]

    def __call__(self, seed: list[int]) -> np.ndarray:
        """The parameters [SI] refitted to records with the residual redrawn."""
        rng = np.random.default_rng(seed)
        records = tuple(
            replace(r, observed=y + redrawn(r, y, block, rng))
            for r, y, block in zip(self.recording.records, self.predicted, self.blocks, strict=True)
        )
        fitter = replace(self.fitter, recording=replace(self.recording, records=records))
        stated = tuple(
            replace(p, nominal=float(np.clip(value + p.sd * rng.standard_normal(), p.low, p.high))) if p.sd else p
            for p, value in zip(self.structure.free_parameters, self.theta, strict=True)
        )
        return fitter.fit(replace(self.structure, free=stated), self.theta).theta


def redrawn(record: Record, predicted: np.ndarray, block: int, rng: np.random.Generator) -> np.ndarray:
    """Centred residuals (n, n_y) of `record`, redrawn in blocks of `block` samples; samples that are not valid count as zero."""
    left = np.where(record.valid, record.observed - predicted, np.nan)
    with np.errstate(all="ignore"):
        count = np.maximum(np.isfinite(left).sum(axis=0), 1)
        left = left - np.nansum(left, axis=0) / count
    n = len(left)
    begins = rng.integers(0, n, -(-n // block))
    # circular, so that every sample is equally likely
    rows = ((begins[:, None] + np.arange(block)) % n).ravel()[:n]
    return np.nan_to_num(left[rows])


def block_length(record: Record, predicted: np.ndarray) -> int:
    """Block length [samples]: twice the largest lag with a significant autocorrelation, at least n^(1/3); 1 for poses."""
    n = len(record.time)
    if record.poses:
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
    search: SearchResult,
    replicates: int = 200,
    seed: int = 0,
    scheduler: str | None = None,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> Bootstrap:
    """Percentile intervals of every fitted parameter of the chosen model.

    The result depends on `seed` alone, not on where the replicates run (see `ctrlgen.core.parallel`). A device whose
    functions cannot be sent to another process (lambdas of a user's device) is refitted in this process.
    """
    fit, fitter = search.chosen.fit, search.fitter
    recording = replace(fitter.recording, records=tuple(fitter.fit_records))
    predicted = tuple(fitter.predict(fit, r) for r in recording.records)
    blocks = tuple(block_length(r, y) for r, y in zip(recording.records, predicted, strict=True))
    work = Replicate(
        fit.structure,
        fit.theta,
        recording,
        replace(fitter, checkpoint=None),
        predicted,
        blocks,
    )
    if scheduler is None and not sendable(work):
        jobs = 0
    items = [[seed, k] for k in range(replicates)]
    results: list[Any] = [None] * replicates
    if len(fit.theta):
        for k, theta in run_all(work, items, scheduler, jobs, progress):
            results[k] = theta
    thetas = [r for r in results if isinstance(r, np.ndarray)]
    failed = tuple(dict.fromkeys(r.what for r in results if isinstance(r, Failure)))
    return _summary(fit.structure, fit.theta, np.array(thetas), blocks, failed)


def _summary(
    structure: Structure, theta: np.ndarray, drawn: np.ndarray, blocks: tuple[int, ...], failed: tuple[str, ...]
) -> Bootstrap:
    """Percentiles by path, and the share of replicates in which each finding vanished."""
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
    note = f"residual blocks of {', '.join(map(str, sorted(set(blocks))))} samples, the model unchanged{few}"
    return Bootstrap(replicates=len(drawn), block=blocks, values=values, vanished=vanished, failed=failed, note=note)
