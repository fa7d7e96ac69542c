"""The verdict from what the search found: consistent, explained, partly, ambiguous or unexplained."""

from __future__ import annotations

from enum import StrEnum

import numpy as np
from scipy import stats

from ctrlgen.diagnosis.selection.attribution import Attribution, one_finding
from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.model_selection import ModelSelection
from ctrlgen.diagnosis.selection.ringing_mass import ringing_masses
from ctrlgen.diagnosis.selection.search_result import SearchResult
from ctrlgen.diagnosis.settings import MODEL_SELECTION, VERDICT
from ctrlgen.estimation.error_model import ErrorModel
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.residual_tests import ResidualTests
from ctrlgen.estimation.settings import RESIDUAL_TESTS, STATISTICS
from ctrlgen.estimation.structure import Structure


class Verdict(StrEnum):
    """The answer of a diagnosis in one word."""

    CONSISTENT = "consistent"
    EXPLAINED = "explained"
    PARTLY = "partly"
    AMBIGUOUS = "ambiguous"
    UNEXPLAINED = "unexplained"


def verdict(
    search: SearchResult, tests: ResidualTests, shares: Attribution, detected: bool = False, another_unit: bool = False
) -> Verdict:
    """The verdict. `detected` says whether an effect was detected directly in the readings,
    `another_unit` whether a reading is `in_another_unit`.

    consistent: no cause is found, and what is left is noise or within the tolerance. explained: confirmed causes, and what is
    left is noise, within the tolerance, or too little to name. ambiguous: another cause explains the recording as well as a main one.
    partly: confirmed causes take away `VERDICT.most` of the mismatch, or all of it with parameters too uncertain to predict, or the noise
    is not known. unexplained: they take away less, the fit agrees only with numbers that contradict the device file, or a
    column's unit is wrong; likewise where only a noise that nobody told, and nearly as large as what is read, would make it more.
    """
    if another_unit:
        return Verdict.UNEXPLAINED
    fitter, named = search.fitter, detected or search.chosen.causes
    known = bool(fitter.noise.known.all())
    enough = (known and tests.passed and not untold_noise_drowns(search)) or within_tolerance(search)
    contradicted = bool(contradicts_datasheet(search.chosen.fit))
    if not named:
        left_out = search.withdrawn or (known and not enough)
        return Verdict.UNEXPLAINED if contradicted or left_out else Verdict.CONSISTENT
    if main_rivals(search, shares):
        return Verdict.AMBIGUOUS
    if (enough or too_little_to_name(search, tests)) and not (
        contradicted or unconfirmed(search) or poorly_determined(search)
    ):
        return Verdict.EXPLAINED
    sound = enough or not known or shares.explained >= VERDICT.most
    return Verdict.PARTLY if sound and not (contradicted and shares.explained < VERDICT.most) else Verdict.UNEXPLAINED


def untold_noise_drowns(search: SearchResult) -> bool:
    """Whether what is left of the held-out readings of a channel could only be noise that is `VERDICT.beyond_guess` times what is guessed
    of it and `VERDICT.as_read` of what is read, where nothing but these readings tells the noise. Then they follow the model so
    loosely that they may be of anything else."""
    fitter, left = search.fitter, search.chosen.predicted
    beyond = np.sqrt(left.plain_mean) > VERDICT.beyond_guess
    for i in np.flatnonzero(fitter.noise.guessed & beyond).tolist():
        read = [r.observed[r.valid[:, i], i] for r in fitter.held_out_records]
        about_mean = np.concatenate([y - y.mean() for y in read if len(y)] or [np.zeros(1)])
        size = np.sqrt(left.plain_mean[i]) * fitter.noise.floor[i]
        if size > VERDICT.as_read * np.sqrt(np.mean(about_mean**2)):
            return True
    return False


def in_another_unit(search: SearchResult) -> bool:
    """Whether a reading is that of the device with its stated numbers but for a thousand, or a power of it: a column's unit is
    wrong."""
    fitter = search.fitter
    stated = fitter.fit(Structure(search.nominal.fit.structure.device), steps=0)
    pairs = [(r, fitter.predict(stated, r)) for r in fitter.fit_records]
    for i in range(len(fitter.recording.channels)):
        y, x = (
            np.concatenate(v)
            for v in zip(*[(r.observed[r.valid[:, i], i], p[r.valid[:, i], i]) for r, p in pairs], strict=True)
        )
        y, x = y - np.mean(y), x - np.mean(x)
        if not (np.isfinite(x).all() and np.any(x) and np.any(y)):
            continue
        slope, alike = (x @ y) / (x @ x), (x @ y) ** 2 / ((x @ x) * (y @ y))
        thousands = np.log10(max(abs(slope), 1e-300)) / 3
        if alike > VERDICT.same_shape and round(thousands) and abs(thousands - round(thousands)) < VERDICT.same_unit:
            return True
    return False


def within_tolerance(search: SearchResult) -> bool:
    """Whether the held-out errors of all channels are within the tolerance that the recording states."""
    fitter = search.fitter
    wanted = [t or 0.0 for t in fitter.recording.tolerance]
    if not any(wanted):
        return False
    left = search.chosen.predicted
    rms = np.sqrt(left.plain_mean) * fitter.noise.floor
    noisy = fitter.noise.known & (
        left.white_mean <= 1 + STATISTICS.chance_excess * np.sqrt(2 / left.n_white.sum(axis=0))
    )
    return bool(np.all((rms <= wanted) | noisy))


def too_little_to_name(search: SearchResult, tests: ResidualTests) -> bool:
    """Whether causes leave so little beyond the noise that none is worth a name, however sure it is that something is left.

    In every channel, of the records to fit and of those held out, as they are predicted: less than `MODEL_SELECTION.least_share` of the
    mismatch, in squares, below which the search names no cause; or no more than the noise itself, `VERDICT.no_larger`, and less than
    `VERDICT.unseen_share` of the mismatch. Not where only the readings to be explained tell the noise, which may be motion, nor where a
    channel moves at rest by itself.
    """
    if not search.chosen.causes or not search.fitter.noise.measured.all() or tests.restless:
        return False
    pairs = [(search.nominal.fitted, search.chosen.fitted), (search.nominal.predicted, search.chosen.predicted)]
    return all(bool(np.all(_is_little(was.plain_mean, left.plain_mean))) for was, left in pairs)


def _is_little(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Whether squares `after` are little beside those `before` (n_y,), both in squares of the noise."""
    mismatch, left = np.maximum(before - 1, 0.0), after - 1
    most = MODEL_SELECTION.least_share * mismatch
    unseen = np.minimum(VERDICT.no_larger - 1, VERDICT.unseen_share * mismatch)
    # what the residual tests let pass
    return left <= np.maximum(np.maximum(most, unseen), RESIDUAL_TESTS.error_ratio**2 - 1)


def main_rivals(search: SearchResult, shares: Attribution) -> bool:
    """Whether a cause with a share near the largest has a rival of other physics.

    Where more than noise is left, forms of one physics at one place are one answer: a discrepancy of any model hides which of them
    it is. Of several terms of one law, as harmonics are, the largest counts: what else a small one may be does not change the law.
    """
    first = {terms[0] for terms in terms_of_findings(search)}
    largest = max((s.value for s in shares.shares if s), default=0.0)
    exact = search.chosen.errors.is_noise
    return any(
        any(exact or not _one_physics(cause, r.cause) for r in rivals)
        and (shares.rest is None or (share is not None and share.value >= VERDICT.main_share * largest))
        for k, (cause, rivals, share) in enumerate(zip(search.chosen.causes, search.rivals, shares.shares, strict=True))
        if k in first
    )


def terms_of_findings(search: SearchResult) -> list[list[int]]:
    """By finding its causes, which are terms of one law at one place, the one first without which the held-out records are foretold
    worst."""
    groups: dict[tuple[str | None, ...], list[int]] = {}
    for k, cause in enumerate(search.chosen.causes):
        groups.setdefault(one_finding(cause), []).append(k)

    def left_without(k: int) -> float:
        return float(search.without_cause[k].predicted.plain.sum())

    return [sorted(terms, key=left_without, reverse=True) if len(terms) > 1 else terms for terms in groups.values()]


def _one_physics(cause: Hypothesis, rival: Hypothesis | None) -> bool:
    return (
        rival is not None
        and cause.form_of is not None
        and (rival.form_of, rival.location) == (cause.form_of, cause.location)
    )


def contradicts_datasheet(fit: Fit) -> dict[str, float]:
    """Deviations of the device's uncertain parameters from their stated values, in stated standard deviations, by path.

    Empty where a chi-square test does not reject the stated uncertainty; else the parameters that deviate by more than
    `VERDICT.named_deviation`, or the one that deviates most. A mass that includes what rings (`ringing_masses`) contradicts nothing.
    """
    whole = ringing_masses(fit)
    off = {path: z for path, z in _deviations(fit).items() if path not in whole}
    if not off or stats.chi2.sf(sum(z * z for z in off.values()), len(off)) > VERDICT.impossible_p:
        return {}
    least = min(VERDICT.named_deviation, max(map(abs, off.values())))
    return {path: z for path, z in off.items() if abs(z) >= least}


def moved_numbers(fit: Fit, far: float = VERDICT.far) -> dict[str, float]:
    """Deviations of the device's numbers that lie at least `far` stated standard deviations from the file, by path."""
    return {path: z for path, z in _deviations(fit).items() if abs(z) >= far}


def _deviations(fit: Fit) -> dict[str, float]:
    """Deviations of the device's uncertain numbers from the file, in stated standard deviations, by path."""
    return {
        u.path: float((value - u.nominal) / u.sd)
        for u, value in zip(fit.structure.free_parameters, fit.theta, strict=True)
        if u.sd
    }


def unconfirmed(search: SearchResult) -> tuple[Hypothesis, ...]:
    """Causes that the held-out records do not confirm, except where the device's stated parameters alone require them."""
    compare = ModelSelection(search.fitter, lambda *_, **__: [search.chosen])
    causes = []
    for cause, bare in zip(search.chosen.causes, search.without_cause, strict=True):
        errors = compare.reference((bare, search.chosen))
        confirmed = compare.held_out_loss(bare, errors) - compare.held_out_loss(search.chosen, errors)
        if confirmed < MODEL_SELECTION.least_confirmed and not _hides(bare, search.chosen, compare, errors):
            causes.append(cause)
    return tuple(causes)


def hides_in_device(search: SearchResult, k: int) -> bool:
    """Whether cause k shows by the stated numbers of the device that its absence would bend, more than by the readings."""
    compare, bare = ModelSelection(search.fitter, lambda *_, **__: [search.chosen]), search.without_cause[k]
    bent = bare.fit.penalty > search.chosen.fit.penalty
    return bent and _hides(bare, search.chosen, compare, compare.reference((bare, search.chosen)))


def _hides(bare: CandidateModel, chosen: CandidateModel, compare: ModelSelection, errors: ErrorModel) -> bool:
    gain = compare.fit_loss(bare, errors) - compare.fit_loss(chosen, errors)
    return bare.fit.penalty - chosen.fit.penalty >= MODEL_SELECTION.hidden_share * gain


def poorly_determined(search: SearchResult) -> bool:
    """Whether the chosen model with its parameters as fitted predicts the held-out records significantly worse than the
    device as described. The causes may still be right, and their parameters too uncertain."""
    fitter = search.fitter
    worse = fitter.held_out_squares(search.chosen.fit) - fitter.held_out_squares(search.nominal.fit)
    return worse > STATISTICS.chance_excess * np.sqrt(2 * _n_held(fitter))


def _n_held(fitter: Fitter) -> int:
    """Number of usable samples of the held-out records."""
    return sum(int(fitter.noise.usable(r.valid).sum()) for r in fitter.held_out_records)
