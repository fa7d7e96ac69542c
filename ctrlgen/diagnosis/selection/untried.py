"""The causes that errors kept from being tried: what a search could not judge, which is not the same as what it judged worse.

A cause that one trial reached is judged, whatever another start ended with.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import SolverError
from ctrlgen.diagnosis.selection.cause_entry import cause_name
from ctrlgen.diagnosis.selection.search_result import SearchResult
from ctrlgen.diagnosis.settings import VERDICT
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis

NAMED = 3  # causes that a sentence lists
LONGEST = 160  # characters of a reason in it
_Key = tuple[str, str, str | None, str]


@dataclass(frozen=True)
class Untried:
    """Why causes could not be tried, each by an error: those worth a fit of which every fit `failed`, beside those `fitted`; and those
    `dropped` of the laws `offered`, which could not be evaluated. `loudest`: one of them scored more than any other cause."""

    failed: Mapping[Hypothesis, str]
    fitted: frozenset[_Key]
    dropped: Mapping[Hypothesis, str]
    offered: int
    loudest: bool = False

    @property
    def all_laws(self) -> bool:
        """Whether every law that was worth a fit, or all that were offered, could not be tried; of a search that has no laws, every number
        of the device."""
        laws, fitted = ([key for key in keys if key[0] != PARAMETER] for keys in (map(_key, self.failed), self.fitted))
        if laws or fitted:
            return not fitted
        return (bool(self.failed) and not self.fitted) or 0 < self.offered == len(self.dropped)

    def sentences(self) -> list[str]:
        """How many causes could not be tried and why, where that is a considerable part or the one that matters most."""
        worth, most = len(self.failed) + len(self.fitted), VERDICT.considerable
        told = []
        if self.failed and (self.loudest or len(self.failed) >= most * worth):
            told.append(
                f"{_counted(self.failed, worth, 'cause')} worth a fit could not be fitted: {_why(self.failed)}."
            )
        if self.dropped and len(self.dropped) >= most * self.offered:
            told.append(f"{_counted(self.dropped, self.offered, 'law')} could not be evaluated: {_why(self.dropped)}.")
        return told


def untried(search: SearchResult) -> Untried:
    """What a search could not try."""
    dropped = {h: why for r in search.rounds for h, why in r.screened.dropped.items()}
    fitted = frozenset(_key(c) for a in search.attempts for c in a.candidate.causes)
    reasons: dict[_Key, tuple[Hypothesis, str]] = {}
    for failure in (f for r in search.rounds for f in r.failed):
        h = failure.cause
        if h is not None and h not in dropped and _key(h) not in fitted:
            reasons.setdefault(_key(h), (h, failure.why))
    first = [r.screened.suspects[0].hypothesis for r in search.rounds if r.screened.suspects]
    return Untried(
        failed=dict(reasons.values()),
        fitted=fitted,
        dropped=dict({_key(h): (h, why) for h, why in dropped.items()}.values()),
        offered=len({_key(h) for h in search.offered if h.effect != PARAMETER}),
        loudest=any(_key(h) in reasons for h in first),
    )


def refuse_without_trials(search: SearchResult, missing: Untried) -> None:
    """Raises SolverError where no law could be tried: that no cause is found then says nothing of the recording."""
    if not missing.all_laws:
        return
    lost = {**missing.failed, **missing.dropped}
    none = (
        "the one cause to be tried could not" if len(lost) == 1 else f"none of the {len(lost)} causes to be tried could"
    )
    raise SolverError(
        f"{search.fitter.recording.title}: no answer, because {none} be simulated: {_why(lost)}. Without a cause the device can be. Write "
        "one of them into a copy of the device file as an [[effect]] and simulate that to see where it fails; then mend the law, or the "
        "device's numbers or functions"
    )


def _key(h: Hypothesis) -> _Key:
    """What a hypothesis has in common with one more of it at the same place."""
    return h.effect, h.location, h.of, h.path


def _counted(lost: Mapping[Hypothesis, str], of: int, one: str) -> str:
    return f"{len(lost)} of {number_of(of, one)}"


def _why(lost: Mapping[Hypothesis, str]) -> str:
    """'no balance (backlash at stage:axis, coulomb at stage:axis and 2 more)', the commonest reason; how many have others."""
    reasons = Counter(map(_short, lost.values()))
    reason, count = reasons.most_common(1)[0]
    others = len(lost) - count
    return f"{reason} ({_names(h for h, why in lost.items() if _short(why) == reason)}{f'; {others} for other reasons' if others else ''})"


def _names(causes: Iterable[Hypothesis]) -> str:
    names = list(map(cause_name, causes))
    return ", ".join(names[:NAMED]) + (f" and {len(names) - NAMED} more" if len(names) > NAMED else "")


def _short(why: str) -> str:
    """The last line of a reason, which says most of a nested one."""
    last = (why.strip().splitlines() or ["no reason given"])[-1].strip().rstrip(".")
    return last if len(last) <= LONGEST else f"{last[:LONGEST]} ..."
