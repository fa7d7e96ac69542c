"""Runs the supporting analyses of a diagnosis and turns them into plain numbers and words."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ctrlgen.core.to_json import plain
from ctrlgen.diagnosis.evidence.detectability import detectability
from ctrlgen.diagnosis.evidence.experiment_design import Experiment, next_experiment
from ctrlgen.diagnosis.evidence.experiment_files import files
from ctrlgen.diagnosis.evidence.ltv_linearisation import LtvModel, linearise_along
from ctrlgen.diagnosis.evidence.residual_localisation import localise_residual
from ctrlgen.diagnosis.evidence.unmodelled_dynamics import describe_unmodelled_force
from ctrlgen.diagnosis.selection.candidate_model import CandidateModel, Refusal, Round, SearchResult
from ctrlgen.diagnosis.selection.trials import FAILURES

NEXT_DEVICE = "../device.next.toml"  # from the folder of the next experiment


@dataclass(frozen=True, eq=False)
class SupportingAnalyses:
    """Residual location before and after the correction, detectability, next experiment, search history, and `extra`
    (unmodelled_force; files of the next experiment), all in the types of JSON and in the recording's units; `failed`: what
    could not be made, and why."""

    residual_location: dict[str, Any]
    detectability: dict[str, Any]
    next_experiment: dict[str, Any] | None
    search_history: tuple[dict[str, Any], ...]
    extra: dict[str, Any]
    failed: tuple[str, ...] = ()


def run_supporting_analyses(search: SearchResult, explained: bool, seed: int = 0) -> SupportingAnalyses:
    """All supporting analyses. `explained`: the residual of the chosen model passes its tests. `seed` draws bootstrap and drives."""
    fitter, recording = search.fitter, search.fitter.recording
    nominal, chosen = search.nominal.fit, search.chosen.fit
    records = [*fitter.fit_records, *fitter.held_out_records]

    def located(models: list[LtvModel]) -> dict[str, Any]:
        return plain(localise_residual(models, recording.channels, recording.units, seed))

    before = [linearise_along(fitter, nominal, record) for record in records]
    after = before if chosen is nominal else [linearise_along(fitter, chosen, record) for record in records]
    location = {"before": located(before), "after": located(after)}
    extra: dict[str, Any] = {"unmodelled_force": None, "files": {}}
    failed: list[str] = []

    def tried(name: str, analysis: Callable[[], Any]) -> Any:
        """Its result; None, with a note, where it cannot be made: no finding depends on it."""
        try:
            return analysis()
        except FAILURES as error:
            failed.append(f"{name} is left out: {error}")
            return None

    if not explained and (f := tried("the unknown input", lambda: describe_unmodelled_force(fitter, after))):
        short = {key: value for key, value in vars(f).items() if key != "estimates"}  # one value a sample
        extra["unmodelled_force"] = plain(short)
        location["after"]["unmodelled_force"] = {"statements": extra["unmodelled_force"]["statements"]}
    experiment = tried("the next experiment", lambda: next_experiment(search, explained, seed))
    if experiment is not None:
        extra["files"] = files(fitter, chosen, experiment, NEXT_DEVICE)
    return SupportingAnalyses(
        residual_location=location,
        detectability=plain(detectability(chosen, search.final_screen, chosen.n)),
        next_experiment=_next(experiment),
        search_history=search_history(search),
        extra=extra,
        failed=tuple(failed),
    )


def search_history(search: SearchResult) -> tuple[dict[str, Any], ...]:
    """The rounds in order: candidate models with their scores and criteria, and the decision."""
    rows = []
    following = [*(r.before for r in search.rounds[1:]), search.chosen]
    for number, round_ in enumerate(search.rounds, 1):
        then = following[number - 1]
        rows.append(
            {
                "round": number,
                "threshold": float(round_.screened.threshold),
                "suspects": len(round_.screened.suspects),
                "criterion_before": round_.criterion_before,
                "candidates": [
                    _tried(t, T, round_, then) for t, T in zip(round_.candidates, round_.criteria, strict=True)
                ],
                "refused": [_refused(r) for r in round_.refused],
                "failed": list(round_.failed),
                "causes_after": [[c.effect, c.location] for c in then.fit.structure.causes],
                "decision": _decision(round_.before, then, bool(round_.candidates)),
            }
        )
    return tuple(rows)


def _refused(refusal: Refusal) -> dict[str, Any]:
    """The causes for which a model was refused, and the reasons."""
    causes = [{"effect": c.effect, "location": c.location} for c in refusal.causes]
    return {"causes": causes, "reasons": list(refusal.reasons)}


def _tried(trial: CandidateModel, criterion: float, round_: Round, then: CandidateModel) -> dict[str, Any]:
    """The causes that one candidate model adds, and its criterion."""
    earlier = round_.before.fit.structure.causes
    z = {s.hypothesis: s.z for s in round_.screened.suspects}
    causes = [
        {"effect": c.effect, "location": c.location, "z": z.get(c), "accepted": c in then.fit.structure.causes}
        for c in trial.fit.structure.causes
        if c not in earlier
    ]
    return plain(
        {
            "causes": causes,
            "criterion": criterion,
            "fitted": float(np.mean(trial.fitted.plain_mean)),
            "held_out": float(np.mean(trial.held_out.plain_mean)),
        }
    )


def _decision(before: CandidateModel, then: CandidateModel, tried: bool) -> str:
    if not tried:
        return "no hypothesis exceeds the threshold: stopped"
    added = [c for c in then.fit.structure.causes if c not in before.fit.structure.causes]
    gone = [c for c in before.fit.structure.causes if c not in then.fit.structure.causes]
    if not added and not gone:
        return "no candidate is confirmed by the held-out records: stopped"
    words = [f"added {c.effect} at {c.location}" for c in added] + [f"dropped {c.effect} at {c.location}" for c in gone]
    return ", ".join(words)


def _next(experiment: Experiment | None) -> dict[str, Any] | None:
    if experiment is None:
        return None
    best = experiment.candidates[0]
    return plain(
        {
            "discriminates_between": list(experiment.rivals), "reason": experiment.reason,
            "description": best.description, "kind": best.kind,
            "strength": best.strength, "samples": len(experiment.record.drive), "sample_time": experiment.record.sample_time,
            "separation_now": experiment.before, "separation_after": experiment.after, "settles": experiment.settles,
            "candidates": list(experiment.candidates),
        }
    )  # fmt: skip
