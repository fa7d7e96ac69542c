"""The chance that a cause was found by luck, by a test whose level holds in finite samples on records to which nothing was fitted.

One more cause j beside the causes S: the model with both, fitted to the records to fit, but without j leaves r of the held-out records;
j changes its prediction by delta, which the records to fit and the drive determine alone. Null hypothesis: S is the truth, and what is
in r beside errors of fitted numbers is noise of any distribution, independent from stretch to stretch and as likely of either sign.
With r and delta whitened, and of each stretch the innovations r_b, delta_b, what the stretches before it do not foretell by the numbers
of S,

    t_b = r_b' delta_b,   p(j | S) = P(sum_b eps_b t_b >= sum_b t_b),   eps_b = +-1 with equal chance,

over all signs (`numerics.sign_flips`). The sum is that of the matched filter and, but for a constant, half of what the squares decrease
by. Initial states and parameters, which the records to fit tell within their covariance, are so learnt again from stretch to stretch:
what they can take of delta does not count, and their errors leave no trace from one stretch to another (recursive residuals: R. L. Brown,
J. Durbin, J. M. Evans, J. R. Stat. Soc. B 37 (1975) 149; signs of scores beside such numbers: J. Hemerik, J. J. Goeman, L. Finos, J. R.
Stat. Soc. B 82 (2020) 841).

The held-out records took part in choosing the answer A, so p counts as often as there are hypotheses, H, and for each the V starts from
which S and j were fitted. Two ways to count, each with half of the level where there is more than one cause. All together: one of the
sets of f causes that are false, f up to those of A, with the weight 2^-f of so many; a union over all answers, not over those tried,

    by luck(k) <= p(k | A without k) 2 V 2^f f C(H + f - 1, f)

One by one, where that does not suffice: whatever S is the truth, any false j has p(j | S) 2 V H <= a with a chance of at most a, and S is
refuted by it. The causes of A without which no S within A is left that is not refuted are no luck,

    by luck(k) <= max over S within A without k of  min over j in A beside S of  p(j | S) 2 V H
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import ceil, comb, log2

import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.diagnosis.evidence.independent_stretches import Memory, memory_of
from ctrlgen.diagnosis.evidence.matched_parts import matched_parts
from ctrlgen.diagnosis.selection.attribution import one_finding
from ctrlgen.diagnosis.selection.failures import UNSOLVED
from ctrlgen.diagnosis.selection.findings import ChanceEntry, Finding, Role
from ctrlgen.diagnosis.selection.search_result import SearchResult
from ctrlgen.diagnosis.selection.verdict import Verdict, hides_in_device
from ctrlgen.diagnosis.settings import LUCK, SEARCH
from ctrlgen.estimation.fit import Fit
from ctrlgen.numerics.sign_flips import sign_flip_p

Causes = frozenset[int]
"""Causes of the chosen model by their places in it."""
NO_MODEL = "without it no such device can be simulated"
UNSEEN = "the held-out records do not show it"
IN_THE_FILE = "the readings alone hardly show it: without it numbers of the device would contradict its file"
OWN = "each record has its own, and no other one can confirm it"
FEW = "{} of the held-out records, and no chance below 5 % with fewer than {}"
NOISE = "noise"
REST = "what no law reaches"


@dataclass(frozen=True)
class Look:
    """What refutes a set of causes: p of the cause beside it that shows most, for how many `looks` that counts, and how many parts its
    sum has. `known` is False where the set cannot be simulated."""

    p: float = 1.0
    looks: float = 1.0
    parts: int = 0
    known: bool = True

    @property
    def by_luck(self) -> float:
        """The chance over all looks."""
        return min(self.p * self.looks, 1.0)


def with_chances(findings: Sequence[Finding], search: SearchResult) -> tuple[Finding, ...]:
    """The findings with the chance that luck found each; those that were read off the readings have none."""
    causes = search.chosen.causes
    members = [frozenset(k for k, c in enumerate(causes) if one_finding(c) == one_finding(f.cause)) for f in findings]
    units = [m for m in members if m]
    beside = Looks(search)
    worst = beside.all_together(units)
    if len(units) <= LUCK.most_causes and any(t.by_luck > LUCK.certain for t in worst.values()):
        worst = beside.one_by_one(units)
    entries = {m: _entry(search, f, m, worst[m], beside.memory) for f, m in zip(findings, members, strict=True) if m}
    return tuple(replace(f, chance=entries.get(m)) for f, m in zip(findings, members, strict=True))


class Looks:
    """The models of sets of causes of a search's answer, and what refutes each."""

    def __init__(self, search: SearchResult) -> None:
        self.search = search
        self.memory = memory_of(search.fitter, search.chosen.fit)
        each = range(len(search.chosen.causes))
        self._fits: dict[Causes, Fit] = {frozenset(each): search.chosen.fit}
        for k, bare in zip(each, search.without_cause, strict=True):
            if len(bare.causes) == len(each) - 1:
                self._fits[frozenset(each) - {k}] = bare.fit

    def all_together(self, units: Sequence[Causes]) -> dict[Causes, Look]:
        """Of each of the `units` what shows it beside all others, for all sets of false causes."""
        whole = frozenset().union(*units)
        return {unit: self.look(whole - unit, [unit], len(whole), len(units)) for unit in units}

    def one_by_one(self, units: Sequence[Causes]) -> dict[Causes, Look]:
        """Of each of the `units` what refutes that set without it which is refuted least."""
        subsets = [frozenset().union(*s) for size in range(len(units)) for s in combinations(units, size)]
        looks = {S: self.look(S, [u for u in units if not u & S], 1, len(units)) for S in subsets}
        return {u: max((looks[S] for S in subsets if not S & u), key=lambda t: (not t.known, t.by_luck)) for u in units}

    def look(self, S: Causes, beside: Sequence[Causes], false: int, units: int) -> Look:
        """What refutes the causes S best: the one of those `beside` with the smallest p, over its looks where so many may be `false`."""
        try:
            tried = []
            for unit in beside:
                causes = [self.search.chosen.causes[k] for k in unit]
                parts = matched_parts(self.search.fitter, self.fit(S | unit), causes, self.memory)
                # of several causes there are two ways to count: half of the level for each
                ways = 2.0 if units > 1 else 1.0
                count = ways * looks(len(self.search.offered), self._starts(S | unit), false)
                tried.append(Look(sign_flip_p(parts), count, int(np.count_nonzero(parts))))
            return min(tried, key=lambda t: t.p * t.looks)
        except UNSOLVED:
            return Look(known=False)

    def fit(self, S: Causes) -> Fit:
        """The model with the causes S alone, fitted to the records to fit from the numbers of the chosen one."""
        if S not in self._fits:
            structure = self.search.chosen.fit.restarted
            for k in sorted(set(range(len(structure.causes))) - S, reverse=True):
                structure = structure.without(k)
            self._fits[S] = self.search.fitter.fit(structure, steps=SEARCH.candidate_steps)
        return self._fits[S]

    def _starts(self, S: Causes) -> int:
        there = frozenset(self.search.chosen.causes[k] for k in S)
        return max(sum(frozenset(a.candidate.causes) == there for a in self.search.attempts), 1)


def looks(hypotheses: int, starts: int, false: int) -> float:
    """For how many answers p counts where one cause is looked at beside a truth, or where so many may be `false` together."""
    if false == 1:
        return float(starts * hypotheses)
    return float(starts * 2**false * false * comb(hypotheses + false - 1, false))


def doubted(verdict: Verdict, findings: Sequence[Finding]) -> Verdict:
    """The verdict: partly in place of explained where the first cause may be luck."""
    luck = bool(findings) and findings[0].chance is not None and findings[0].chance.weak
    return Verdict.PARTLY if verdict == Verdict.EXPLAINED and luck else verdict


def _entry(search: SearchResult, finding: Finding, members: Causes, look: Look, memory: Memory) -> ChanceEntry:
    """The chance of a finding; without a number where no answer of these records could be below `LUCK.certain`, which would only say so."""
    against = REST if memory.repeats else NOISE
    reason = NO_MODEL if not look.known else OWN if finding.cause.prior.of_each_record else None
    if reason is None and look.by_luck > LUCK.certain:
        if finding.role is Role.UNSEEN:
            reason = UNSEEN
        elif any(hides_in_device(search, k) for k in members):
            reason = IN_THE_FILE
        elif look.looks * 0.5**look.parts > LUCK.certain:
            parts = number_of(look.parts, "independent stretch", "independent stretches")
            reason = FEW.format(parts, ceil(log2(look.looks / LUCK.certain)))
    if reason is not None:
        return ChanceEntry(by_luck=None, p=None, looks=None, stretches=look.parts, against=against, reason=reason)
    return ChanceEntry(
        by_luck=look.by_luck, p=look.p, looks=look.looks, stretches=look.parts, against=against, reason=None
    )
