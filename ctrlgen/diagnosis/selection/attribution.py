"""How much of the mismatch each accepted cause takes away, with intervals: one account, of the error that the tables call "before".

The energy E(S) that the causes S leave on the held-out records: the device with these causes as the accepted model has them, its
own numbers fitted again, as every model is: held by what its file states of them, under the discrepancy that the set itself leaves,
one for all readings over their noise, as E counts them. What a cause takes away is its Shapley value,

    phi_k = mean over orders of E(before k) - E(after k),      sum phi = E(none) - E(all),

the average over all orders in which the causes may be added (R. Lindeman, P. Merenda, R. Gold, Introduction to Bivariate and
Multivariate Analysis, 1980; L. Shapley, Contributions to the Theory of Games II, 1953, 307), those first without which much of the error
comes back: while these are missing, a creep stands in for a bow, and would have what the bow takes away. With the numbers of the
accepted model instead, a set would be told by an error that nobody sees: that of a device whose numbers fit what is not there,
often several times "before". Freed of what the file states, numbers would bend to take what is missing. No set and all causes are
fitted as every other set is: the tables' own fits weigh each reading by its own discrepancy, and what that changes would be
counted as taken away by whichever cause comes first, or last. With what the tables call before and after, in energies beyond
noise,

    share_k = phi_k/sum phi (before - after)/before,   left = after/before,

which are one, in every channel and in all. A cause that takes nothing away itself is counted with the one that it serves, so that no
share is negative; a constant, if alone it takes nothing away, with the law that needs it. Intervals are those of a bootstrap over
blocks of the records, with weights of all of them (D. Rubin, Ann. Statist. 9 (1981) 130): where one block holds most of the error, a
third of the samples drawn with replacement lack it. Of two causes that nearly cancel each is needed for certain, however uncertain the
parts of what both take away are: such a cause keeps its share. Where the noise of a channel is not known, its whole error counts.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import combinations
from math import comb

import numpy as np
from pydantic import Field

from ctrlgen.core.forks import in_forks
from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.failures import UNSOLVED
from ctrlgen.diagnosis.settings import ATTRIBUTION
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.free_parameters import FreeParameter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.least_squares import LeastSquaresProblem
from ctrlgen.estimation.misfit import Misfit, misfit
from ctrlgen.estimation.settled_start import states_to_begin
from ctrlgen.estimation.structure import Structure
from ctrlgen.numerics.levenberg_marquardt import levenberg_marquardt
from ctrlgen.recordings.recording import Record
from ctrlgen.reporting.result_file import FiniteOrNull, Keys

Groups = frozenset[int]
"""Causes by number; those of one law at one place are one."""


class ShareEntry(Keys):
    """A share of the mismatch."""

    value: FiniteOrNull = Field(description="Of the energy beyond the noise that the device as described leaves.")
    ci95: tuple[FiniteOrNull, FiniteOrNull] = Field(description="95 % interval, by a bootstrap over blocks.")


@dataclass(frozen=True)
class Attribution:
    """The `shares` of the causes of a model, in its order, and that of the `rest`; None where nothing is to share.

    Causes of one law at one place are one: each has the share of all of them. A cause whose share may be zero has none, and what it
    takes away counts for the one that it serves. `channels`: by reading the shares of the causes and, last, what is left; of readings
    that show a mismatch alone. `serves`: by cause the other one that needs it most. `held_out`: whether they are of the held-out
    records; of the records to fit where the held-out ones show no mismatch.
    """

    shares: tuple[ShareEntry | None, ...]
    rest: ShareEntry | None
    held_out: bool
    channels: dict[str, tuple[float, ...]] = field(default_factory=dict)
    serves: tuple[int | None, ...] = ()

    def is_named(self, k: int) -> bool:
        """Whether cause k is a cause of the answer, or a part of one: not one that takes away less than is worth a name."""
        share = self.shares[k]
        served = bool(self.serves) and self.serves[k] is not None
        return self.rest is None or (served if share is None else share.value >= ATTRIBUTION.least_share)

    @property
    def explained(self) -> float:
        """The share that all causes take away together; 0 where nothing is to share, or more is left than there was."""
        return 0.0 if self.rest is None else max(1.0 - self.rest.value, 0.0)


def attribute(
    fitter: Fitter, described: CandidateModel, model: CandidateModel, seed: int = 0, jobs: int = 1
) -> Attribution:
    """The shares of the causes of a `model` of what the device as `described` leaves. The sets are fitted in `jobs` processes."""
    fit = model.fit
    causes, of = fit.structure.causes, _groups(fit.structure.causes)
    n = max(of, default=-1) + 1
    everyone = frozenset(range(n))
    held = described.predicted.excess > ATTRIBUTION.least_excess * np.sum(described.predicted.n_plain)
    records = fitter.held_out_records if held else fitter.fit_records
    known = fitter.noise.known
    before = _by_block(known, as_fitted(fitter, described.fit, records))
    if not n or before.sum() <= 0:
        return Attribution((None,) * len(causes), None, held)
    after = _by_block(known, as_fitted(fitter, fit, records))

    def left_by_all(sets: list[Groups]) -> dict[Groups, np.ndarray]:
        members = [frozenset(k for k, group in enumerate(of) if group in S) for S in sets]
        energies = in_forks(lambda present: _left_or_all(known, fitter, fit, present, records, before), members, jobs)
        return dict(zip(sets, energies, strict=True))

    left = left_by_all(list(dict.fromkeys([frozenset(), everyone, *(everyone - {g} for g in range(n))])))
    first = _first(left, everyone)
    left |= left_by_all([S for S in _sets(everyone, first) if S not in left])
    # of more, not all pairs are fitted
    serves = [_needed_by(left, g, n) if n <= ATTRIBUTION.most_causes else None for g in range(n)]
    taken = np.array([_taken(left, g, first, everyone) for g in range(n)])
    constant = [causes[of.index(g)].prior.constant for g in range(n)]
    balanced = [constant[g] or (j is not None and constant[j]) for g, j in enumerate(serves)]
    needed = np.array([_needed(left, taken[g], everyone, g, seed) and not balanced[g] for g in range(n)])
    parts, told = _counted(taken, before, after, serves, needed, seed)
    whole = np.sum(left[frozenset()] - left[everyone])
    back = [float(np.sum(left[everyone - {g}] - left[everyone]) / max(whole, 1e-300)) for g in range(n)]
    _lead_constants(parts, told, serves, back, constant)
    intervals = _with_intervals(parts, before, after, seed, told)
    # of a cause that is needed for certain, the least that is called one
    least = np.minimum(ATTRIBUTION.least_share, intervals[:-1, 0])
    intervals[:-1, 1] = np.where(needed & told, np.maximum(intervals[:-1, 1], least), intervals[:-1, 1])
    shares = [ShareEntry(value=v, ci95=(a, b)) for v, a, b in intervals]
    by_channel = _shares(told, *(v.sum(axis=-2) for v in (parts, before, after)))
    shown = before.sum(axis=0) > ATTRIBUTION.least_excess * described.predicted.n_plain.sum(axis=0)
    channels = {
        name: tuple(float(by_channel[g, i]) for g in (*of, -1))
        for i, name in enumerate(fitter.recording.channels)
        if shown[i]
    }
    served = (serves[g] for g in of)
    return Attribution(
        tuple(shares[g] if told[g] else None for g in of),
        shares[-1],
        held,
        channels,
        tuple(None if g is None else of.index(g) for g in served),
    )


def _first(left: dict[Groups, np.ndarray], everyone: Groups) -> Groups:
    """The causes without which `ATTRIBUTION.first_share` of the error comes back, those first without which most does and no more of
    them than all orders are averaged of; every one where none is so."""
    back = {g: float(np.sum(left[everyone - {g}] - left[everyone])) for g in everyone}
    least = ATTRIBUTION.first_share * float(np.sum(left[frozenset()] - left[everyone]))
    most = sorted((g for g in everyone if back[g] > max(least, 0.0)), key=lambda g: -back[g])
    return frozenset(most[: ATTRIBUTION.most_causes]) or everyone


def _sets(everyone: Groups, first: Groups) -> list[Groups]:
    """The sets of causes whose energies the parts are made of: those of the `first`, and all of these with those of the others; of few
    causes every one, which also tell what serves what."""
    sets = [*_subsets(first), *(first | S for S in _subsets(everyone - first))]
    return list(dict.fromkeys([*sets, *(_subsets(everyone) if len(everyone) <= ATTRIBUTION.most_causes else ())]))


def _taken(left: dict[Groups, np.ndarray], g: int, first: Groups, everyone: Groups) -> np.ndarray:
    """What cause g takes away of each block and channel: of the `first` as they come among themselves, of another one beside these."""
    return _shapley(left, g, first, frozenset()) if g in first else _shapley(left, g, everyone - first, first)


def _needed(left: dict[Groups, np.ndarray], taken: np.ndarray, everyone: Groups, g: int, seed: int) -> bool:
    """Whether cause g takes away much, and for certain most of the error comes back without it, however it acts alone."""
    nothing, all_ = left[frozenset()], left[everyone]
    if taken.sum() <= ATTRIBUTION.vague_share * (nothing - all_).sum():
        return False
    comes_back = (left[everyone - {g}] - all_) - ATTRIBUTION.comes_back * (nothing - all_)
    return bool(np.quantile(_weights(len(nothing), seed) @ comes_back.sum(axis=-1), 0.025) > 0)


def _weights(blocks: int, seed: int) -> np.ndarray:
    """Weights of the blocks (draws, b) in each draw of the bootstrap, whose mean is 1."""
    return blocks * np.random.default_rng(seed).dirichlet(np.ones(blocks), ATTRIBUTION.draws)


def _counted(
    parts: np.ndarray, before: np.ndarray, after: np.ndarray, serves: list[int | None], needed: np.ndarray, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """What each of n causes takes away (n, b, n_y), that of causes whose share may be zero with the cause that they serve; and which
    have a share, (n,): those that are `needed` (n,), too. None has one where that of each may be zero.

    The least of them goes first: of two that serve each other, and of which neither takes anything away for certain, the larger one
    then has what both do.
    """
    parts, told = parts.copy(), np.ones(len(parts), bool)
    while True:
        zero = told & ~needed & (_with_intervals(parts, before, after, seed)[:-1, 1] <= 0)
        if not zero.any():
            return parts, told
        least = min(np.flatnonzero(zero), key=lambda g: parts[g].sum())
        told[least] = False
        if not told.any():
            return parts, told
        served = serves[least]
        if served is not None and told[served]:
            parts[served] += parts[least]
        parts[least] = 0.0


def _lead_constants(
    parts: np.ndarray, told: np.ndarray, serves: list[int | None], back: list[float], constant: list[bool]
) -> None:
    """Gives what a constant takes away together with a law that has no share of its own to that law, in `parts`, `told` and `serves`: a
    weight that is balanced at home is a weight, and what balances it is part of that. `back` is the share of the error that comes back
    without each: a law without which the constant takes away most of it all the same is a part of the constant."""
    for c in (g for g in range(len(parts)) if constant[g] and told[g]):
        laws = [g for g in range(len(parts)) if serves[g] == c and not told[g] and not constant[g]]
        law = max(laws, key=lambda g: back[g], default=None)
        if law is None or back[law] < ATTRIBUTION.comes_back:
            continue
        parts[law], parts[c] = parts[c].copy(), 0.0
        told[law], told[c] = True, False
        for g in (c, *laws):
            serves[g] = law if g != law else serves[g]


def _with_intervals(
    parts: np.ndarray, before: np.ndarray, after: np.ndarray, seed: int, told: np.ndarray | None = None
) -> np.ndarray:
    """Shares over all channels with the ends of their 95 % intervals, (n + 1, 3), from (n, b, n_y), (b, n_y), (b, n_y) and `told`, those
    causes that have a share."""
    parts, before, after = (v.sum(axis=-1) for v in (parts, before, after))
    weights = _weights(len(before), seed)
    sampled = _shares(told, *(v @ weights.T for v in (parts, before, after)))
    low, high = np.quantile(sampled, (0.025, 0.975), axis=1)
    value = _shares(told, *(v.sum(axis=-1) for v in (parts, before, after)))
    return np.column_stack([value, np.minimum(low, value), np.maximum(high, value)])


def _needed_by(left: dict[Groups, np.ndarray], k: int, n: int) -> int | None:
    """The cause j that takes away most more beside cause k than without it: [E(-k-j) - E(-k)] against [E(-j) - E]; None of one cause."""
    everyone = frozenset(range(n))
    pairs = {j: everyone - {k, j} for j in everyone - {k}}

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


def _shares(told: np.ndarray | None, parts: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Shares (n + 1, ...) of n causes and of the rest, from their `parts` (n, ...) and the energies `before` and `after` (...); of those
    causes alone that are `told` (n,), where some are."""
    # by chance less may be left than noise
    rest = np.maximum(after, 0.0) / np.maximum(before, 1e-300)
    taken = np.maximum(parts, 0.0)
    whole = taken.sum(axis=0)
    # where none takes anything away alone, they do together
    alike = np.ones(len(parts)) if told is None or not told.any() else told.astype(float)
    alike = (alike / alike.sum()).reshape(-1, *(1,) * whole.ndim)
    each = np.where(whole > 0, taken / np.maximum(whole, 1e-300), alike)
    return np.concatenate([np.maximum(1 - rest, 0.0) * each, np.asarray(rest)[None]])


def _by_block(known: np.ndarray, left: Misfit) -> np.ndarray:
    """Energy beyond noise (b, n_y) of each block and channel; the whole energy where the noise is not `known` (n_y,)."""
    return left.plain - np.where(known, left.n_plain, 0.0)


def _left_or_all(
    known: np.ndarray, fitter: Fitter, fit: Fit, present: frozenset[int], records: list[Record], everything: np.ndarray
) -> np.ndarray:
    """What `left_by` leaves of each block and channel, no more in all than a multiple of `everything`; all of it where no such device
    can stand or be simulated."""
    try:
        left = _by_block(known, left_by(fitter, fit, present, records))
    except UNSOLVED:
        return everything
    most = ATTRIBUTION.diverged * everything.sum()
    return left * (most / left.sum() if left.sum() > most else 1.0)


def _subsets(causes: Groups) -> list[Groups]:
    """Sets of causes: every one, or none, those of one, all but one and all where there are too many."""
    n = len(causes)
    sizes = range(n + 1) if n <= ATTRIBUTION.most_causes else (0, 1, n - 1, n)
    return [frozenset(chosen) for size in sizes for chosen in combinations(sorted(causes), size)]


def _shapley(left: dict[Groups, np.ndarray], k: int, among: Groups, beside: Groups) -> np.ndarray:
    """What cause k takes away of each block and channel, the mean over orders `among` which it comes `beside` others; of many causes, that
    of coming first and last, which is the same where readings are sums of what each does and energies so of pairs at most, scaled so that
    the parts add up."""
    n = len(among)
    if n <= ATTRIBUTION.most_causes:
        return sum(
            (left[beside | S] - left[beside | S | {k}]) / (n * comb(n - 1, len(S))) for S in _subsets(among - {k})
        )
    whole = beside | among

    def both(j: int) -> np.ndarray:
        first = left[beside] - left[beside | {j}]
        return (first + left[whole - {j}] - left[whole]) / 2

    total = sum(both(j).sum() for j in among)
    all_ = (left[beside] - left[whole]).sum()
    return both(k) * (all_ / total if total > 0 else 1.0)


def left_by(fitter: Fitter, fit: Fit, present: frozenset[int], records: list[Record]) -> Misfit:
    """What the model leaves with the `present` causes alone, which stay as they are, the device's own numbers fitted to that.

    Numbers and discrepancy are estimated in turn, as for the device as described (`Fitter.described`).
    """
    structure = fit.structure
    values = {_key(structure, p): value for p, value in zip(structure.free_parameters, fit.theta, strict=True)}
    for k in sorted(set(range(len(structure.causes))) - present, reverse=True):
        structure = structure.without(k)
    theta = np.array([values.get(_key(structure, p), p.nominal) for p in structure.free_parameters])
    nothing = np.zeros(0)
    reduced = Fit(structure, theta, (), 0.0, fit.n, nothing, nothing, 0.0, fit.shapes)
    for _ in range(ATTRIBUTION.updates):
        problem = CausesAsFound(structure, _alike(fitter, reduced), reduced.theta)
        x = levenberg_marquardt(problem, problem.start, ATTRIBUTION.steps)
        reduced = replace(reduced, theta=problem.to_si(x)[: problem.k])
    return as_fitted(fitter, reduced, records)


def _alike(fitter: Fitter, fit: Fit) -> Fitter:
    """The fitter with one discrepancy of all readings, over their noise, as a fit leaves it, where there is any: E counts their squares
    over that alike. With one of its own for each, a set would give up a few readings for the others, and leave more of all than without
    its causes. Where the noise is not known, what stands for it is what the best model leaves, and whatever a set leaves more is
    discrepancy: weighed by that alone, the device's numbers would bend as if the file stated nothing."""
    weighed = fitter.with_errors_of(fit)
    errors, floor = weighed.error, fitter.noise.floor
    left = np.where(errors.rms > 0, errors.rms / floor, 1.0) ** 2
    unknown = ~fitter.noise.known
    if unknown.any():
        left[unknown] = np.maximum(as_fitted(fitter, fit, fitter.fit_records).plain_mean[unknown], 1.0)
    if left.max() <= 1.0:
        return weighed
    tau = np.full(len(floor), left @ errors.tau / left.sum())
    return replace(weighed, errors=replace(errors, rms=np.sqrt(left.mean()) * floor, tau=tau))


def _key(structure: Structure, p: FreeParameter) -> tuple[Hypothesis | None, str]:
    """What a number is in any structure: a cause's, or the device's own, which a cause may have been."""
    return (None, p.path) if p.cause is None else (structure.causes[p.cause], p.name)


class CausesAsFound(LeastSquaresProblem):
    """A fit of the device's own numbers, held by what its file states of them; those of its causes stay as they are."""

    def __init__(self, structure: Structure, fitter: Fitter, theta: np.ndarray) -> None:
        super().__init__(structure, fitter.recording, fitter.error)
        self.start = self.to_scaled(np.concatenate([theta, states_to_begin(self, theta)]))

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Those of the parameters, but of the causes' numbers only as far as rounding."""
        low, high = super().bounds
        own = np.array([p.cause is None for p in self.structure.free_parameters] + [True] * self.n_initial, dtype=bool)
        at, reach = self.start, ATTRIBUTION.fixed
        return np.where(own, low, np.maximum(low, at - reach)), np.where(own, high, np.minimum(high, at + reach))
