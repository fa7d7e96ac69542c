"""Laws in a finer form, in the place of the plain one of a model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ctrlgen.devices import Device
from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.cause_entry import trying
from ctrlgen.diagnosis.selection.confusable import explains_alike
from ctrlgen.diagnosis.selection.failures import FAILURES
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.diagnosis.settings import SEARCH
from ctrlgen.effects import laws
from ctrlgen.estimation.hypothesis import DOMAIN, DataHints, Hypothesis, nominal_physics
from ctrlgen.estimation.priors import prior_of
from ctrlgen.estimation.settings import FIT
from ctrlgen.estimation.structure import Structure
from ctrlgen.model.effect_terms import available, channels

Form = tuple[tuple[int, ...], Hypothesis]
"""The places, among the causes of a model, of the law that a finer form takes the place of, of those that it does the work of too, and the
finer form."""


def finer_forms(trials: Trials, current: CandidateModel) -> tuple[CandidateModel, ...]:
    """`current` with a finer form of one of its laws in that one's place, or with a law that is suspected too and nearly the same
    (`LawPrior.in_place_of`), or in the place of what may be its parts, for each that has one, where more than noise is left, or where what
    is left alone tells the noise. A law that is none of theirs with a number more, as a mean over a window is no filter, must take away as
    much as a further term."""
    if current.errors.is_noise and trials.fitter.noise.known.all():
        return ()
    forms = [*_of_one(trials, current), *_of_parts(trials, current)]

    def is_worth(t: CandidateModel) -> bool:
        of_another_form = t.cause is not None and bool(t.cause.prior.also_in_place_of)
        return not of_another_form or trials.selection.worth_its_form(current, t)

    return tuple(t for t in _fitted(trials, current, forms, current.fit.objective) if is_worth(t))


def as_one_law(trials: Trials, current: CandidateModel) -> tuple[CandidateModel, ...]:
    """`current` with one law in the place of what may be its parts, as a filter and a notch are of a mean over a window
    (`LawPrior.also_in_place_of`), fitted to its end: of several that explains alike, of one that leaves less on both kinds of records."""
    compare = trials.selection
    found: list[CandidateModel] = []
    for form in _of_parts(trials, current):
        for t in (trials.converged(t) for t in _fitted(trials, current, [form], np.inf)):
            errors = compare.reference((current, t))
            less = all(loss(t, errors) < loss(current, errors) for loss in (compare.fit_loss, compare.held_out_loss))
            if (less and compare.worth_its_form(current, t)) or (
                len(form[0]) > 1 and explains_alike(compare, t, current)
            ):
                found.append(t)
    return tuple(compare.ranked(found))


def _of_one(trials: Trials, current: CandidateModel) -> list[Form]:
    return [
        ((k,), finer)
        for k, cause in enumerate(current.causes)
        for finer in cause.finer
        if can_have(current.fit.restarted.device, finer) and (finer.prior.refines or _is_suspected(trials, finer))
    ]


def _of_parts(trials: Trials, current: CandidateModel) -> list[Form]:
    """The laws that may be what causes at one channel are: all of them together, and each that the law does not refine."""
    device = current.fit.restarted.device
    forms: list[Form] = []
    for kind, law in sorted(laws().items()):
        also, refined = (getattr(prior_of(law), name) for name in ("also_in_place_of", "refines"))
        own = channels(nominal_physics(device), law.place) if also else []
        for at in [c.name for c in own if f"reading.{c.name}" in trials.fitter.recording.channels]:
            parts = [k for k, c in enumerate(current.causes) if c.effect in also | refined and c.at == at]
            wholes = [tuple(parts)] if len(parts) > 1 else []
            for places in (*wholes, *((k,) for k in parts if current.causes[k].effect not in refined)):
                first = current.causes[places[0]]
                finer = replace(first, effect=kind, location=f"{DOMAIN[law.place]}:{at}", at=at, of=None, count=0)
                if can_have(device, finer):
                    forms.append((places, finer))
    return forms


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
