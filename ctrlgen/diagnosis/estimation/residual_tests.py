"""Steps 3 and 9: does a structure leave anything over? Judged on the held-out records, the fitted ones, and at rest.

The numbers are judged where the held-out records are most likely, at the price of how well the fit knows them: then the
squares are those of the noise alone, also of a stage that drifts or saturates, where a little uncertainty goes far. What is
left of the records to fit must be noise in size too. At rest, where the noise was learnt, its size says nothing; but
stationary noise leaves neither memory nor heavy tails after whitening, and a stage that moves by itself does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from ctrlgen.diagnosis.estimation.fit import Fit, Fitter
from ctrlgen.diagnosis.estimation.noise import ljung_box, without_lines
from ctrlgen.diagnosis.settings import HELD_OUT_REFIT, RESIDUAL_TESTS, STATISTICS
from ctrlgen.numerics.quantisation_step import quantisation_step


@dataclass(frozen=True)
class ResidualTests:
    """`ratio` of held-out error to what is expected, per channel; the smallest p of each test; `restless` channels, which
    do at rest what no noise does; `passed` all of it."""

    ratio: tuple[float, ...]
    p_values: dict[str, float]
    passed: bool
    restless: tuple[str, ...] = ()

    @property
    def worst(self) -> float:
        """The largest ratio of any channel."""
        return max(self.ratio, default=float("nan"))


def run_residual_tests(fitter: Fitter, fit: Fit) -> ResidualTests:
    """Ratio per channel, Ljung-Box (memory), McLeod-Li (size that comes and goes), correlation with the drive."""
    n_y = len(fitter.recording.channels)
    moved, price, _ = fitter.refitted_to_held_out(fit, HELD_OUT_REFIT.max_steps_tests)
    squares, expected = np.full(n_y, price / n_y), np.zeros(n_y)
    p: dict[str, list[float]] = {"memory": [], "variance": [], "drive": []}
    for record in fitter.held_out_records:
        white = fitter.whitened_residual(moved, record)
        usable = fitter.noise.usable(record.valid)
        squares += np.sum(white**2, axis=0)
        expected += usable.sum(axis=0)
        if fitter.recording.kind == "series":
            for i in range(n_y):
                e = white[usable[:, i], i]
                if len(e) > STATISTICS.fewest_per_lag * STATISTICS.whiteness_lags:
                    p["memory"].append(ljung_box(e))
                    p["variance"].append(ljung_box(e**2 - np.mean(e**2)))
                    p["drive"].append(cross_correlation(e, record.drive[usable[:, i]]))
    ratio = tuple(np.sqrt(squares / np.maximum(expected, 1.0)))
    smallest = {name: min(1.0, min(values) * len(values)) for name, values in p.items() if values}
    rejected = (
        any(value < RESIDUAL_TESTS.whiteness_p for value in smallest.values())
        and max(ratio, default=0.0) > RESIDUAL_TESTS.noticed_ratio
    )
    doubt = 1 + STATISTICS.noise_size_margin / np.sqrt(
        2 * np.maximum(fitter.noise.count, 1.0)
    )  # the noise itself is known no better
    chance = min(1.0, n_y * min(map(float, stats.chi2.sf(squares / doubt**2, np.maximum(expected, 1.0)))))
    smallest["size"] = chance
    above = (
        any(r > RESIDUAL_TESTS.error_ratio * d for r, d in zip(ratio, doubt, strict=True))
        and chance < RESIDUAL_TESTS.size_p
    )
    free = max(fit.n - len(fit.theta), 1)  # what shows in the records to fit alone is no less left out
    smallest["fitted"] = float(stats.chi2.sf(fit.chi2 / max(doubt) ** 2, free))
    above |= (
        np.sqrt(fit.chi2 / free) > RESIDUAL_TESTS.error_ratio * max(doubt)
        and smallest["fitted"] < RESIDUAL_TESTS.size_p
    )
    restless = tuple(c for i, c in enumerate(fitter.recording.channels) if _moves_at_rest(fitter, fit, i))
    passed = bool(np.isfinite(ratio).all()) and not (above or rejected or restless)
    return ResidualTests(ratio, smallest, passed, restless)


def _moves_at_rest(fitter: Fitter, fit: Fit, i: int) -> bool:
    """Whether what is left of channel i at rest has a memory beyond the noise's, or tails that noise has not."""
    for record in fitter.recording.records:
        if record.role != "rest" or fitter.recording.kind != "series":
            continue
        e = fitter.whitened_residual(fit, record)[fitter.noise.usable(record.valid)[:, i], i]
        read = record.observed[record.valid[:, i], i]
        step = quantisation_step(read)
        if (
            len(e) < STATISTICS.fewest_per_lag * STATISTICS.whiteness_lags
            or np.ptp(read) == 0
            or step > RESIDUAL_TESTS.coarse_reading * fitter.noise.floor[i]
        ):
            continue
        e = without_lines(e)  # a vibration is looked for by itself
        if min(ljung_box(e), float(stats.kurtosistest(e).pvalue)) < RESIDUAL_TESTS.rest_p:
            return True
    return False


def cross_correlation(e: np.ndarray, drive: np.ndarray, lags: int = STATISTICS.whiteness_lags) -> float:
    """p of the hypothesis that white `e` is uncorrelated with the drive's changes at lags 0 ... `lags` (Bonferroni)."""
    n, worst = len(e), 0.0
    for u in drive.T:
        u = u - np.mean(u)
        if np.std(u) == 0:
            continue
        for k in range(lags + 1):
            a, b = e[k:], u[: n - k]
            worst = max(worst, abs(float(a @ b)) / (np.std(e) * np.linalg.norm(b)))
    return float(min(1.0, 2 * stats.norm.sf(worst) * (lags + 1) * drive.shape[1]))
