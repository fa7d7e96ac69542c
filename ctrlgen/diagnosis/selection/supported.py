"""The causes that the account of the mismatch supports.

A search adds what improves a criterion. The account is stricter: a cause that takes away less than a hundredth of the mismatch, or
whose share or amplitude may be zero, is taken out and the rest fitted again. It stays where noise alone is left with it and more
without it, unless its amplitude may be zero or lies at a bound, so that it stands in for something else; where it takes away much of what
is left, where only the records to fit could show it, and where the others need it: then it is part of them, not a cause.
"""

from __future__ import annotations

from ctrlgen.diagnosis.selection.attribution import Attribution, attribute
from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.objections import outside_its_range
from ctrlgen.diagnosis.selection.pruning import held_out_energy
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.diagnosis.settings import ATTRIBUTION
from ctrlgen.estimation.fit import Fit
from ctrlgen.estimation.robust_covariance import robust_deviations
from ctrlgen.estimation.settings import STATISTICS


def supported(
    trials: Trials, nominal: CandidateModel, current: CandidateModel, seed: int = 0
) -> tuple[CandidateModel, Attribution]:
    """The model without the causes that its account does not support, fitted again, and that account."""
    while True:
        account = attribute(trials.fitter, nominal, current, seed, trials.jobs)
        weak = sorted(_weak(account, current), key=lambda k: _share(account, k))
        without = next(
            (bare for k in weak if (bare := _without(trials, nominal, current, k, account)) is not None), None
        )
        if without is None:
            return current, account
        current = without


def is_shown(account: Attribution, k: int) -> bool:
    """Whether the account shows that cause k takes away a share that counts."""
    share = account.shares[k]
    return account.rest is None or (share is not None and share.value >= ATTRIBUTION.least_share)


def amplitude_may_be_zero(fit: Fit, k: int) -> bool:
    """Whether the 95 % intervals of all amplitudes of cause k include the value at which its law is off."""
    deviations, free = robust_deviations(fit), fit.structure.free_parameters
    sizes = [i for i, u in enumerate(free) if u.cause == k and u.amplitude]
    return bool(sizes) and all(abs(fit.theta[i] - free[i].nominal) < STATISTICS.z_95 * deviations[i] for i in sizes)


def _weak(account: Attribution, current: CandidateModel) -> list[int]:
    return [k for k in range(len(current.causes)) if not is_shown(account, k) or amplitude_may_be_zero(current.fit, k)]


def _share(account: Attribution, k: int) -> float:
    share = account.shares[k]
    return 0.0 if share is None else share.value


def _without(
    trials: Trials, nominal: CandidateModel, current: CandidateModel, k: int, account: Attribution
) -> CandidateModel | None:
    """The model without cause k, fitted to its end; None where it is needed."""
    fitted = trials.tried(current.fit.restarted.without(k), None)
    if not fitted:
        return None
    bare, compare = trials.converged(fitted[0]), trials.selection
    if trials.objections(bare, bare.causes):
        return None
    vague = amplitude_may_be_zero(current.fit, k)
    stands_in = vague or (not is_shown(account, k) and outside_its_range(current.fit, k))
    kept = current.errors.is_noise and not stands_in
    if compare.improves_enough(bare, current) and (kept or compare.unseen_in_held_out(bare)):
        return None
    if not current.errors.is_noise and compare.takes_much(bare, current):
        return None
    energy = [held_out_energy(trials, t) for t in (bare, current, nominal)]
    least = ATTRIBUTION.vague_share if vague else ATTRIBUTION.least_share
    return bare if energy[0] - energy[1] < least * energy[2] else None
