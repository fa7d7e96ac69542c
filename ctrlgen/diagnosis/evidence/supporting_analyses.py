"""The evidence beside the verdict: where, what was detectable, how sure the numbers are, what else it could be, what next."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ctrlgen.core.to_json import plain
from ctrlgen.diagnosis.estimation.fit import Fit, Fitter
from ctrlgen.diagnosis.evidence.detectability import detectable
from ctrlgen.diagnosis.evidence.experiment_design import Experiment, next_experiment
from ctrlgen.diagnosis.evidence.experiment_files import files
from ctrlgen.diagnosis.evidence.ltv_linearisation import along
from ctrlgen.diagnosis.evidence.residual_localisation import where
from ctrlgen.diagnosis.evidence.unmodelled_dynamics import unknown
from ctrlgen.diagnosis.selection.candidate_model import Round, Search, Trial

NEXT_DEVICE = "../device.next.toml"  # from the folder of the next experiment


@dataclass(frozen=True, eq=False)
class Evidence:
    """`where`, `detectable`, `next_experiment`, `history` and `extra` (unknown, files of the next experiment)
    as plain numbers and words, in the reader's units."""

    where: dict[str, Any]
    detectable: dict[str, Any]
    next_experiment: dict[str, Any] | None
    history: tuple[dict[str, Any], ...]
    extra: dict[str, Any]


def evidence(fitter: Fitter, search: Search, explained: bool, seed: int = 0) -> Evidence:
    """Everything beside the findings. `explained`: the chosen structure leaves nothing over."""
    recording = fitter.recording
    nominal, chosen = search.nominal.fit, search.chosen.fit
    records = [*fitter.fit_records, *fitter.held_out_records]

    def place(fit: Fit, lefts: list) -> dict[str, Any]:
        return plain(where(lefts, recording.channels, recording.units, seed))

    before = [along(fitter, nominal, record) for record in records]
    after = before if chosen is nominal else [along(fitter, chosen, record) for record in records]
    extra: dict[str, Any] = {"unknown": None, "files": {}}
    if not explained:
        found = vars(unknown(fitter, chosen, after))
        extra["unknown"] = plain(
            {key: value for key, value in found.items() if key != "free"}
        )  # that is sample by sample
    left = place(chosen, after)
    if extra["unknown"]:
        left["unknown"] = {key: extra["unknown"][key] for key in ("said", "empirical")}
    experiment = next_experiment(fitter, search, explained, seed)
    if experiment is not None:
        extra["files"] = files(fitter, chosen, experiment, NEXT_DEVICE)
    return Evidence(
        where={"nominal": place(nominal, before), "left": left},
        detectable=plain(detectable(chosen, search.last, chosen.n)),
        next_experiment=_next(experiment),
        history=history(search),
        extra=extra,
    )


def history(search: Search) -> tuple[dict[str, Any], ...]:
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
                "total_before": float(round_.before.total),
                "tried": [_tried(t, round_, then) for t in round_.trials],
                "kept": [[c.effect, c.location] for c in then.fit.structure.causes],
                "decision": _decision(round_.before, then, bool(round_.trials)),
            }
        )
    return tuple(rows)


def _tried(trial: Trial, round_: Round, then: Trial) -> dict[str, Any]:
    """The causes that one trial added, alone or together."""
    earlier = round_.before.fit.structure.causes
    z = {s.hypothesis: s.z for s in round_.screened.suspects}
    causes = [
        {"effect": c.effect, "location": c.location, "z": z.get(c), "kept": c in then.fit.structure.causes}
        for c in trial.fit.structure.causes
        if c not in earlier
    ]
    return plain({"causes": causes, "total": trial.total, "objective": trial.fit.objective, "held_out": trial.held})


def _decision(before: Trial, then: Trial, tried: bool) -> str:
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
            "separates": list(found.rivals), "why": found.reason, "drive": best.said, "kind": best.kind,
            "strength": best.strength, "samples": len(found.record.drive), "sample_time": found.record.sample_time,
            "separation_now": found.before, "separation_after": found.after, "settles": found.settles,
            "candidates": list(found.candidates),
        }
    )  # fmt: skip
