"""Rivals: what would be suspected in place of a cause, with all the others as they are, and the plainer law that it may be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ctrlgen.diagnosis.selection.candidate_model import CandidateModel, Round, linearised_optimum
from ctrlgen.diagnosis.selection.candidates import significant
from ctrlgen.diagnosis.selection.cause_entry import trying
from ctrlgen.diagnosis.selection.confusable import explains_alike, explains_better, is_commoner
from ctrlgen.diagnosis.selection.failures import FAILURES
from ctrlgen.diagnosis.selection.finer_forms import as_one_law
from ctrlgen.diagnosis.selection.form_errors import follows_the_motion_as_well, hardly_told, hidden_rivals
from ctrlgen.diagnosis.selection.model_selection import scored
from ctrlgen.diagnosis.selection.other_laws import stands_for_another
from ctrlgen.diagnosis.selection.precedence import counterparts, explains_alike_but_for_odds
from ctrlgen.diagnosis.selection.subset_search import Suspect
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.diagnosis.settings import CONFUSABLE, MODEL_SELECTION, SEARCH
from ctrlgen.estimation.fit import Fit
from ctrlgen.estimation.hypothesis import PARAMETER, DataHints, Hypothesis
from ctrlgen.estimation.plainer_law import left_beside, may_be_plainer, plainer, plainer_start
from ctrlgen.estimation.settings import FIT
from ctrlgen.estimation.size_odds import size_odds
from ctrlgen.estimation.structure import Structure


def swapped(trials: Trials, current: CandidateModel, before: int) -> CandidateModel:
    """Each cause against what would be suspected in its place, now that the others are there; not what came alone to those
    `before`, which has been compared already. What explains better takes the place, or, at the noise, no worse and is commoner; a function
    of time alone not that of a law that acts with the motion and is told from it by errors of form alone."""
    causes, compare = len(current.causes), trials.selection
    for k in range(before if causes == before + 1 else causes):
        for rival in (*replacements(trials, current, k), *beside_offsets(trials, current, k)):
            takes_place = explains_better(compare, rival, current) or is_commoner(compare, rival, current)
            takes_place &= not follows_the_motion_as_well(current, k, rival)
            if takes_place and not trials.objections(rival, current.causes):
                current = trials.converged(rival)
                break
    return current


def simplified(trials: Trials, current: CandidateModel) -> CandidateModel:
    """The model with the plainer law in place of each one that generalises it, where the fit does not exclude that both are one and it
    explains alike: how the friction falls with speed, say, is then within what noise or discrepancy feigns. Likewise where what the law
    has more is too little to name beside what is left anyway: a friction that differs by 2 % between the directions is dry friction. And
    with one law in the place of several that are parts of it (`as_one_law`)."""
    for t in as_one_law(trials, current):
        if not trials.objections(t, current.causes):
            return simplified(trials, t)
    for k in range(len(current.causes)):
        coarser = _coarser(trials, current, k)
        if coarser is not current:
            return simplified(trials, coarser)
        current = _in_usual_shape(trials, current, k)
        for t in as_plainer(trials, current, k, bounds_tell=False):
            if explains_alike(trials.selection, t, current) and not trials.objections(t, current.causes):
                return simplified(trials, t)
        plain = plainer(current.causes[k])
        for t in _in_plain_law(trials, current, k, plain) if plain is not None else ():
            if not trials.selection.worth_its_form(t, current) and not trials.objections(t, current.causes):
                return simplified(trials, t)
    return current


def as_plainer(trials: Trials, current: CandidateModel, k: int, bounds_tell: bool = True) -> list[CandidateModel]:
    """The model with the plainer law that cause k may be in its place, begun where both are one; none where there is no such law, or
    this machine cannot have it. A part in proportion to the signal, which the plainer law has not, is taken over by the device's numbers
    or by a gain that is there; else a gain stands beside it."""
    plain = may_be_plainer(current.fit, k, bounds_tell)
    return [] if plain is None else _in_plain_law(trials, current, k, plain)


def _in_plain_law(trials: Trials, current: CandidateModel, k: int, plain: Hypothesis) -> list[CandidateModel]:
    """The model with the law `plain`, which cause k generalises, in its place."""
    if plain not in trials.screen.hypotheses:
        return []
    begun = current.fit.restarted.without(k).with_cause(plain, plainer_start(current.fit, k, plain))
    alone = [trials.converged(t) for t in trials.tried(begun, plain)]
    left = left_beside(current.fit, k, plain)
    gains = {gain: start for gain, start in left.items() if gain not in current.causes}
    if not gains or any(explains_alike(trials.selection, t, current) for t in alone):
        return alone
    if not gains.keys() <= set(trials.screen.hypotheses):
        return []
    for gain, start in gains.items():
        begun = begun.with_cause(gain, start)
    return [trials.converged(t) for t in trials.tried(begun, plain)]


def _coarser(trials: Trials, current: CandidateModel, k: int) -> CandidateModel:
    """The model with the plainest of the laws that cause k is a finer form of, where that is enough beside what came later."""
    cause = current.causes[k]
    if not cause.prior.refines:
        return current
    others, fits = current.fit.restarted.without(k), []
    for plain in (replace(cause, effect=effect) for effect in sorted(cause.prior.refines)):
        if plain.law.amplitude().name not in current.fit.values(k):  # a size of another kind
            continue
        channel = plain.channel_on(current.fit.structure.device)
        values = current.fit.values(k)
        numbers = {p.name: values[p.name] for p in plain.law.params if p.name in values}
        starts = [others.with_cause(plain, numbers | shape) for shape in plain.shapes(channel, DataHints(), numbers)]
        if not starts:  # a region that no record suggests here
            continue
        begun = min(starts, key=trials.fitter.rough_objective)
        fits += [trials.converged(t) for t in trials.tried(begun, plain)]
    sound = [t for t in fits if not trials.selection.improves_enough(t, current) and not trials.objections(t)]
    return trials.selection.ranked(sound)[0] if sound else current


def acting_instead(trials: Trials, current: CandidateModel) -> CandidateModel:
    """The model with a law that acts with the motion in place of each function of time alone, where one explains alike."""
    for k, cause in enumerate(current.causes):
        if not cause.prior.of_time:
            continue
        for t in trials.selection.ranked([*counterparts(trials, current, k), *replacements(trials, current, k)]):
            acts = t.cause is not None and not t.cause.prior.of_time
            alike = acts and explains_alike_but_for_odds(trials.selection, t, current)
            if alike and not trials.objections(t, current.causes):
                return acting_instead(trials, trials.converged(t))
    return current


def _in_usual_shape(trials: Trials, current: CandidateModel, k: int) -> CandidateModel:
    """The model with the shapes of cause k at their usual values, else as near as a fit from there stays, where it fits alike and
    foretells the held-out records no worse. A stop that is only touched may be a spring or a ball, and they part once it is run into."""
    cause, fit = current.causes[k], current.fit
    if cause.effect == PARAMETER:
        return current
    channel, free = cause.channel_on(fit.structure.device), fit.structure.free_parameters
    for p in cause.law.params:
        wanted = cause.prior.of(p).usual
        i = next((i for i, u in enumerate(free) if (u.cause, u.name) == (k, p.name)), None)
        if wanted is None or i is None:
            continue
        usual = channel.si(wanted, p)
        off = abs(float(fit.theta[i]) - usual)
        if off == 0:
            continue
        fitter = trials.fitter
        try:
            begun, theta = _begun_usual(trials, fit, k, i, usual)
            # as it is, and as near as a fit from there stays
            tried = [scored(fitter, fitter.fit(begun, theta, steps), current.cause) for steps in (0, FIT.max_steps)]
        except FAILURES as error:
            trials.note_failure(cause, error)
            continue
        left = fitter.held_out_squares(fit)
        for again in tried:
            alike = again.fit.objective <= fit.objective + MODEL_SELECTION.tie
            # as fitted: where the shape is open, held-out records bend it to themselves
            foretells = fitter.held_out_squares(again.fit) <= left
            if abs(float(again.fit.theta[i]) - usual) < off and alike and foretells:
                trials.fitted[frozenset(again.causes)] = (again, FIT.max_steps)
                current, fit = again, again.fit
                break
    return current


def _begun_usual(trials: Trials, fit: Fit, k: int, i: int, usual: float) -> tuple[Structure, np.ndarray]:
    """The structure with its number i, a shape of cause k, at its `usual` value, and the other numbers (k,) fitted to that: the best
    of several starts."""
    free, values, fits = fit.structure.free_parameters, fit.values(k), []
    size = fit.structure.causes[k].law.amplitude().name
    for times in SEARCH.usual_amplitudes:
        start = values | {free[i].name: usual, size: times * values[size]}
        begun = fit.restarted.restarted(k, start)
        # what is not free is as the simulator was expanded
        begun = replace(begun, expansion=begun.starts)
        fits.append((trials.fitter.fit(replace(begun, free=(*free[:i], *free[i + 1 :])), steps=FIT.max_steps), begun))
    best, begun = min(fits, key=lambda f: f[0].objective)
    return begun, np.insert(best.theta, i, usual)


Alike = tuple[CandidateModel, ...]


def rivals(trials: Trials, current: CandidateModel, k: int, rounds: Sequence[Round] = ()) -> tuple[Alike, Alike]:
    """What explains alike in place of cause k, or is the plainer law that the fit does not exclude; with what the `rounds` tried in its
    place, and what an error of form hides. And what fits alike, and is unlikely of the size that it takes."""
    there, plainer = current.causes, as_plainer(trials, current, k)
    tried = [t for r in rounds for t in r.candidates if not current.errors.is_noise]
    candidates = [
        *plainer,
        *replacements(trials, current, k),
        *twins(trials, current, k),
        *(offsets := beside_offsets(trials, current, k)),
        *_in_place_of(k, there, tried),
    ]
    hidden = hidden_rivals(trials, current, k, candidates)
    # what the cause stands for need not do quite as well
    slack = SEARCH.bound_slack if stands_for_another(current.fit, k) else 0.0

    def is_alike(t: CandidateModel) -> bool:
        # the numbers of two laws in place of one are no reason to believe that one
        more = SEARCH.bound_slack if t in offsets else slack
        return t in plainer or t in hidden or explains_alike(trials.selection, t, current, more)

    alike = {
        t.cause: t
        for t in reversed([*candidates, *hidden])
        if not (_same_name(t.cause, there[k]) or _contains(t, there[k]) or _one_law(t.cause, there[k])) and is_alike(t)
    }
    # a line and a pitch at one speed: how rare a line is does not tell them apart
    for t in counterparts(trials, current, k):
        if explains_alike_but_for_odds(trials.selection, t, current):
            alike.setdefault(t.cause, t)
    odds = size_odds(current.fit)
    unlikely = [
        t
        for t in {t.cause: t for t in reversed(candidates)}.values()
        if t.cause not in alike
        and t.cause != there[k]
        and size_odds(t.fit) < odds
        and explains_alike_but_for_odds(trials.selection, t, current)
    ]

    def sound(models: list[CandidateModel]) -> Alike:
        return tuple(t for t in trials.selection.ranked(models) if not trials.objections(t, there))

    return sound(list(alike.values())), sound(unlikely)


def beside_offsets(trials: Trials, current: CandidateModel, k: int) -> list[CandidateModel]:
    """The model with the plainer law and an offset in the place of cause k, of which a part is a constant once the stage has moved: of
    each offset that is offered and not there, as its cause, the best first. Friction that differs by direction is friction alike and a
    sensor that does not read zero."""
    cause = current.causes[k]
    plain = plainer(cause)
    relation = None if plain is None else cause.law.plainer
    if plain is None or relation is None or not relation.constant or plain not in trials.screen.hypotheses:
        return []
    # a part below a hundredth of the law's squares has no name, as an offset has none
    if current.fit.values(k)[relation.constant] ** 2 < MODEL_SELECTION.least_share:
        return []
    begun = current.fit.restarted.without(k).with_cause(plain, plainer_start(current.fit, k, plain))
    there = {h.effect for h in current.causes}
    offsets = [h for h in trials.screen.hypotheses if h.effect != PARAMETER and h.prior.constant]
    # the zero of each record is told apart from one zero where they differ (`of_each_record`)
    offsets = [h for h in offsets if h.at == cause.at and h.effect not in there and not h.prior.of_each_record]

    def one(branch: Trials, offset: Hypothesis) -> list[CandidateModel]:
        return branch.tried(begun.with_cause(offset, {offset.law.amplitude().name: 0.0}), offset)

    tried = trials.each(one, offsets, lambda offset: f"{trying(plain, offset)} instead")
    return trials.selection.ranked([trials.converged(t) for fitted in tried for t in fitted])


def _in_place_of(k: int, there: Sequence[Hypothesis], tried: Sequence[CandidateModel]) -> list[CandidateModel]:
    """Those of the `tried` models that hold the causes `there`, but another one instead of cause k."""
    others = set(there) - {there[k]}
    replaced = []
    for t in tried:
        if len(t.causes) == len(there) and others < set(t.causes) and there[k] not in t.causes:
            (cause,) = set(t.causes) - others
            replaced.append(replace(t, cause=cause))
    return replaced


def replacements(trials: Trials, current: CandidateModel, k: int) -> list[CandidateModel]:
    """What would be suspected instead of cause k, with all the rest as it is now: refitted, it may have gone astray. What came nowhere
    near in the place of the same cause before, beside the same causes or more, is not fitted again."""
    structure = current.fit.structure
    place, rest = structure.causes[k], frozenset(current.causes) - {structure.causes[k]}
    others = current.fit.restarted.without(k)
    try:
        bare, screened = trials.screened_without(current.fit, k)
    except FAILURES as error:
        trials.note_failure(structure.causes[k], error)
        return []
    without = linearised_optimum(bare)
    gained = without - current.fit.objective
    able = [
        s
        for s in significant(trials, current, screened, SEARCH.most_rivals)
        if s.z**2 > SEARCH.rival_share * gained
        and s.hypothesis != place
        and not any(rest <= beside for beside in trials.beaten.get((place, s.hypothesis), ()))
    ]

    # what cannot take away so much of it is no rival
    enough = without - SEARCH.rival_share * gained

    def one(branch: Trials, s: Suspect) -> list[CandidateModel]:
        return branch.tried(replace_cause(branch, current.fit, k, others, s), s.hypothesis, enough=enough)

    fits = [t for fitted in trials.each(one, able, lambda s: f"{trying(s.hypothesis)} instead") for t in fitted]
    near = trials.close_contenders(without, current, trials.selection.ranked(fits))
    # what cannot come near by the criterion is not fitted to its end
    n = max(trials.selection.samples(current.fitted, current.errors), 1.0)
    reach = max(SEARCH.rival_reach, float(np.exp(SEARCH.rival_margin / n)))
    ends = trials.each(lambda branch, t: branch.converged(t, reach * current.fit.objective), near)
    tried = trials.selection.ranked([*ends, *(t for t in fits if t not in near)])
    # one of them may stand there next
    for winner, best in ((place, current), *((t.cause, t) for t in tried)):
        for t in tried:
            if (
                winner is None
                or t.cause is None
                or t.fit.objective <= reach * best.fit.objective
                or hardly_told(best, t)
            ):
                continue
            trials.beaten[winner, t.cause] = (*trials.beaten.get((winner, t.cause), ()), rest)
    return tried


def twins(trials: Trials, current: CandidateModel, k: int) -> list[CandidateModel]:
    """The model with what does the same as cause k in its place, such as the gain of the drive for that of the sensor, begun where it does
    what that one does now. Without cause k the others may bend to do its part, and then no screen suspects it."""
    fit = current.fit
    sizes = {i for i, u in enumerate(fit.structure.free_parameters) if u.cause == k and u.amplitude}
    others, found = fit.restarted.without(k), trials.screened(current).twins
    same = [(h, start) for h, (i, start) in found.items() if i in sizes and h not in current.causes]
    same = same[: CONFUSABLE.most_listed]

    def one(branch: Trials, twin: tuple[Hypothesis, dict[str, float]]) -> list[CandidateModel]:
        return branch.tried(others.with_cause(*twin), twin[0])

    tried = trials.each(one, same, lambda twin: f"{trying(twin[0])} instead")
    fits = trials.selection.ranked([t for fitted in tried for t in fitted])
    return [trials.converged(t) if t is fits[0] else t for t in fits]


def replace_cause(trials: Trials, fit: Fit, k: int, others: Structure, suspect: Suspect) -> Structure:
    """The suspect beside the `others` in place of cause k of a fit; another form of its physics begun with that one's numbers where that is
    better: what they have in common means the same."""
    structure = others.with_cause(suspect.hypothesis, suspect.start)
    cause = fit.structure.causes[k]
    if cause.form_of is None or (cause.form_of, cause.at) != (suspect.hypothesis.form_of, suspect.hypothesis.at):
        return structure
    common = {name: value for name, value in fit.values(k).items() if name in suspect.start}
    kin = (structure.restarted(len(others.causes), s | common) for s in (suspect.start, *suspect.other_starts))
    return min((structure, *kin), key=trials.fitter.rough_objective)


def _contains(rival: CandidateModel, cause: Hypothesis) -> bool:
    """Whether a rival's law is the cause's but for numbers that it does not tell from those of the cause: it is no other physics."""
    places = [k for k, c in enumerate(rival.causes) if c == rival.cause and c.location == cause.location]
    return any((plain := may_be_plainer(rival.fit, k)) and plain.effect == cause.effect for k in places)


def _one_law(a: Hypothesis | None, b: Hypothesis) -> bool:
    """Whether one cause is a finer form of the other."""
    return a is not None and (b in a.finer or a in b.finer)


def _same_name(a: Hypothesis | None, b: Hypothesis) -> bool:
    """Whether two causes have one name, as harmonics do."""
    return a is not None and (a.effect, a.location, a.path) == (b.effect, b.location, b.path)
