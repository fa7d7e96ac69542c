"""What a search tried and did not take, with the reason: refused for its meaning, short of what a cause must show, or second to
what was taken."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ctrlgen.diagnosis.selection.candidate_model import CandidateModel, Refusal
from ctrlgen.diagnosis.selection.cause_entry import cause_name
from ctrlgen.diagnosis.selection.model_selection import ModelSelection
from ctrlgen.diagnosis.selection.search_result import SearchResult
from ctrlgen.diagnosis.settings import MODEL_SELECTION
from ctrlgen.estimation.hypothesis import Hypothesis


def not_taken(
    compare: ModelSelection,
    refused: Sequence[Refusal],
    candidates: Sequence[CandidateModel],
    before: CandidateModel,
    best: CandidateModel,
) -> tuple[Refusal, ...]:
    """What a round did not take in place of `before`, first what would gain most beside `best`, which it took. Of several fits of
    the same causes that are refused for the same reasons, the best."""
    rows = [Refusal(r.candidate, r.causes, r.reasons, compare.advantage(r.candidate, best)) for r in refused]
    for t in candidates:
        if frozenset(t.causes) == frozenset(best.causes):
            continue
        added = tuple(c for c in t.causes if c not in before.causes)
        gain = compare.advantage(t, best)
        lacks = compare.shortfall(before, t)
        reason = lacks.value if lacks is not None else _second(t, best, before, gain)
        rows.append(Refusal(t, added, (reason,) * len(added), gain))
    best_of: dict[tuple[tuple[Hypothesis, ...], tuple[str, ...]], Refusal] = {}
    for row in sorted(rows, key=lambda r: -r.gain):
        best_of.setdefault((row.causes, row.reasons), row)
    return tuple(best_of.values())


def _second(t: CandidateModel, best: CandidateModel, before: CandidateModel, gain: float) -> str:
    """Why a candidate that is good enough was not taken."""
    taken = " and ".join(dict.fromkeys(cause_name(c) for c in best.causes if c not in before.causes))
    of_time, instead = (any(c.prior.of_time for c in m.causes if c not in before.causes) for m in (t, best))
    if of_time and not instead:
        return f"a function of time alone: {taken} was taken, which explains nearly as much by the motion"
    if gain > 0:
        return f"{taken} was taken, which explains as much and is commoner, or has fewer numbers"
    return f"{taken} was taken, which explains more"


def that_matter(search: SearchResult) -> list[tuple[float, Refusal]]:
    """Of `better_than_their_round` what is better than the answer too, by more than chance, as a cause that is taken must be: later rounds
    overtake much of what one of them refused."""
    least = MODEL_SELECTION.least_gain + MODEL_SELECTION.least_confirmed
    return [(gain, refusal) for gain, refusal in better_than_their_round(search) if gain > least]


def better_than_their_round(search: SearchResult) -> list[tuple[float, Refusal]]:
    """What was refused although it scored better than what its round took, of causes that the answer does not have, with what each
    would gain beside the answer, that which would gain most first."""
    compare = compared(search)
    there = {(c.effect, c.location, c.of) for c in search.chosen.causes}
    rows: dict[tuple[tuple[str, str, str | None], ...], tuple[float, Refusal]] = {}
    for refusal in (r for round_ in search.rounds for r in round_.refused if r.gain > 0):
        names = tuple((c.effect, c.location, c.of) for c in refusal.causes)
        if set(names) <= there:
            continue
        gain = compare.advantage(refusal.candidate, search.chosen)
        if names not in rows or gain > rows[names][0]:
            rows[names] = (gain, refusal)
    return sorted(rows.values(), key=lambda row: -row[0])


def compared(search: SearchResult) -> ModelSelection:
    """The comparison of models by which a search decided, with the errors learnt."""
    mismatch = search.nominal.held_out.plain_mean * search.fitter.noise.floor**2
    return ModelSelection(search.fitter, lambda *_, **__: [search.chosen], mismatch)


def held_out_rms(candidate: CandidateModel) -> np.ndarray:
    """Root mean square (n_y,) [SI] of what a candidate leaves on the held-out records, its numbers as fitted."""
    return np.sqrt(candidate.predicted.plain_mean) * candidate.errors.noise.floor
