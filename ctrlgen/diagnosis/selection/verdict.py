"""The verdict from what the search found: consistent, explained, partly, ambiguous or unexplained."""

from __future__ import annotations

import numpy as np
from scipy import stats

from ctrlgen.diagnosis.estimation.fit import Fit, Fitter
from ctrlgen.diagnosis.estimation.residual_tests import ResidualTests
from ctrlgen.diagnosis.hypotheses.hypotheses import Hypothesis
from ctrlgen.diagnosis.selection.candidate_model import SearchResult
from ctrlgen.diagnosis.settings import MODEL_SELECTION, STATISTICS, VERDICT

CONSISTENT, EXPLAINED, PARTLY, AMBIGUOUS, UNEXPLAINED = "consistent", "explained", "partly", "ambiguous", "unexplained"


def verdict(fitter: Fitter, search: SearchResult, tests: ResidualTests, detected: bool = False) -> str:
    """The verdict: one of the five words above; `detected` says whether an effect was detected directly in the readings.

    unexplained: the residual exceeds the noise by more than the model-form error of the causes, or the fit contradicts the
    stated uncertainty of the device file, as a wrong unit, sign or gain of a recorded column would make it.
    consistent: no cause is found. ambiguous: other causes explain the recording equally well.
    partly: causes are found, but a residual within the model-form error remains, the held-out records do not confirm a
    cause, the noise is not known, or the parameters are too uncertain to predict the held-out records.
    explained: otherwise.
    """
    found, known = detected or search.chosen.fit.structure.causes, bool(fitter.noise.known.all())
    if contradicts_datasheet(search.chosen.fit):
        return UNEXPLAINED
    if (
        known
        and not tests.passed
        and not (found and unexplained_share(fitter, search) <= model_error_allowance(search))
    ):
        return UNEXPLAINED
    if not found:
        return CONSISTENT
    if any(search.rivals):
        return AMBIGUOUS
    certain = known and tests.passed and not unconfirmed(search) and not poorly_determined(fitter, search)
    return EXPLAINED if certain else PARTLY


def contradicts_datasheet(fit: Fit) -> dict[str, float]:
    """Deviations of the device's uncertain parameters from their stated values, in stated standard deviations, by path.

    Empty where a chi-square test does not reject the stated uncertainty; else the parameters that deviate by more than
    `VERDICT.named_deviation`, or the one that deviates most.
    """
    off = {
        u.path: float((value - u.nominal) / u.sd)
        for u, value in zip(fit.structure.free_parameters, fit.theta, strict=True)
        if u.sd
    }
    if not off or stats.chi2.sf(sum(z * z for z in off.values()), len(off)) > VERDICT.impossible_p:
        return {}
    least = min(VERDICT.named_deviation, max(map(abs, off.values())))
    return {path: z for path, z in off.items() if abs(z) >= least}


def unconfirmed(search: SearchResult) -> tuple[Hypothesis, ...]:
    """Causes that the held-out records do not confirm, except where the device's stated parameters alone require them."""
    chosen = search.chosen
    return tuple(
        cause
        for cause, bare in zip(chosen.fit.structure.causes, search.without_cause, strict=True)
        if bare.held_out_deviance - chosen.held_out_deviance < MODEL_SELECTION.least_confirmed
        and bare.fit.penalty - chosen.fit.penalty < 0.5 * (bare.fit.objective - chosen.fit.objective)
    )


def poorly_determined(fitter: Fitter, search: SearchResult) -> bool:
    """Whether the chosen model with its parameters as fitted predicts the held-out records significantly worse than the
    device as described. The causes may still be right, and their parameters too uncertain."""
    worse = fitter.held_out_squares(search.chosen.fit) - fitter.held_out_squares(search.nominal.fit)
    return worse > STATISTICS.chance_excess * np.sqrt(2 * _n_held(fitter))


def model_error_allowance(search: SearchResult) -> float:
    """Share of the mismatch (rms) that the chosen causes may leave: the largest model-form error of their laws."""
    causes = search.chosen.fit.structure.causes
    return max([VERDICT.model_form_error, *(c.prior.model_form_error for c in causes)])


def unexplained_share(fitter: Fitter, search: SearchResult) -> float:
    """Residual of the chosen model beyond the noise, over that of the device as described, both root mean square; the
    larger value of the records to fit and of the held-out records. An excess below `STATISTICS.chance_excess`
    standard deviations of chi-square counts as noise."""
    n_held = _n_held(fitter)
    after, before = search.chosen, search.nominal
    shares = [0.0]
    for left, all_, n in (
        (after.fit.objective, before.fit.objective, after.fit.n),
        (after.held_out_deviance, before.held_out_deviance, n_held),
    ):
        if left - n > STATISTICS.chance_excess * np.sqrt(2 * n):
            shares.append(float(np.sqrt((left - n) / max(all_ - n, left - n))))
    return max(shares)


def _n_held(fitter: Fitter) -> int:
    """Usable samples of the held-out records."""
    return sum(int(fitter.noise.usable(r.valid).sum()) for r in fitter.held_out_records)
