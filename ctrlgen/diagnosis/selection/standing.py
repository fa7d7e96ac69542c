"""Evidence before names: how far the model-free shares bear a cause out.

A share says of what the residual of the device as described is a function, whatever the law. Where more than noise is left, a law
whose family the shares put near zero, or far below another family, may be what fits best and still not be what acts: it does not
stand first, and alone it makes the answer ambiguous.

What is in proportion to drive or place speaks against no law: settled creep, a play that is crossed at every pose, an axis that carries
another one are gains to a reading. Whether a gain is all there is the search has tried, as no gain has another form than the
library's. Nor does another family where a signal that speaks for the law's own predicts nearly as much alone: then the shares do not tell
the two apart, and which was selected first is but an order. Where a model leaves noise alone, it has the better evidence; but of two that
explain alike the one stands first that the shares bear out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.findings import Finding, Role, SupportEntry
from ctrlgen.diagnosis.selection.search_result import SearchResult
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.diagnosis.settings import STANDING
from ctrlgen.diagnosis.shares.families import alone, family_of, ranking
from ctrlgen.diagnosis.shares.shares_table import SharesTable
from ctrlgen.effects import Family
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis


@dataclass(frozen=True)
class Evidence:
    """The shares of what the device as described leaves, by family, the largest first: `bent` without what is constant or in proportion,
    which alone speaks against a law; `alone` those that a kind reaches by itself."""

    shares: Sequence[tuple[Family, float]]
    bent: Sequence[tuple[Family, float]]
    alone: Mapping[Family, float] = field(default_factory=dict)

    def of(self, effect: str) -> SupportEntry | None:
        """What they say of a law; None of what has no family."""
        family = family_of(effect)
        if family is None or not self.shares:
            return None
        leading, most = (self.bent or self.shares)[0]
        own = dict(self.shares).get(family, 0.0)
        if (by_itself := self.alone.get(family, 0.0)) >= STANDING.as_much * most:
            own = max(own, min(by_itself, most))
        weak = own < STANDING.near_zero or own < STANDING.far_below * most
        return SupportEntry(
            family=family.value,
            share=own,
            leading=leading.value,
            leading_share=most,
            contradicted=bool(self.bent) and most >= STANDING.clear and weak,
        )


def evidence_of(search: SearchResult, before: SharesTable, offered: Sequence[Hypothesis], every_law: bool) -> Evidence:
    """That of the shares `before`, of families of which such a device has a law where `every_law` was offered."""
    noise = dict(zip(search.fitter.recording.channels, search.fitter.noise.floor.tolist(), strict=True))
    shares, bent = (by_heat(ranking(before, noise, linear), offered) for linear in (True, False))
    if every_law:
        shares, bent = possible(shares, offered), possible(bent, offered)
    return Evidence(shares, bent, alone(before, noise))


def borne_out_instead(search: SearchResult, evidence: Evidence) -> CandidateModel | None:
    """Of what explains alike in place of a cause that the shares contradict, the first of the family that they put first; None where
    there is none."""
    for cause, rivals in zip(search.chosen.causes, search.rivals, strict=True):
        told = evidence.of(cause.effect)
        if told is None or not told.contradicted:
            continue
        for rival in rivals:
            other = None if rival.cause is None else evidence.of(rival.cause.effect)
            if other is not None and other.family == other.leading:
                return rival
    return None


def in_standing(findings: Sequence[Finding], evidence: Evidence, seen: Sequence[Finding] = ()) -> tuple[Finding, ...]:
    """The findings with what the shares say of each cause; those that they contradict after the others, and so is what is `seen` in the
    readings themselves, which takes no share: alone it does not stand for what the rest leaves in doubt."""
    told = [replace(f, support=evidence.of(f.effect) if f.role is Role.CAUSE else None) for f in findings]
    after = [
        (f.role is not Role.CAUSE, f.contradicted or any(given is s for s in seen))
        for f, given in zip(told, findings, strict=True)
    ]
    return tuple(told[k] for k in sorted(range(len(told)), key=lambda k: after[k]))


def possible(shares: Sequence[tuple[Family, float]], offered: Sequence[Hypothesis]) -> list[tuple[Family, float]]:
    """The `shares` without families of which such a device has no law, as an axis without a spring has no nonlinear one."""
    families = {family_of(h.effect) for h in offered}
    return [(family, share) for family, share in shares if family in families]


def by_heat(shares: Sequence[tuple[Family, float]], offered: Sequence[Hypothesis]) -> list[tuple[Family, float]]:
    """The `shares` of a device that heaters move in balance, which has laws of the heat: its place goes by their temperature, and what is
    a function of the place may be of the heat, or of how the heater takes its drive. Else as they are."""
    if not any(h.effect != PARAMETER and "heat" in h.law.requires for h in offered):
        return list(shares)
    share = dict(shares)
    for family in (Family.THERMAL, Family.DRIVE):
        share[family] = max(share.get(family, 0.0), share.get(Family.ELASTIC, 0.0))
    return sorted(share.items(), key=lambda pair: -pair[1])


def answer_of(verdict: Verdict, findings: Sequence[Finding], exact: bool) -> Verdict:
    """The verdict: ambiguous where the first cause is contradicted by the shares, unless the model leaves noise alone (`exact`);
    unexplained where the readings do not tell that its size is not zero: then something acts there, and its name is not known."""
    if not findings or verdict not in (Verdict.PARTLY, Verdict.EXPLAINED):
        return verdict
    if findings[0].contradicted and not exact:
        return Verdict.AMBIGUOUS
    return Verdict.UNEXPLAINED if findings[0].size_untold else verdict
