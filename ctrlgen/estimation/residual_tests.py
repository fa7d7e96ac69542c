"""Steps 3 and 9, model validation: whether a structure leaves a residual beyond noise.

Three residuals are tested. That of the held-out records, with the parameters refitted under their posterior (`held_out`), so
that it holds noise alone, also where the device drifts or saturates and a small parameter error grows. That of the records
to fit, by its size. That at rest, where the noise was estimated: its size tells nothing, but stationary noise has neither
memory nor heavy tails after whitening, and a stage that moves by itself has, whatever its parameters within their posterior.

Where nothing but the readings tells the noise of a channel, neither its size nor its memory speaks against a structure: both are those of
the noise as well. There only what goes with the motion is no noise (`goes_with_motion`), and what is left of one record and not of another
(`uneven`).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy import stats
from scipy.ndimage import median_filter

from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.goes_with_motion import goes_with_motion
from ctrlgen.estimation.held_out import HeldOutRefit, refit_to_held_out
from ctrlgen.estimation.misfit import Misfit, misfit
from ctrlgen.estimation.noise import cross_correlation, ljung_box
from ctrlgen.estimation.quiet_stretches import without_lines
from ctrlgen.estimation.settings import DISCREPANCY, HELD_OUT_REFIT, MOTION, OUTLIERS, RESIDUAL_TESTS, STATISTICS
from ctrlgen.numerics.quantisation_step import quantisation_step
from ctrlgen.recordings.recording import Record

# samples of a test of whiteness
SHORTEST = STATISTICS.fewest_per_lag * STATISTICS.whiteness_lags


@dataclass(frozen=True)
class ResidualTests:
    """`ratio` of the held-out residual to the noise, root mean square, by channel; the smallest p of each test.

    `p_values`: "memory" (Ljung-Box), "variance" (McLeod-Li), "drive" (cross-correlation), "size" of the held-out residual,
    "fitted" size of that of the records to fit, of the channels whose noise is told; "motion": that what is left goes with the
    motion, of the others. `restless`: channels that do at rest what no stationary noise does. `passed`: whether the structure is
    valid by all of them. `refitted`: the fit with its numbers moved to the held-out records under their posterior. `by_motion`: p
    of "motion" of each channel whose noise is not told. `uneven`: of such channels the records of which most and least is left, where
    no noise differs so much, and how many times as much.
    """

    ratio: tuple[float, ...]
    p_values: dict[str, float]
    passed: bool
    refitted: Fit
    restless: tuple[str, ...] = ()
    by_motion: dict[str, float] = field(default_factory=dict)
    uneven: dict[str, tuple[str, str, float]] = field(default_factory=dict)

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
    told = ~fitter.noise.guessed
    refit = refit_to_held_out(fitter, fit, HELD_OUT_REFIT.max_steps_tests)
    squares, count, p = _held_out_residual(fitter, refit, told)
    fitted = misfit(fitter.noise, fitter.fit_records, [r.observed - fitter.predict(fit, r) for r in fitter.fit_records])
    ratio = tuple(np.sqrt(squares / np.maximum(count, 1.0)))
    smallest = {name: min(1.0, min(values) * len(values)) for name, values in p.items() if values}
    noticed = max(np.array(ratio)[told], default=0.0) > RESIDUAL_TESTS.noticed_ratio
    rejected = noticed and any(value < RESIDUAL_TESTS.whiteness_p for value in smallest.values())
    by_motion = _by_motion(fitter, fit, refit.fit, np.flatnonzero(~told).tolist())
    if by_motion:
        smallest["motion"] = min(1.0, min(by_motion.values()) * len(by_motion))
        rejected |= smallest["motion"] < MOTION.p
    too_large = bool(told.any()) and _too_large(fitter, fit, told, (squares, count), fitted, smallest)
    restless, uneven = _restless(fitter, fit), _uneven(fitter, fit, refit.fit)
    passed = bool(np.isfinite(ratio).all()) and not (too_large or rejected or restless or uneven)
    return ResidualTests(ratio, smallest, passed, refit.fit, restless, by_motion, uneven)


def _too_large(
    fitter: Fitter,
    fit: Fit,
    told: np.ndarray,
    held_out: tuple[np.ndarray, np.ndarray],
    fitted: Misfit,
    p_values: dict[str, float],
) -> bool:
    """Whether the residual of the channels whose noise is `told` (n_y,) is larger than their noise: that of the `held_out` records by
    squares and counts, or that of those `fitted`. Writes both p into the `p_values`."""
    squares, count = (values[told] for values in held_out)
    # the noise itself is known no better
    margin = 1 + STATISTICS.noise_size_margin / np.sqrt(2 * np.maximum(fitter.noise.count[told], 1.0))
    by_channel = stats.chi2.sf(squares / margin**2, np.maximum(count, 1.0))
    p_values["size"] = min(1.0, len(margin) * min(map(float, by_channel)))
    ratio = np.sqrt(squares / np.maximum(count, 1.0))
    large = bool(np.any(ratio > RESIDUAL_TESTS.error_ratio * margin))
    too_large = large and p_values["size"] < RESIDUAL_TESTS.size_p
    free = max(float(fitted.n_white[:, told].sum()) - len(fit.theta), 1.0)
    left = float(fitted.white[:, told].sum())
    p_values["fitted"] = float(stats.chi2.sf(left / max(margin) ** 2, free))
    large = np.sqrt(left / free) > RESIDUAL_TESTS.error_ratio * max(margin)
    return too_large or bool(large and p_values["fitted"] < RESIDUAL_TESTS.size_p)


def _by_motion(fitter: Fitter, fit: Fit, refitted: Fit, channels: list[int]) -> dict[str, float]:
    """p of what is left of some `channels` to go with the motion by chance, over all records that move."""
    left = [*((fit, r) for r in fitter.fit_records), *((refitted, r) for r in fitter.held_out_records)]
    return {fitter.recording.channels[i]: goes_with_motion(fitter, left, i) for i in channels}


def _uneven(fitter: Fitter, fit: Fit, refitted: Fit) -> dict[str, tuple[str, str, float]]:
    """Of channels whose noise is guessed: the names of the records of which most and least is left, root mean square, and the ratio, where
    it is more than a noise that is the same in all of them makes it."""
    found = {}
    for i in np.flatnonzero(fitter.noise.guessed).tolist() if fitter.recording.kind == "series" else ():
        left = {}
        for each, r in [*((fit, r) for r in fitter.fit_records), *((refitted, r) for r in fitter.held_out_records)]:
            e = (r.observed - fitter.predict(each, r))[r.valid[:, i], i]
            if len(e) > SHORTEST:
                left[r.name] = float(np.sqrt(np.mean(e**2)))
        most, least = (choose(left, key=left.__getitem__, default="") for choose in (max, min))
        if left and left[most] > RESIDUAL_TESTS.uneven * left[least] > 0:
            found[fitter.recording.channels[i]] = most, least, left[most] / left[least]
    return found


def _held_out_residual(
    fitter: Fitter, refit: HeldOutRefit, told: np.ndarray
) -> tuple[np.ndarray, np.ndarray, dict[str, list[float]]]:
    """Huber's loss of the whitened residual (n_y,) with the refit's penalty, usable samples (n_y,), and the p of each test of
    whiteness of the channels whose noise is `told` (n_y,), for which rare spikes are cut."""
    n_y, corner = len(fitter.recording.channels), DISCREPANCY.huber_corner
    unseen = fitter.held_out_records
    left = misfit(fitter.noise, unseen, [r.observed - fitter.predict(refit.fit, r) for r in unseen])
    squares, count = left.white.sum(axis=0) + refit.penalty / n_y, left.n_white.sum(axis=0)
    p: dict[str, list[float]] = {"memory": [], "variance": [], "drive": []}
    for record in unseen:
        white = np.clip(fitter.whitened_residual(refit.fit, record), -corner, corner)
        usable = fitter.noise.usable(record.valid)
        if fitter.recording.kind == "series":
            for i in np.flatnonzero(told).tolist():
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
