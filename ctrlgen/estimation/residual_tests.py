"""Steps 3 and 9, model validation: whether a structure leaves a residual beyond noise.

Three residuals are tested. That of the held-out records, with the parameters refitted under their posterior (`held_out`), so
that it holds noise alone, also where the device drifts or saturates and a small parameter error grows. That of the records
to fit, by its size. That at rest, where the noise was estimated: its size tells nothing, but stationary noise has neither
memory nor heavy tails after whitening, and a stage that moves by itself has, whatever its parameters within their posterior.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import stats
from scipy.ndimage import median_filter

from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.held_out import HeldOutRefit, refit_to_held_out
from ctrlgen.estimation.misfit import misfit
from ctrlgen.estimation.noise import cross_correlation, ljung_box, without_lines
from ctrlgen.estimation.settings import DISCREPANCY, HELD_OUT_REFIT, OUTLIERS, RESIDUAL_TESTS, STATISTICS
from ctrlgen.numerics.quantisation_step import quantisation_step
from ctrlgen.recordings.recording import Record

# samples of a test of whiteness
SHORTEST = STATISTICS.fewest_per_lag * STATISTICS.whiteness_lags


@dataclass(frozen=True)
class ResidualTests:
    """`ratio` of the held-out residual to the noise, root mean square, by channel; the smallest p of each test.

    `p_values`: "memory" (Ljung-Box), "variance" (McLeod-Li), "drive" (cross-correlation), "size" of the held-out residual,
    "fitted" size of that of the records to fit. `restless`: channels that do at rest what no stationary noise does. `passed`:
    whether the structure is valid by all of them. `refitted`: the fit with its numbers moved to the held-out records under their posterior.
    """

    ratio: tuple[float, ...]
    p_values: dict[str, float]
    passed: bool
    refitted: Fit
    restless: tuple[str, ...] = ()

    @property
    def worst(self) -> float:
        """The largest ratio of any channel, NaN where there is none."""
        return max(self.ratio, default=float("nan"))


def run_residual_tests(fitter: Fitter, fit: Fit) -> ResidualTests:
    """All residual tests of one fit.

    The size of a residual counts where it exceeds both `error_ratio` and what chance allows, each widened by the uncertainty
    of the noise itself. A test of whiteness counts where its p, after Bonferroni's correction, is below `whiteness_p` and the
    ratio is noticed at all.
    """
    n_y = len(fitter.recording.channels)
    refit = refit_to_held_out(fitter, fit, HELD_OUT_REFIT.max_steps_tests)
    squares, count, p = _held_out_residual(fitter, refit)
    fitted = misfit(fitter.noise, fitter.fit_records, [r.observed - fitter.predict(fit, r) for r in fitter.fit_records])
    ratio = tuple(np.sqrt(squares / np.maximum(count, 1.0)))
    smallest = {name: min(1.0, min(values) * len(values)) for name, values in p.items() if values}
    noticed = max(ratio, default=0.0) > RESIDUAL_TESTS.noticed_ratio
    rejected = noticed and any(value < RESIDUAL_TESTS.whiteness_p for value in smallest.values())
    # the noise itself is known no better
    margin = 1 + STATISTICS.noise_size_margin / np.sqrt(2 * np.maximum(fitter.noise.count, 1.0))
    by_channel = stats.chi2.sf(squares / margin**2, np.maximum(count, 1.0))
    smallest["size"] = min(1.0, n_y * min(map(float, by_channel)))
    large = any(r > RESIDUAL_TESTS.error_ratio * m for r, m in zip(ratio, margin, strict=True))
    too_large = large and smallest["size"] < RESIDUAL_TESTS.size_p
    free, left = max(float(fitted.n_white.sum()) - len(fit.theta), 1.0), float(fitted.white.sum())
    smallest["fitted"] = float(stats.chi2.sf(left / max(margin) ** 2, free))
    large = np.sqrt(left / free) > RESIDUAL_TESTS.error_ratio * max(margin)
    too_large |= large and smallest["fitted"] < RESIDUAL_TESTS.size_p
    restless = _restless(fitter, fit)
    passed = bool(np.isfinite(ratio).all()) and not (too_large or rejected or restless)
    return ResidualTests(ratio, smallest, passed, refit.fit, restless)


def _held_out_residual(fitter: Fitter, refit: HeldOutRefit) -> tuple[np.ndarray, np.ndarray, dict[str, list[float]]]:
    """Huber's loss of the whitened residual (n_y,) with the refit's penalty, usable samples (n_y,), and the p of each test of
    whiteness, for which rare spikes are cut."""
    n_y, corner = len(fitter.recording.channels), DISCREPANCY.huber_corner
    unseen = fitter.held_out_records
    left = misfit(fitter.noise, unseen, [r.observed - fitter.predict(refit.fit, r) for r in unseen])
    squares, count = left.white.sum(axis=0) + refit.penalty / n_y, left.n_white.sum(axis=0)
    p: dict[str, list[float]] = {"memory": [], "variance": [], "drive": []}
    for record in unseen:
        white = np.clip(fitter.whitened_residual(refit.fit, record), -corner, corner)
        usable = fitter.noise.usable(record.valid)
        if fitter.recording.kind == "series":
            for i in range(n_y):
                e = white[usable[:, i], i]
                if len(e) > SHORTEST:
                    p["memory"].append(ljung_box(e))
                    p["variance"].append(ljung_box(e**2 - np.mean(e**2)))
                    p["drive"].append(cross_correlation(e, record.drive[usable[:, i]]))
    return squares, count, p


def _restless(fitter: Fitter, fit: Fit) -> tuple[str, ...]:
    """Channels that move at rest, also with the parameters refitted to rest: the records to fit may leave a number open that shows there,
    as a coefficient of the temperature where only rest is long enough for it to change."""
    channels = fitter.recording.channels
    found = [i for i in range(len(channels)) if _moves_at_rest(fitter, fit, i)]
    if not found:
        return ()
    rests = [r for r in fitter.recording.records if r.role == "rest"]
    refit = refit_to_held_out(fitter, fit, HELD_OUT_REFIT.max_steps_tests, rests)
    beyond = stats.chi2.sf(refit.penalty, max(len(fit.theta), 1)) < RESIDUAL_TESTS.rest_p  # further than the fit allows
    return tuple(channels[i] for i in found if beyond or _moves_at_rest(fitter, refit.fit, i))


def _moves_at_rest(fitter: Fitter, fit: Fit, i: int) -> bool:
    """Whether the whitened residual of channel i at rest has memory (Ljung-Box) or heavy tails (kurtosis)."""
    if fitter.recording.kind != "series":
        return False
    at_rest = (r for r in fitter.recording.records if r.role == "rest")
    return any(_is_no_noise(fitter, fit, record, i) for record in at_rest)


def _is_no_noise(fitter: Fitter, fit: Fit, record: Record, i: int) -> bool:
    readings = record.observed[record.valid[:, i], i]
    coarse = quantisation_step(readings) > RESIDUAL_TESTS.coarse_reading * fitter.noise.floor[i]
    if np.ptp(readings) == 0 or coarse:
        return False
    quiet = _without_rare_spikes(record, fitter.predict(fit, record), i)
    e = fitter.whitened_residual(fit, quiet)[fitter.noise.usable(quiet.valid)[:, i], i]
    if len(e) < SHORTEST:
        return False
    # a vibration is a candidate of its own
    e = without_lines(e)
    return min(ljung_box(e), float(stats.kurtosistest(e).pvalue)) < RESIDUAL_TESTS.rest_p


def _without_rare_spikes(record: Record, predicted: np.ndarray, i: int) -> Record:
    """The record with samples of channel i marked not valid that lie off the median of the samples around, where they are rare.

    What jumps and stays does not lie off, and is no fault of a sensor.
    """
    e = np.where(record.valid[:, i], record.observed[:, i] - predicted[:, i], 0.0)
    off = e - median_filter(e, size=OUTLIERS.around, mode="nearest")
    far = record.valid[:, i] & (np.abs(off) > RESIDUAL_TESTS.spike * np.std(off))
    if not far.any() or np.mean(far) >= RESIDUAL_TESTS.rare:
        return record
    valid = record.valid.copy()
    valid[far, i] = False
    return replace(record, valid=valid)
