"""How much of the mismatch each accepted cause takes away, with intervals.

The energy E(S) that the causes S leave on the held-out records: the accepted model without the other causes, its parameters
fitted again in a few steps. The share of a cause is its Shapley value,

    phi_k = mean over orders of [E(before k) - E(after k)] / E(nothing),

the average over all orders in which the causes may be added (R. Lindeman, P. Merenda, R. Gold, Introduction to Bivariate and
Multivariate Analysis, 1980; L. Shapley, Contributions to the Theory of Games II, 1953, 307), so that the shares and the rest
add up to one. Intervals are those of a bootstrap over blocks of the records.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np
from pydantic import Field

from ctrlgen.core.forks import in_forks
from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.trials import FAILURES
from ctrlgen.diagnosis.settings import ATTRIBUTION
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.free_parameters import FreeParameter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.least_squares import LeastSquaresProblem
from ctrlgen.estimation.misfit import Misfit, misfit
from ctrlgen.estimation.settings import STATISTICS
from ctrlgen.estimation.structure import Structure
from ctrlgen.numerics.levenberg_marquardt import levenberg_marquardt
from ctrlgen.recordings.recording import Record
from ctrlgen.reporting.result_file import FiniteOrNull, Keys


class ShareEntry(Keys):
    """A share of the mismatch."""

    value: FiniteOrNull = Field(description="Of the energy beyond the noise that the device as described leaves.")
    ci95: tuple[FiniteOrNull, FiniteOrNull] = Field(description="95 % interval, by a bootstrap over blocks.")


@dataclass(frozen=True)
class Attribution:
    """The `shares` of the causes of a model, in its order, and that of the `rest`; None where nothing is to share.

    `held_out`: whether they are of the held-out records; of the records to fit where the held-out ones show no mismatch.
    """

    shares: tuple[ShareEntry | None, ...]
    rest: ShareEntry | None
    held_out: bool

    @property
    def explained(self) -> float:
        """The share that all causes take away together; 0 where nothing is to share."""
        return 0.0 if self.rest is None else 1.0 - self.rest.value


def attribute(
    fitter: Fitter, described: CandidateModel, model: CandidateModel, seed: int = 0, jobs: int = 1
) -> Attribution:
    """The shares of the causes of a `model` of what the device as `described` leaves.

    E(S) is the energy beyond noise that the causes S leave alone, all other numbers as the model has them: fitted again, the
    device's own would bend to take what is missing. Those that its file hardly knows are adapted. The part of the mismatch that
    the model takes away is divided as Shapley's values of E are; the rest is what it leaves of the mismatch. The sets are fitted in
    `jobs` processes.
    """
    fit = model.fit
    n = len(fit.structure.causes)
    held = described.held_out.excess > ATTRIBUTION.least_excess * np.sum(described.held_out.n_plain)
    nominal = described.held_out if held else described.fitted
    chosen = model.held_out if held else model.fitted
    if not n or nominal.excess <= 0:
        return Attribution((None,) * n, None, held)
    records = fitter.held_out_records if held else fitter.fit_records
    before, after = _by_block(nominal), _by_block(chosen)
    left = {frozenset(range(n)): after}
    # for the initial states of incomplete models, which leave much
    rough = fitter.with_errors_of(described.fit)
    subsets = _subsets(n)
    energies = in_forks(lambda present: _left_or_all(rough, fit, present, records, before), subsets, jobs)
    left |= dict(zip(subsets, energies, strict=True))
    bare = left[frozenset()]
    if after.sum() > ATTRIBUTION.hidden * before.sum() and before.sum() < ATTRIBUTION.hidden * bare.sum():
        # the device's own numbers, as they were fitted to it as described, hide the mismatch
        before = bare
    most = ATTRIBUTION.diverged * np.maximum(np.maximum(before, bare), 1.0)
    left = {S: np.minimum(E, most) for S, E in left.items()}
    parts = np.array([_shapley(left, k, n) for k in range(n)])
    rng = np.random.default_rng(seed)
    drawn = rng.integers(0, len(before), (ATTRIBUTION.draws, len(before)))
    sampled = _shares(*(v[..., drawn].sum(axis=-1) for v in (parts, before, after)))
    low, high = np.quantile(sampled, (0.025, 0.975), axis=1)
    value = _shares(parts.sum(axis=-1), before.sum(), after.sum())
    shares = [ShareEntry(value=v, ci95=(a, b)) for v, a, b in zip(value, low, high, strict=True)]
    return Attribution(tuple(shares[:n]), shares[n], held)


def _shares(parts: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Shares (n + 1, ...) of n causes and of the rest, from their `parts` (n, ...) and the energies `before` and `after` (...)."""
    # by chance less may be left than noise
    rest = np.maximum(after, 0.0) / np.maximum(before, 1e-300)
    taken = parts.sum(axis=0)
    scale = np.where(taken > 0, (1 - rest) / np.maximum(taken, 1e-300), 1 / np.maximum(before, 1e-300))
    return np.concatenate([parts * scale, np.asarray(rest)[None]])


def _by_block(left: Misfit) -> np.ndarray:
    """Energy beyond noise (b,) of each block, all channels."""
    return np.sum(left.plain - left.n_plain, axis=1)


def _left_or_all(
    fitter: Fitter, fit: Fit, present: frozenset[int], records: list[Record], everything: np.ndarray
) -> np.ndarray:
    """What `left_by` leaves of each block (b,); all of it where no such device can stand or be simulated."""
    try:
        return _by_block(left_by(fitter, fit, present, records))
    except FAILURES:
        return everything


def _subsets(n: int) -> list[frozenset[int]]:
    """The sets of causes but the whole one: all, or none, those of one, and of all but one, where there are too many."""
    sizes = range(n) if n <= ATTRIBUTION.most_causes else (0, 1, n - 1)
    return [frozenset(chosen) for size in sizes for chosen in combinations(range(n), size)]


def _shapley(left: dict[frozenset[int], np.ndarray], k: int, n: int) -> np.ndarray:
    """What cause k takes away of each block (b,), the mean over orders; of many causes, that of coming first and last, scaled
    so that the shares add up."""
    if n <= ATTRIBUTION.most_causes:
        return sum(
            (left[S] - left[S | {k}]) / (n * comb(n - 1, len(S))) for S in left if k not in S and S | {k} in left
        )
    everyone = frozenset(range(n))

    def both(j: int) -> np.ndarray:
        first = left[frozenset()] - left[frozenset({j})]
        return (first + left[everyone - {j}] - left[everyone]) / 2

    total = sum(both(j).sum() for j in range(n))
    all_ = (left[frozenset()] - left[everyone]).sum()
    return both(k) * (all_ / total if total > 0 else 1.0)


def left_by(fitter: Fitter, fit: Fit, present: frozenset[int], records: list[Record]) -> Misfit:
    """What the model leaves with the `present` causes alone, those of the device's own numbers adapted that are hardly known."""
    structure = fit.structure
    values = {_key(structure, p): value for p, value in zip(structure.free_parameters, fit.theta, strict=True)}
    for k in sorted(set(range(len(structure.causes))) - present, reverse=True):
        structure = structure.without(k)
    theta = np.array([values.get(_key(structure, p), p.nominal) for p in structure.free_parameters])
    problem = _WithinStated(structure, fitter, theta)
    x = levenberg_marquardt(problem, problem.start, ATTRIBUTION.steps)
    nothing = np.zeros(0)
    reduced = Fit(structure, problem.to_si(x)[: problem.k], (), 0.0, fit.n, nothing, nothing, 0.0, fit.shapes)
    return misfit(fitter.noise, records, [r.observed - fitter.predict(reduced, r) for r in records])


def _key(structure: Structure, p: FreeParameter) -> tuple[Hypothesis | None, str]:
    """What a number is in any structure: a cause's, or the device's own, which a cause may have been."""
    return (None, p.path) if p.cause is None else (structure.causes[p.cause], p.name)


class _WithinStated(LeastSquaresProblem):
    """A fit in which numbers stay as they are, but for those of the device that are hardly known, within their stated 95 %."""

    def __init__(self, structure: Structure, fitter: Fitter, theta: np.ndarray) -> None:
        super().__init__(structure, fitter.recording, fitter.error)
        self.start = self.to_scaled(np.concatenate([theta, np.zeros(self.n_initial)]))

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        low, high = super().bounds
        for i, (p, value) in enumerate(zip(self.structure.free_parameters, self.start[: self.k], strict=True)):
            open_ = p.cause is None and p.sd is not None and p.sd >= ATTRIBUTION.hardly_known * abs(p.nominal)
            reach = STATISTICS.z_95 * (p.sd or 0.0) / self.scale[i] if open_ else ATTRIBUTION.fixed
            centre = p.nominal / self.scale[i] if open_ else value
            low[i] = max(low[i], min(centre - reach, value))
            high[i] = min(high[i], max(centre + reach, value + ATTRIBUTION.fixed))
        return low, high
