"""Laws in a finer form, in the place of the plain one of a model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ctrlgen.devices import Device
from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.cause_entry import trying
from ctrlgen.diagnosis.selection.failures import FAILURES
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.diagnosis.settings import SEARCH
from ctrlgen.effects import overlap
from ctrlgen.estimation.hypothesis import DataHints, Hypothesis, nominal_physics
from ctrlgen.estimation.settings import FIT
from ctrlgen.estimation.structure import Structure
from ctrlgen.model.effect_terms import available

Form = tuple[tuple[int, ...], Hypothesis]
"""The places, among the causes of a model, of the law that a finer form takes the place of, of those that it does the work of too, and the
finer form."""


def finer_forms(trials: Trials, current: CandidateModel) -> tuple[CandidateModel, ...]:
    """`current` with a finer form of one of its laws in that one's place, or with a law that is suspected too and nearly the same
    (`LawPrior.in_place_of`), for each that has one, where more than noise is left, or where what is left alone tells the noise."""
    if current.errors.is_noise and trials.fitter.noise.known.all():
        return ()
    return _fitted(trials, current, [*_of_one(trials, current), *_of_several(trials, current)], current.fit.objective)


def as_one_law(trials: Trials, current: CandidateModel) -> tuple[CandidateModel, ...]:
    """`current` with a finer form of one of its laws in the place of that and of others that may be parts of it, as a filter and a notch
    are of a mean over a window (`LawPrior.also_in_place_of`), fitted to its end."""
    fits = _fitted(trials, current, _of_several(trials, current), np.inf)
    return tuple(trials.converged(t) for t in fits)


def _of_one(trials: Trials, current: CandidateModel) -> list[Form]:
    return [
        ((k,), finer)
        for k, cause in enumerate(current.causes)
        for finer in cause.finer
        if can_have(current.fit.restarted.device, finer) and (finer.prior.refines or _is_suspected(trials, finer))
    ]


def _of_several(trials: Trials, current: CandidateModel) -> list[Form]:
    """The finer forms that may be what several causes are at one channel, each once."""
    forms: dict[tuple[Hypothesis, frozenset[int]], Form] = {}
    for (k,), finer in _of_one(trials, current):
        parts = [
            j
            for j, c in enumerate(current.causes)
            if j != k and c.effect in finer.prior.also_in_place_of and overlap(c.at, finer.at)
        ]
        if parts:
            forms.setdefault((finer, frozenset((k, *parts))), ((k, *parts), finer))
    return list(forms.values())


def _fitted(
    trials: Trials, current: CandidateModel, forms: Sequence[Form], enough: float
) -> tuple[CandidateModel, ...]:
    """`current` in each of the forms, which are not fitted to their end where they leave more than is `enough`."""

    def one(branch: Trials, form: Form) -> list[CandidateModel]:
        places, finer = form
        others, size = current.fit.restarted, finer.law.amplitude().name
        for k in sorted(places, reverse=True):
            others = others.without(k)
        names = {p.name for p in finer.law.params}

        def begun(shape: dict[str, float]) -> dict[str, float]:
            first, *more = (finer.law.from_plainer(current.fit.values(k) | shape) for k in places)
            whole = {size: first[size] + sum(part.get(size, 0.0) for part in more)} if more else {}
            return {name: v for name, v in (first | whole).items() if name in names}

        try:
            shapes = finer.shapes(finer.channel_on(others.device), hints(branch, finer, others), begun({}))
            starts = [others.with_cause(finer, shape | begun(shape)) for shape in shapes]
            starts = sorted(starts, key=branch.fitter.rough_objective)[: SEARCH.restarts] if len(starts) > 1 else starts
        except FAILURES as error:
            branch.note_failure(finer, error)
            return []
        if not starts:
            return []
        # a finer form that leaves more than the plain one is none
        fitted = branch.tried(starts[0], finer, steps=FIT.max_steps, enough=enough)
        return [branch.begun_better(t, starts[1:]) for t in fitted]

    def hints(branch: Trials, finer: Hypothesis, others: Structure) -> DataHints:
        where = (finer.law.place, finer.acts_on(others.device)[0])
        if finer.prior.in_place_of:  # another law, of what is left without this one
            return branch.screen.data_hints(branch.fitter.fit(others, steps=SEARCH.candidate_steps))(*where)
        return DataHints((trials.screen.peaks or {}).get(where, {}))

    fits = trials.each(one, forms, lambda form: f"{trying(form[1])} instead")
    return tuple(t for fitted in fits for t in fitted)


def _is_suspected(trials: Trials, law: Hypothesis) -> bool:
    return any((h.effect, h.location) == (law.effect, law.location) for h in trials.screen.hypotheses)


def can_have(device: Device, finer: Hypothesis) -> bool:
    """Whether such a device has what a finer form reads beside the plain law, such as the speed of a stage."""
    return finer.law.requires <= available(nominal_physics(device), finer.sample_time or None)
