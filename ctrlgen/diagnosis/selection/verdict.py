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


def verdict(fitter: Fitter, search: SearchResult, after: ResidualTests, seen: bool = False) -> str:
    """consistent | explained | partly | ambiguous | unexplained; `seen`: something was read off the readings themselves.

    Partly: causes are found, but they leave a little more than noise, or no held-out record shows one of them, or nothing
    tells the noise, so that nobody can say whether all is explained, or the numbers are too loose. Unexplained, too, where
    it takes numbers that the device file excludes: a wrong unit, sign or gain of a column looks like that.
    """
    found, known = seen or search.chosen.fit.structure.causes, bool(fitter.noise.known.all())
    if contradicts_datasheet(search.chosen.fit):
        return UNEXPLAINED
    if (
        known
        and not after.passed
        and not (found and unexplained_share(fitter, search) <= model_error_allowance(search))
    ):
        return UNEXPLAINED
    if not found:
        return CONSISTENT
    if any(search.rivals):
        return AMBIGUOUS
    sure = known and after.passed and not unconfirmed(search) and not poorly_determined(fitter, search)
    return EXPLAINED if sure else PARTLY


def contradicts_datasheet(fit: Fit) -> dict[str, float]:
    """The device's uncertain numbers, by path, that stand more than `VERDICT.named_deviation` stated deviations off, in deviations; empty
    where all of them together are as far off as chance puts them."""
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
    """The causes that no held-out record shows, and that nothing the device states of itself demands."""
    chosen = search.chosen
    return tuple(
        cause
        for cause, bare in zip(chosen.fit.structure.causes, search.without_cause, strict=True)
        if bare.held_out_deviance - chosen.held_out_deviance < MODEL_SELECTION.least_confirmed
        and bare.fit.penalty - chosen.fit.penalty < 0.5 * (bare.fit.objective - chosen.fit.objective)
    )


def poorly_determined(fitter: Fitter, search: SearchResult) -> bool:
    """Whether the held-out records are foreseen worse than before, beyond chance, though the causes may be right: by the
    numbers as fitted, not as far as those are known."""
    worse = fitter.held_out_squares(search.chosen.fit) - fitter.held_out_squares(search.nominal.fit)
    return worse > STATISTICS.chance_excess * np.sqrt(2 * _n_held(fitter))


def model_error_allowance(search: SearchResult) -> float:
    """The share of the mismatch that the chosen causes may leave: what the form of the roughest of their laws may."""
    causes = search.chosen.fit.structure.causes
    return max([VERDICT.model_form_error, *(c.prior.model_form_error for c in causes)])


def unexplained_share(fitter: Fitter, search: SearchResult) -> float:
    """What the chosen causes leave beyond the noise, as a share of what the device as described leaves, both root mean
    square; the larger one of the records to fit and of those held out. An excess below `STATISTICS.chance_excess`
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
