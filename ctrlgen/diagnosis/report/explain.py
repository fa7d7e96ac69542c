"""What a diagnosis has to say of one law: where it was tried, from what starts, what it reached, why it was not taken."""

from __future__ import annotations

import numpy as np

from ctrlgen.core.units import from_si
from ctrlgen.diagnosis.evidence.diagnosis_result import Diagnosis
from ctrlgen.diagnosis.report.history_table import errors_text
from ctrlgen.diagnosis.report.narrative import per_cent
from ctrlgen.diagnosis.selection.candidate_model import Attempt
from ctrlgen.diagnosis.selection.cause_entry import cause_name
from ctrlgen.diagnosis.selection.confusable import likeness, look_alike
from ctrlgen.diagnosis.selection.not_taken import compared
from ctrlgen.diagnosis.selection.of_each_record import may_differ
from ctrlgen.diagnosis.selection.screen import Screened
from ctrlgen.diagnosis.selection.search_history import held_out_error, numbers_of_cause
from ctrlgen.diagnosis.selection.subset_search import Suspect
from ctrlgen.diagnosis.settings import SEARCH
from ctrlgen.effects import Effect
from ctrlgen.estimation.hypothesis import Hypothesis, nominal_physics, selected_laws, why_not_offered
from ctrlgen.estimation.law_needs import not_offered
from ctrlgen.estimation.priors import prior_of
from ctrlgen.reporting.numbers import number, with_unit

# attempts of one cause that are listed, the best first
LISTED = 4


def explain(diagnosis: Diagnosis, law: str) -> list[str]:
    """The lines about the law of this name, place by place, those that were fitted first. Raises InputError for an unknown law."""
    (effect,) = selected_laws([law])
    offered = [h for h in diagnosis.search.offered if h.effect == effect.kind]
    if not offered:
        return [f"{law}: not offered, because {_why_not_offered(diagnosis, effect)}."]
    tried = {_key(h): _attempts(diagnosis, h) for h in offered}
    silent = [h for h in offered if not tried[_key(h)]]
    lines = [line for h in offered if tried[_key(h)] for line in _of(diagnosis, h, tried[_key(h)])]
    return [*lines, *(f"{cause_name(h)}: {_never_fitted(diagnosis, h)}." for h in silent)]


def _key(h: Hypothesis) -> tuple[str, str, str | None]:
    """What a hypothesis has in common with one more of it at the same place."""
    return h.effect, h.location, h.of


def _why_not_offered(diagnosis: Diagnosis, law: type[Effect]) -> str:
    recording, device = diagnosis.recording, diagnosis.device
    if why := not_offered([law.kind], device.parts(nominal_physics(device))).get(law.kind):
        return why
    alone = prior_of(law).of_each_record and not may_differ(Hypothesis(law.kind, ""), recording)
    if alone and recording.kind == "series":
        return "it is another one in each run, and one run alone was recorded"
    shortest = min(r.sample_time for r in recording.records)
    return (
        why_not_offered(
            law,
            device,
            nominal_physics(device),
            recording.channels,
            shortest if np.isfinite(shortest) else None,
            any(r.ambient is not None for r in recording.records),
        )
        or "it was not among the effects to consider"
    )


def _attempts(diagnosis: Diagnosis, h: Hypothesis) -> list[Attempt]:
    return [a for a in diagnosis.search.attempts if any(_key(c) == _key(h) for c in a.candidate.causes)]


def _of(diagnosis: Diagnosis, h: Hypothesis, attempts: list[Attempt]) -> list[str]:
    """Where a hypothesis was fitted, what was reached, and what came of it."""
    search, compare = diagnosis.search, compared(diagnosis.search)
    taken = any(_key(c) == _key(h) for c in search.chosen.causes)
    head = "is in the answer" if taken else f"was not taken: {_why_not_taken(diagnosis, h, attempts)}"
    ranked = sorted(attempts, key=lambda a: -compare.advantage(a.candidate, search.chosen))
    rows = [f"{cause_name(h)} {head}.", f"  {_score(diagnosis, h)}"]
    for a in ranked[:LISTED]:
        gain = compare.advantage(a.candidate, search.nominal)
        errors = errors_text(held_out_error(search, a.candidate))
        rows.append(
            f"  round {a.round}{_beside(a, h)}: {_numbers(a, h)}; criterion better than the device as described by "
            f"{number(gain, 4)}, residual over noise {number(float(np.sqrt(np.mean(a.candidate.fitted.plain_mean))), 3)} fitted, "
            f"held-out error {errors}"
        )
    more = len(attempts) - LISTED
    return [*rows, *([f"  and {more} more fits, which reached less"] if more > 0 else [])]


def _beside(a: Attempt, h: Hypothesis) -> str:
    # harmonics have one name
    others = " and ".join(dict.fromkeys(cause_name(c) for c in a.candidate.causes if _key(c) != _key(h)))
    return f", beside {others}" if others else ""


def _numbers(a: Attempt, h: Hypothesis) -> str:
    """'gap 60 nm -> 58 nm': where each number began and what it became."""
    fit = a.candidate.fit
    k = next(k for k, c in enumerate(fit.structure.causes) if _key(c) == _key(h))
    return ", ".join(
        f"{name} {with_unit(float(from_si(a.started[k][name], unit)), unit, 3)} -> {with_unit(value, unit)}"
        for name, (value, unit) in numbers_of_cause(fit, k).items()
        if name in a.started[k]
    )


def _why_not_taken(diagnosis: Diagnosis, h: Hypothesis, attempts: list[Attempt]) -> str:
    """The reason of the round in which it came closest; else what its best fit lacks beside the answer."""
    search = diagnosis.search
    if any(_key(c) == _key(h) for c in search.withdrawn):
        return "with it the held-out records are predicted worse than by the device as described"
    reasons = [
        (refusal.gain, reason, k)
        for k, round_ in enumerate(search.rounds, 1)
        for refusal in round_.refused
        for cause, reason in zip(refusal.causes, refusal.reasons, strict=True)
        if _key(cause) == _key(h)
    ]
    if reasons:
        gain, reason, k = max(reasons, key=lambda r: r[0])
        return (
            f"{reason} (round {k}, {'better' if gain > 0 else 'worse'} than what was taken by {number(abs(gain), 4)})"
        )
    compare = compared(search)
    best = max(attempts, key=lambda a: compare.advantage(a.candidate, search.chosen)).candidate
    lacks = compare.shortfall(search.nominal, best)
    return lacks.value if lacks else "taken at first, and not needed beside what was taken later"


def _screens(diagnosis: Diagnosis) -> list[Screened]:
    return [*(r.screened for r in diagnosis.search.rounds), diagnosis.search.final_screen]


def _best_score(diagnosis: Diagnosis, h: Hypothesis) -> tuple[Screened, Suspect] | None:
    """The screen in which a hypothesis scored most beside its threshold."""
    seen = [(s, x) for s in _screens(diagnosis) for x in s.suspects if _key(x.hypothesis) == _key(h)]
    return max(seen, key=lambda row: abs(row[1].z) / row[0].threshold, default=None)


def _score(diagnosis: Diagnosis, h: Hypothesis) -> str:
    """'score 12.1 standard deviations, where chance reaches 4.2', with what looks like it."""
    found = _best_score(diagnosis, h)
    if found is None:
        return "the screen does not judge it: it is no term of the model, or does not reach the readings"
    screened, suspect = found
    alike = [
        f"{cause_name(s.hypothesis)} (|cos| {likeness(screened, suspect, s):.3f})"
        for s in look_alike(screened, suspect)
    ]
    like = f"; confusable with {', '.join(alike)}" if alike else ""
    return f"score {number(abs(suspect.z), 3)} standard deviations, where chance reaches {number(screened.threshold, 3)}{like}"


def _never_fitted(diagnosis: Diagnosis, h: Hypothesis) -> str:
    """Why a hypothesis that was offered was never fitted."""
    if h.prior.of_each_record:
        return f"never could it take away {per_cent(SEARCH.least_of_each_record)} of what was left of its reading"
    for screened in _screens(diagnosis):
        for other, why in screened.dropped.items():
            if _key(other) == _key(h):
                return f"its law cannot be evaluated here: {why}"
    found = _best_score(diagnosis, h)
    if found is not None:
        screened, suspect = found
        score = _score(diagnosis, h)
        if abs(suspect.z) <= screened.threshold:
            return f"never exceeded the threshold of the screen: {score}"
        return f"others scored more and were fitted instead: {score}"
    for screened in _screens(diagnosis):
        for other, k in screened.undetectable.items():
            if _key(other) == _key(h):
                names = [u.path for u in diagnosis.search.nominal.fit.structure.free_parameters]
                like = f"its effect is that of {names[k]}" if 0 <= k < len(names) else "it does not reach the readings"
                return f"this recording cannot show it: {like}"
    if h.shifts:
        return "no screen sees a shift of many samples, and the best of those looked at promised too little for a fit"
    return "never screened"
