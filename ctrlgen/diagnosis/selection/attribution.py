"""How much of the mismatch each accepted cause takes away, with intervals: one account, of the error that the tables call "before".

The energy E(S) that the causes S leave on the held-out records: the accepted model without the other causes, its parameters
fitted again in a few steps. What a cause takes away is its Shapley value,

    phi_k = mean over orders of E(before k) - E(after k),

the average over all orders in which the causes may be added (R. Lindeman, P. Merenda, R. Gold, Introduction to Bivariate and
Multivariate Analysis, 1980; L. Shapley, Contributions to the Theory of Games II, 1953, 307). With the energies beyond noise E0 of
the device as described and E1 of the accepted model,

    left = E1/E0,   share_k = (1 - left) max(phi_k, 0)/sum max(phi, 0),

so that shares are never negative and add up to one with what is left, in every channel and in all. Intervals are those of a
bootstrap over blocks of the records. Where the noise of a channel is not known, its whole error counts.
"""

from __future__ import annotations

from dataclasses import dataclass, field
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

    Causes of one law at one place are one: each has the share of all of them. A cause whose share may be zero has none, and what it
    takes away counts for the others. `channels`: by reading the shares of the causes and, last, what is left; of readings that show
    a mismatch alone. `serves`: by cause the other one that needs it most. `held_out`: whether they are of the held-out records; of
    the records to fit where the held-out ones show no mismatch.
    """

    shares: tuple[ShareEntry | None, ...]
    rest: ShareEntry | None
    held_out: bool
    channels: dict[str, tuple[float, ...]] = field(default_factory=dict)
    serves: tuple[int | None, ...] = ()

    @property
    def explained(self) -> float:
        """The share that all causes take away together; 0 where nothing is to share, or more is left than there was."""
        return 0.0 if self.rest is None else max(1.0 - self.rest.value, 0.0)


def attribute(
    fitter: Fitter, described: CandidateModel, model: CandidateModel, seed: int = 0, jobs: int = 1
) -> Attribution:
    """The shares of the causes of a `model` of what the device as `described` leaves.

    E(S) is the energy beyond noise that the causes S leave alone, all other numbers as the model has them: fitted again, the
    device's own would bend to take what is missing. Those that its file hardly knows are adapted. The sets are fitted in `jobs`
    processes.
    """
    fit = model.fit
    n = len(fit.structure.causes)
    held = described.held_out.excess > ATTRIBUTION.least_excess * np.sum(described.held_out.n_plain)
    records = fitter.held_out_records if held else fitter.fit_records
    before = _by_block(fitter.noise.known, as_fitted(fitter, described.fit, records))
    if not n or before.sum() <= 0:
        return Attribution((None,) * n, None, held)
    after = _by_block(fitter.noise.known, as_fitted(fitter, fit, records))
    left = {frozenset(range(n)): after}
    # for the initial states of incomplete models, which leave much
    rough = fitter.with_errors_of(described.fit)
    subsets = _subsets(n)
    known = fitter.noise.known
    energies = in_forks(lambda present: _left_or_all(known, rough, fit, present, records, before), subsets, jobs)
    left |= dict(zip(subsets, energies, strict=True))
    most = ATTRIBUTION.diverged * np.maximum(np.maximum(before, left[frozenset()]), 1.0)
    left = {S: np.minimum(E, most) for S, E in left.items()}
    of = _groups(fit.structure.causes)
    parts = np.zeros((max(of) + 1, *before.shape))
    for k, group in enumerate(of):
        parts[group] += _shapley(left, k, n)
    value, low, high = _with_intervals(parts, before, after, seed)
    unclear = low[:-1] <= 0
    if np.any(unclear) and not np.all(unclear):
        parts[unclear] = 0.0
        value, low, high = _with_intervals(parts, before, after, seed)
    shares = [ShareEntry(value=v, ci95=(a, b)) for v, a, b in zip(value, low, high, strict=True)]
    by_channel = _shares(*(v.sum(axis=-2) for v in (parts, before, after)))
    shown = before.sum(axis=0) > ATTRIBUTION.least_excess * described.held_out.n_plain.sum(axis=0)
    channels = {
        name: tuple(float(by_channel[g, i]) for g in (*of, -1))
        for i, name in enumerate(fitter.recording.channels)
        if shown[i]
    }
    told = tuple(None if unclear[g] else shares[g] for g in of)
    return Attribution(told, shares[-1], held, channels, tuple(_needed_by(left, k, n) for k in range(n)))


def _with_intervals(
    parts: np.ndarray, before: np.ndarray, after: np.ndarray, seed: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Shares (n + 1,) over all channels with the ends of their 95 % intervals, from (n, b, n_y), (b, n_y) and (b, n_y)."""
    parts, before, after = (v.sum(axis=-1) for v in (parts, before, after))
    drawn = np.random.default_rng(seed).integers(0, len(before), (ATTRIBUTION.draws, len(before)))
    sampled = _shares(*(v[..., drawn].sum(axis=-1) for v in (parts, before, after)))
    low, high = np.quantile(sampled, (0.025, 0.975), axis=1)
    value = _shares(*(v.sum(axis=-1) for v in (parts, before, after)))
    return value, np.minimum(low, value), np.maximum(high, value)


def _needed_by(left: dict[frozenset[int], np.ndarray], k: int, n: int) -> int | None:
    """The cause j that takes away most more beside cause k than without it: [E(-k-j) - E(-k)] against [E(-j) - E]; None where no
    such set was fitted."""
    everyone = frozenset(range(n))
    pairs = {j: everyone - {k, j} for j in everyone - {k} if everyone - {k, j} in left}

    def more(j: int) -> float:
        beside = left[everyone - {j}] - left[everyone]
        return float(np.sum(beside - (left[pairs[j]] - left[everyone - {k}])))

    return max(pairs, key=more) if pairs else None


def as_fitted(fitter: Fitter, fit: Fit, records: list[Record]) -> Misfit:
    """What a fit leaves of records with its numbers as they are: the errors that the tables state."""
    return misfit(fitter.noise, records, [r.observed - fitter.predict(fit, r) for r in records])


def one_finding(cause: Hypothesis) -> tuple[str | None, ...]:
    """What causes have in common that are one finding: the law and its place, or the number of the device."""
    return cause.effect, cause.location, cause.of, cause.path


def _groups(causes: tuple[Hypothesis, ...]) -> list[int]:
    """By cause the number of its group: causes of one law at one place, such as harmonics, are one."""
    places = list(dict.fromkeys(map(one_finding, causes)))
    return [places.index(one_finding(cause)) for cause in causes]


def _shares(parts: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Shares (n + 1, ...) of n causes and of the rest, from their `parts` (n, ...) and the energies `before` and `after` (...)."""
    # by chance less may be left than noise
    rest = np.maximum(after, 0.0) / np.maximum(before, 1e-300)
    taken = np.maximum(parts, 0.0)
    whole = taken.sum(axis=0)
    # where none takes anything away alone, they do together
    each = np.where(whole > 0, taken / np.maximum(whole, 1e-300), 1.0 / len(parts))
    return np.concatenate([np.maximum(1 - rest, 0.0) * each, np.asarray(rest)[None]])


def _by_block(known: np.ndarray, left: Misfit) -> np.ndarray:
    """Energy beyond noise (b, n_y) of each block and channel; the whole energy where the noise is not `known` (n_y,)."""
    return left.plain - np.where(known, left.n_plain, 0.0)


def _left_or_all(
    known: np.ndarray, fitter: Fitter, fit: Fit, present: frozenset[int], records: list[Record], everything: np.ndarray
) -> np.ndarray:
    """What `left_by` leaves of each block and channel; all of it where no such device can stand or be simulated."""
    try:
        return _by_block(known, left_by(fitter, fit, present, records))
    except FAILURES:
        return everything


def _subsets(n: int) -> list[frozenset[int]]:
    """The sets of causes but the whole one: all, or none, those of one, and of all but one, where there are too many."""
    sizes = range(n) if n <= ATTRIBUTION.most_causes else (0, 1, n - 1)
    return [frozenset(chosen) for size in sizes for chosen in combinations(range(n), size)]


def _shapley(left: dict[frozenset[int], np.ndarray], k: int, n: int) -> np.ndarray:
    """What cause k takes away of each block and channel, the mean over orders; of many causes, that of coming first and last,
    scaled so that the parts add up."""
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
    return as_fitted(fitter, reduced, records)


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
