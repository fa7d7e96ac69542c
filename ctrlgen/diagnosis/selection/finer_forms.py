"""Laws in a finer form, in the place of the plain one of a model."""

from __future__ import annotations

from ctrlgen.devices import Device
from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.cause_entry import trying
from ctrlgen.diagnosis.selection.failures import FAILURES
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.diagnosis.settings import SEARCH
from ctrlgen.estimation.hypothesis import DataHints, Hypothesis, nominal_physics
from ctrlgen.estimation.settings import FIT
from ctrlgen.estimation.structure import Structure
from ctrlgen.model.effect_terms import available


def finer_forms(trials: Trials, current: CandidateModel) -> tuple[CandidateModel, ...]:
    """`current` with a finer form of one of its laws in that one's place, or with a law that is suspected too and nearly the same
    (`LawPrior.in_place_of`), for each that has one, where more than noise is left, or where what is left alone tells the noise."""
    if current.errors.is_noise and trials.fitter.noise.known.all():
        return ()

    def one(branch: Trials, form: tuple[int, Hypothesis]) -> list[CandidateModel]:
        k, finer = form
        values, others = current.fit.values(k), current.fit.restarted.without(k)
        names = {p.name for p in finer.law.params}

        def begun(shape: dict[str, float]) -> dict[str, float]:
            return {name: v for name, v in finer.law.from_plainer(values | shape).items() if name in names}

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
        fitted = branch.tried(starts[0], finer, steps=FIT.max_steps, enough=current.fit.objective)
        return [branch.begun_better(t, starts[1:]) for t in fitted]

    def hints(branch: Trials, finer: Hypothesis, others: Structure) -> DataHints:
        where = (finer.law.place, finer.acts_on(device)[0])
        if finer.prior.in_place_of:  # another law, of what is left without this one
            return branch.screen.data_hints(branch.fitter.fit(others, steps=SEARCH.candidate_steps))(*where)
        return DataHints((trials.screen.peaks or {}).get(where, {}))

    device = current.fit.restarted.device
    forms = [
        (k, finer)
        for k, cause in enumerate(current.causes)
        for finer in cause.finer
        if can_have(device, finer) and (finer.prior.refines or _is_suspected(trials, finer))
    ]
    fits = trials.each(one, forms, lambda form: f"{trying(form[1])} instead")
    return tuple(t for fitted in fits for t in fitted)


def _is_suspected(trials: Trials, law: Hypothesis) -> bool:
    return any((h.effect, h.location) == (law.effect, law.location) for h in trials.screen.hypotheses)


def can_have(device: Device, finer: Hypothesis) -> bool:
    """Whether such a device has what a finer form reads beside the plain law, such as the speed of a stage."""
    return finer.law.requires <= available(nominal_physics(device), finer.sample_time or None)
