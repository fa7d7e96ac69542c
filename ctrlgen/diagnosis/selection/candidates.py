"""The candidates of a round: suspects of the screen alone, in sets and in other shapes, and an offset of the clocks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ctrlgen.diagnosis.selection.begun_again import begun_again
from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.cause_entry import trying
from ctrlgen.diagnosis.selection.failures import FAILURES
from ctrlgen.diagnosis.selection.far_off import nearer_when_simulated
from ctrlgen.diagnosis.selection.finer_forms import finer_forms
from ctrlgen.diagnosis.selection.of_each_record import fit_of_each_record
from ctrlgen.diagnosis.selection.screen import Screened
from ctrlgen.diagnosis.selection.shifts import best_shift
from ctrlgen.diagnosis.selection.subset_search import Suspect
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.diagnosis.settings import MODEL_SELECTION, REGIONS, SEARCH, SUBSETS
from ctrlgen.effects import is_group
from ctrlgen.estimation.fit import Fit
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis
from ctrlgen.estimation.structure import Structure


def fit_candidates(
    trials: Trials, current: CandidateModel, screened: Screened, most: int = SUBSETS.largest, plainly: bool = False
) -> tuple[CandidateModel, ...]:
    """All that is tried beside `current`, `most` causes at once, the promising ones fitted to their end; `plainly`: one and two causes
    that promise to take much away (`ModelSelection.only_much_matters`), each from its best start and none to its end: what is accepted
    meets its rivals later."""
    suspects = significant(trials, current, screened)
    if plainly:
        suspects = [s for s in suspects if s.z**2 >= much_of(current)]
    else:
        suspects = [*suspects, *nearer_when_simulated(trials, current, screened, suspects)]
    candidates = (*fit_of_each_record(trials, current), *fit_each(trials, current.fit, suspects))
    alone = leaves_noise_alone(trials, current, candidates)
    if not (plainly or current.errors.is_noise):
        begun = [t for t in candidates if not alone or takes_away_much(t, current)]
        ends = trials.each(lambda branch, t: restart_elsewhere(branch, t, current, screened), begun)
        after = dict(zip(map(id, begun), ends, strict=True))
        candidates = tuple(after.get(id(t), t) for t in candidates)
        alone = alone or leaves_noise_alone(trials, current, candidates)
    if not alone:
        candidates = (*candidates, *fit_in_regions(trials, current, screened, candidates))
    candidates = (*candidates, *as_meant(trials, current, candidates))
    candidates = (*candidates, *finer_forms(trials, current))
    candidates = (*candidates, *fit_other_clocks(trials, current, () if alone else candidates))
    candidates = (*candidates, *fit_own_shifts(trials, current))
    if trials.selection.parameters_may_mask_cause(current.fit):
        candidates = (*candidates, *_as_stated(trials, current))
    if not alone:
        most, least = (min(most, SEARCH.causes_of_little), much_of(current)) if plainly else (most, 0.0)
        candidates = (*candidates, *fit_subsets(trials, current, screened, candidates, most, least))
    return candidates if plainly else _converge_promising(trials, current, candidates)


def leaves_noise_alone(trials: Trials, current: CandidateModel, singles: Sequence[CandidateModel]) -> bool:
    """Whether the best of the `singles` leaves noise alone, and nothing speaks against it: sets, regions and shifts beside it have
    nothing left to explain. It may do so only under the discrepancy that it leaves itself: under that of `current`, what the device's
    file states of its numbers holds them."""
    compare = trials.selection
    if current.errors.is_noise or not singles or not trials.fitter.noise.known.all():
        return False
    best = compare.ranked(singles)[0]
    if not takes_away_much(best, current) or not trials.leaves_noise_alone(best):
        return False
    return compare.improves_enough(current, best) and not trials.objections(best, current.causes)


def takes_away_much(t: CandidateModel, current: CandidateModel) -> bool:
    """Whether a candidate takes away so much of what `current` leaves beyond noise that it may be the cause."""
    return t.fitted.excess <= (1 - SEARCH.rival_share) * current.fitted.excess


def significant(trials: Trials, current: CandidateModel, screened: Screened, most: int | None = None) -> list[Suspect]:
    """The suspects worth a fit: the best of those that score enough, `most` of them or those of a round, no more than a third of one
    law; beside them the best of the laws in a region."""
    need = trials.selection.required_z2(current, screened)
    loud = [s for s in screened.suspects if s.z**2 > need]
    everywhere = [s for s in loud if not s.hypothesis.prior.in_a_region]
    regional = [s for s in loud if s.hypothesis.prior.in_a_region]
    most, beside = most or trials.per_round, SEARCH.regional_per_round
    return [*_loudest(everywhere, most, most // 3), *_loudest(regional, beside, beside)]


def much_of(current: CandidateModel) -> float:
    """The score z^2 at which a suspect, or a set, may take much of what `current` leaves in the channel that weighs least. As a rival's,
    the score is short of what a fit of the shapes reaches."""
    return SEARCH.rival_share * MODEL_SELECTION.much * float(current.squares.min())


def _loudest(suspects: Sequence[Suspect], most: int, of_one_law: int) -> list[Suspect]:
    """The first `most` of them that score no less than a share of the first, no more than so many of one law."""
    chosen: list[Suspect] = []
    for s in suspects:
        same = sum(c.hypothesis.effect == s.hypothesis.effect for c in chosen)
        if s.z**2 >= SEARCH.smallest_score * suspects[0].z ** 2 and same < of_one_law and len(chosen) < most:
            chosen.append(s)
    return chosen


def fit_each(
    trials: Trials,
    fit: Fit,
    suspects: Sequence[Suspect],
    finish: Callable[[Trials, CandidateModel], CandidateModel] = lambda _, t: t,
) -> tuple[CandidateModel, ...]:
    """Each suspect beside what is fitted, and what `finish` makes of it."""

    def one(branch: Trials, s: Suspect) -> list[CandidateModel]:
        return [
            finish(branch, t) for t in branch.tried(fit.restarted.with_cause(s.hypothesis, s.start), s.hypothesis, fit)
        ]

    return tuple(t for fitted in trials.each(one, suspects, lambda s: trying(s.hypothesis)) for t in fitted)


def fit_in_regions(
    trials: Trials, current: CandidateModel, screened: Screened, singles: Sequence[CandidateModel]
) -> tuple[CandidateModel, ...]:
    """The first cause as a law in a region that no test showed, where it promises about as much as a law everywhere does and none of the
    `singles` leaves noise alone: friction that drags in half of the travel makes the rest ring, and is left over everywhere."""
    everywhere = [s for s in screened.suspects if not s.hypothesis.prior.in_a_region]
    enough = any(t.errors.is_noise for t in (current, *singles))
    if current.causes or enough or trials.fitter.recording.kind == "poses" or not everywhere:
        return ()
    most = everywhere[0].z ** 2
    loud = {s.hypothesis.location for s in everywhere if s.z**2 >= SEARCH.smallest_score * most}
    seen = trials.screen.in_regions(current.fit, loud)
    regional = [s for s in seen.suspects if s.hypothesis.prior.in_a_region and s.z**2 >= REGIONS.score * most]
    suspects = regional[: SEARCH.regional_per_round]
    return fit_each(trials, current.fit, suspects, lambda branch, t: restart_elsewhere(branch, t, current, seen))


def as_meant(
    trials: Trials, current: CandidateModel, candidates: Sequence[CandidateModel]
) -> tuple[CandidateModel, ...]:
    """The law that a new cause of a candidate is with the numbers that it has reached, begun with them in its place. A stop that is
    touched at the end of the travel has a narrow valley, which a spring beyond an edge finds and is refused for."""
    named = [
        (t, k, meant)
        for t in candidates
        for k, c in enumerate(t.causes)
        if c not in current.causes and c.effect != PARAMETER and (meant := c.law.meant(t.fit.values(k)))
    ]

    def one(branch: Trials, found: tuple[CandidateModel, int, tuple[str, dict[str, float]]]) -> list[CandidateModel]:
        t, k, (kind, numbers) = found
        other = replace(t.causes[k], effect=kind)
        if other not in branch.screen.hypotheses or other in t.causes:
            return []
        return branch.tried(t.fit.restarted.without(k).with_cause(other, numbers), other)

    fits = trials.each(one, named, lambda found: f"{trying(replace(found[0].causes[found[1]], effect=found[2][0]))}")
    return tuple(t for fitted in fits for t in fitted)


def restart_elsewhere(
    trials: Trials, candidate: CandidateModel, before: CandidateModel, screened: Screened
) -> CandidateModel:
    """The candidate, its causes that are new begun again in the most promising of the other shapes screened, and with single numbers
    of its own shape replaced by those of another, where more than noise is left: a law may have several valleys."""
    others = {s.hypothesis: s.other_starts for s in screened.suspects}
    for k, cause in enumerate(candidate.causes):
        if cause in before.causes or candidate.errors.is_noise:
            continue
        structure, shapes = candidate.fit.restarted, others.get(cause, ())
        size = cause.law.amplitude().name if shapes else ""
        here = structure.starts[k]
        begins = [*shapes, *({**shape, size: here[size]} for shape in shapes)]
        # nearest the optimum that is there
        near = [here | {name: value} for name, value in dict.fromkeys(pair for s in shapes for pair in s.items())]
        if not begins:
            continue
        try:
            promising = [
                start
                for group, most in ((begins, SEARCH.restarts), (near, SEARCH.near_restarts))
                for start in sorted(
                    (structure.restarted(k, begin) for begin in group), key=trials.fitter.rough_objective
                )[:most]
            ]
        except FAILURES as error:
            trials.note_failure(cause, error)
            continue
        candidate = trials.begun_better(candidate, promising)
    return begun_again(trials, candidate, before.causes)


def fit_other_clocks(
    trials: Trials, current: CandidateModel, singles: Sequence[CandidateModel]
) -> tuple[CandidateModel, ...]:
    """What a signal that is early or late explains, alone and beside the best of the `singles`, begun at the best of many
    shifts. The screen hardly sees it: a shift of several samples is no multiple of a slope. As every suspect, one alone must promise a
    share of what the best single takes away; as every set, one beside another a share of what that leaves."""
    h = min(r.sample_time for r in trials.fitter.recording.records)
    open_ = (o for o in (h.beside(current.causes) for h in trials.screen.hypotheses) if o is not None)
    shifts = [o for o in open_ if o.shifts]
    if current.errors.is_noise or trials.fitter.recording.kind == "poses" or not shifts:
        return ()
    alone = len(trials.fitter.recording.channels) == 1
    most = max((current.fit.objective - t.fit.objective for t in singles), default=0.0)

    def one(branch: Trials, beside: CandidateModel) -> list[CandidateModel]:
        begun: list[tuple[float, Hypothesis, Structure]] = []
        # a drive that is early and a single reading that is late are one shift
        shifted = alone and any(c.shifts for c in beside.causes)
        need = SEARCH.smallest_score * most if beside is current else SEARCH.subset_share * beside.fit.objective
        open_beside = (s for s in shifts if s.beside(beside.causes) is not None)
        for cause in () if shifted else open_beside:
            try:
                start, promised = best_shift(branch.fitter, beside.fit, cause, h)
                if SEARCH.generous_promise * promised < need:
                    continue
                structure = beside.fit.restarted.with_cause(cause, start)
                begun.append((branch.fitter.rough_objective(structure), cause, structure))
            except FAILURES as error:
                branch.note_failure(cause, error)
        if not begun:
            return []
        _, cause, structure = min(begun, key=lambda b: b[0])
        return branch.tried(structure, cause, beside.fit)

    besides = [current, *trials.selection.ranked(singles)[: SEARCH.beside_clocks]]
    return tuple(t for fitted in trials.each(one, besides, lambda _: trying(*shifts)) for t in fitted)


def fit_own_shifts(trials: Trials, current: CandidateModel) -> tuple[CandidateModel, ...]:
    """Each reading shifted in time by a number of its own, in place of one shift of all of them, which bars another one beside it; begun
    where that one ended, or at the best shift from there."""
    if current.errors.is_noise:
        return ()
    h = min(r.sample_time for r in trials.fitter.recording.records)
    fits: list[CandidateModel] = []
    for k, every in enumerate(current.causes):
        own = [o for o in trials.screen.hypotheses if o.effect == every.effect and not is_group(o.at)]
        if every.effect == PARAMETER or not (every.shifts and is_group(every.at)) or len(own) < 2:
            continue
        structure, begun = current.fit.restarted.without(k), current.fit.values(k)
        for cause in own:
            structure = structure.with_cause(cause, begun)
        try:
            for i, cause in enumerate(own, len(current.causes) - 1):
                (now,) = begun.values()
                moved = structure.restarted(i, best_shift(trials.fitter, current.fit, cause, h, now)[0])
                structure = min(structure, moved, key=trials.fitter.rough_objective)
        except FAILURES as error:
            trials.note_failure(own[0], error)
            continue
        fits += trials.tried(structure, own[0])
    return tuple(fits)


def _as_stated(trials: Trials, current: CandidateModel) -> tuple[CandidateModel, ...]:
    """What is suspected of the device with its own numbers as stated: a fit that bends them so far sees what they hide no
    more."""
    try:
        stated = trials.fitter.fit(replace(current.fit.restarted, nominal_starts={}), steps=0)
    except FAILURES as error:
        trials.note_failure(None, error)
        return ()
    return fit_each(trials, stated, significant(trials, current, trials.screen.run(stated)))


def fit_subsets(
    trials: Trials,
    current: CandidateModel,
    screened: Screened,
    singles: Sequence[CandidateModel],
    most: int = SUBSETS.largest,
    least_promised: float = 0.0,
) -> list[CandidateModel]:
    """Sets of suspects, `most` of them at most, that promise more than any single one gave, and at least so much; each size must promise
    more than the smaller. None where a single one leaves noise alone."""
    known = bool(trials.fitter.noise.known.all())
    if known and any(t.errors.is_noise and not current.errors.is_noise for t in singles):
        return []
    best = max((current.fit.objective - t.fit.objective for t in singles), default=0.0)
    least = min((t.fitted.excess for t in singles), default=np.inf)
    candidates: list[CandidateModel] = []

    def one(branch: Trials, suspects: Sequence[Suspect]) -> list[CandidateModel]:
        structure = current.fit.restarted
        for s in suspects:
            structure = structure.with_cause(s.hypothesis, s.start)
        # more causes that leave more than fewer do are none
        return branch.tried(structure, suspects[-1].hypothesis, current.fit, enough=current.fit.objective - best)

    for size in range(2, min(most, SUBSETS.largest) + 1):
        explained = least <= (1 - MODEL_SELECTION.most_of_mismatch) * current.fitted.excess
        if size > 2 and explained and trials.fitter.recording.kind == "series":
            break
        left = current.fit.objective - best
        enough = best + max(trials.selection.required_z2(current, screened), SEARCH.subset_share * left)
        sets = _promising_sets(screened, size, max(enough, least_promised), trials.per_round)
        tried = trials.each(one, sets, lambda suspects: trying(*(s.hypothesis for s in suspects)))
        candidates += [t for fitted in tried for t in fitted]
        sound = [t for t in candidates if not trials.objections(t)]
        best = max([best, *(current.fit.objective - t.fit.objective for t in sound)])
        least = min([least, *(t.fitted.excess for t in sound)])
    return candidates


def _promising_sets(screened: Screened, size: int, enough: float, most: int) -> list[tuple[Suspect, ...]]:
    """The first `most` sets of one size that promise `enough`, no suspect in more than half of them, no two forms of one physics at
    one place, no two shifts in time of one reading."""
    chosen: list[tuple[Suspect, ...]] = []
    used: dict[Hypothesis, int] = {}
    for promised, suspects in screened.subsets:
        causes = [s.hypothesis for s in suspects]
        if len(suspects) != size or promised < enough or len(chosen) >= most:
            continue
        often = max(used.get(h, 0) for h in causes) >= max(2, most // 2)
        barred = any(h.beside(causes[:i]) is None for i, h in enumerate(causes))
        if often or barred or len({(h.form_of, h.location) if h.form_of else h for h in causes}) < size:
            continue
        used.update({h: used.get(h, 0) + 1 for h in causes})
        chosen.append(suspects)
    return chosen


def _converge_promising(
    trials: Trials, current: CandidateModel, candidates: Sequence[CandidateModel]
) -> tuple[CandidateModel, ...]:
    """The candidates, those driven to their end that leave least on the records to fit but are not justified so early."""
    best = sorted(candidates, key=lambda t: t.fit.objective)[: SEARCH.converged_candidates]
    early = [
        t for t in best if t.fit.objective < current.fit.objective and not trials.selection.improves_enough(current, t)
    ]
    ends = dict(zip(map(id, early), trials.each(lambda branch, t: branch.converged(t), early), strict=True))
    return tuple(ends.get(id(t), t) for t in candidates)
