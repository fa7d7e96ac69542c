"""Laws in a finer form: in the place of the plain one of a model, or already of a candidate."""

from __future__ import annotations

from collections.abc import Sequence

from ctrlgen.devices import Device
from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.cause_entry import trying
from ctrlgen.diagnosis.selection.failures import FAILURES
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.diagnosis.settings import SEARCH
from ctrlgen.estimation.hypothesis import DataHints, Hypothesis, nominal_physics
from ctrlgen.estimation.settings import FIT
from ctrlgen.model.effect_terms import available


def finer_forms(trials: Trials, current: CandidateModel) -> tuple[CandidateModel, ...]:
    """`current` with a finer form of one of its laws in that one's place, for each that has one, where more than noise is left, or where
    what is left alone tells the noise."""
    if current.errors.is_noise and trials.fitter.noise.known.all():
        return ()
    return _in_finer_forms(trials, [(current, k, f) for k, cause in enumerate(current.causes) for f in cause.finer])


def finer_at_once(
    trials: Trials, current: CandidateModel, candidates: Sequence[CandidateModel]
) -> tuple[CandidateModel, ...]:
    """A candidate with the finer form of its new cause in that one's place, of laws whose plain form may take too little to be accepted
    (`LawPrior.at_once`): of several candidates with that cause the one that leaves least."""
    best: dict[Hypothesis, tuple[CandidateModel, int, Hypothesis]] = {}
    for t in sorted(candidates, key=lambda t: t.fit.objective):
        for k, cause in enumerate(t.causes):
            for finer in () if cause in current.causes else cause.finer:
                if finer.prior.at_once and finer not in t.causes and not t.errors.is_noise:
                    best.setdefault(finer, (t, k, finer))
    return _in_finer_forms(trials, list(best.values()))


def _in_finer_forms(
    trials: Trials, forms: Sequence[tuple[CandidateModel, int, Hypothesis]]
) -> tuple[CandidateModel, ...]:
    """Each model with a finer form in the place of its cause k."""

    def one(branch: Trials, form: tuple[CandidateModel, int, Hypothesis]) -> list[CandidateModel]:
        model, k, finer = form
        values, others = model.fit.values(k), model.fit.restarted.without(k)
        names = {p.name for p in finer.law.params}

        def begun(shape: dict[str, float]) -> dict[str, float]:
            return {name: v for name, v in finer.law.from_plainer(values | shape).items() if name in names}

        shapes = finer.shapes(finer.channel_on(others.device), peaks(finer, others.device), begun({}))
        starts = [others.with_cause(finer, shape | begun(shape)) for shape in shapes]
        try:
            starts = sorted(starts, key=branch.fitter.rough_objective)[: SEARCH.restarts] if len(starts) > 1 else starts
        except FAILURES as error:
            branch.note_failure(finer, error)
            return []
        # a finer form that leaves more than the plain one is none
        fitted = branch.tried(starts[0], finer, steps=FIT.max_steps, enough=model.fit.objective)
        return [branch.begun_better(t, starts[1:]) for t in fitted]

    def peaks(finer: Hypothesis, device: Device) -> DataHints:
        where = (finer.law.place, finer.acts_on(device)[0])
        return DataHints((trials.screen.peaks or {}).get(where, {}))

    able = [form for form in forms if can_have(form[0].fit.restarted.device, form[2])]
    fits = trials.each(one, able, lambda form: f"{trying(form[2])} instead")
    return tuple(t for fitted in fits for t in fitted)


def can_have(device: Device, finer: Hypothesis) -> bool:
    """Whether such a device has what a finer form reads beside the plain law, such as the speed of a stage."""
    return finer.law.requires <= available(nominal_physics(device), finer.sample_time or None)
