"""The evidence beside the verdict: where, what was detectable, how sure the numbers are, what else it could be, what next."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ctrlgen.core.to_json import plain
from ctrlgen.diagnosis.estimation.fit import Fit, Fitter
from ctrlgen.diagnosis.evidence.detectability import detectability
from ctrlgen.diagnosis.evidence.experiment_design import Experiment, next_experiment
from ctrlgen.diagnosis.evidence.experiment_files import files
from ctrlgen.diagnosis.evidence.ltv_linearisation import linearise_along
from ctrlgen.diagnosis.evidence.residual_localisation import localise_residual
from ctrlgen.diagnosis.evidence.unmodelled_dynamics import describe_unmodelled_force
from ctrlgen.diagnosis.selection.candidate_model import CandidateModel, Round, SearchResult

NEXT_DEVICE = "../device.next.toml"  # from the folder of the next experiment


@dataclass(frozen=True, eq=False)
class SupportingAnalyses:
    """`where`, `detectable`, `next_experiment`, `history` and `extra` (unknown, files of the next experiment)
    as plain numbers and words, in the reader's units."""

    residual_location: dict[str, Any]
    detectability: dict[str, Any]
    next_experiment: dict[str, Any] | None
    search_history: tuple[dict[str, Any], ...]
    extra: dict[str, Any]


def run_supporting_analyses(fitter: Fitter, search: SearchResult, explained: bool, seed: int = 0) -> SupportingAnalyses:
    """Everything beside the findings. `explained`: the chosen structure leaves nothing over."""
    recording = fitter.recording
    nominal, chosen = search.nominal.fit, search.chosen.fit
    records = [*fitter.fit_records, *fitter.held_out_records]

    def place(fit: Fit, lefts: list) -> dict[str, Any]:
        return plain(localise_residual(lefts, recording.channels, recording.units, seed))

    before = [linearise_along(fitter, nominal, record) for record in records]
    after = before if chosen is nominal else [linearise_along(fitter, chosen, record) for record in records]
    extra: dict[str, Any] = {"unmodelled_force": None, "files": {}}
    if not explained:
        found = vars(describe_unmodelled_force(fitter, chosen, after))
        extra["unmodelled_force"] = plain(
            {key: value for key, value in found.items() if key != "estimates"}
        )  # that is sample by sample
    left = place(chosen, after)
    if extra["unmodelled_force"]:
        left["unmodelled_force"] = {key: extra["unmodelled_force"][key] for key in ("statements", "empirical_term")}
    experiment = next_experiment(fitter, search, explained, seed)
    if experiment is not None:
        extra["files"] = files(fitter, chosen, experiment, NEXT_DEVICE)
    return SupportingAnalyses(
        residual_location={"before": place(nominal, before), "after": left},
        detectability=plain(detectability(chosen, search.final_screen, chosen.n)),
        next_experiment=_next(experiment),
        search_history=search_history(search),
        extra=extra,
    )


def search_history(search: SearchResult) -> tuple[dict[str, Any], ...]:
    """The rounds in order: what was tried, with T before and after and the z of the screen, and what was decided."""
    rows = []
    following = [*(r.before for r in search.rounds[1:]), search.chosen]
    for number, round_ in enumerate(search.rounds, 1):
        then = following[number - 1]
        rows.append(
            {
                "round": number,
                "threshold": float(round_.screened.threshold),
                "suspects": len(round_.screened.suspects),
                "criterion_before": float(round_.before.criterion),
                "candidates": [_tried(t, round_, then) for t in round_.candidates],
                "causes_after": [[c.effect, c.location] for c in then.fit.structure.causes],
                "decision": _decision(round_.before, then, bool(round_.candidates)),
            }
        )
    return tuple(rows)


def _tried(trial: CandidateModel, round_: Round, then: CandidateModel) -> dict[str, Any]:
    """The causes that one trial added, alone or together."""
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
            "criterion": trial.criterion,
            "objective": trial.fit.objective,
            "held_out_deviance": trial.held_out_deviance,
        }
    )


def _decision(before: CandidateModel, then: CandidateModel, tried: bool) -> str:
    if not tried:
        return "nothing stands out: stopped"
    added = [c for c in then.fit.structure.causes if c not in before.fit.structure.causes]
    gone = [c for c in before.fit.structure.causes if c not in then.fit.structure.causes]
    if not added and not gone:
        return "nothing tried is justified on the held-out records: stopped"
    words = [f"added {c.effect} at {c.location}" for c in added] + [f"dropped {c.effect} at {c.location}" for c in gone]
    return ", ".join(words)


def _next(found: Experiment | None) -> dict[str, Any] | None:
    if found is None:
        return None
    best = found.candidates[0]
    return plain(
        {
            "discriminates_between": list(found.rivals), "reason": found.reason, "description": best.description, "kind": best.kind,
            "strength": best.strength, "samples": len(found.record.drive), "sample_time": found.record.sample_time,
            "separation_now": found.before, "separation_after": found.after, "settles": found.settles,
            "candidates": list(found.candidates),
        }
    )  # fmt: skip
