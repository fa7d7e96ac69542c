"""The search round by round as a table, and what was not taken although it scored better, for the page and the console."""

from __future__ import annotations

from typing import Any

import numpy as np

from ctrlgen.diagnosis.selection.candidate_model import CandidateModel, Refusal
from ctrlgen.diagnosis.selection.cause_entry import cause_name
from ctrlgen.diagnosis.selection.not_taken import better_than_their_round
from ctrlgen.diagnosis.selection.search_history import (
    NumberEntry,
    held_out_error,
    not_taken_entry,
    search_history,
)
from ctrlgen.diagnosis.selection.search_result import SearchResult
from ctrlgen.reporting.numbers import number, with_unit


def history_rows(search: SearchResult) -> list[dict[str, str]]:
    """A row for the model before each round, for each model that it fitted, and for what was decided."""
    rows = []
    for entry, round_ in zip(search_history(search), search.rounds, strict=True):
        beside = " and ".join(map(cause_name, round_.before.causes)) or "the device as described"
        rows.append(_row(str(entry.round), beside, "", 0.0, entry.before.held_out_error, "before the round"))
        for tried, model in zip(entry.candidates, round_.candidates, strict=True):
            added = "+ " + " and ".join(cause_name(c) for c in model.causes if c not in round_.before.causes)
            scores = ", ".join(number(abs(c.z), 3) for c in tried.causes if c.z is not None)
            better = (entry.before.criterion or 0.0) - (tried.criterion or 0.0)
            rows.append(_row("", added, scores, better, tried.held_out_error, tried.outcome))
        rows.append(_row("", "", "", None, {}, entry.decision))
    return rows


def history_rounds(search: SearchResult) -> list[dict[str, Any]]:
    """The same by rounds: the model before each, its held-out error, the rows of what was tried, what was decided."""
    rounds: list[dict[str, Any]] = []
    for row in history_rows(search):
        if row["round"]:
            rounds.append({"round": row["round"], "before": row["model"], "held_out": row["held_out"], "rows": []})
        elif row["model"]:
            rounds[-1]["rows"].append(row)
        else:
            rounds[-1]["decision"] = row["outcome"]
    return rounds


def _row(
    round_: str, model: str, scores: str, better: float | None, errors: dict[str, NumberEntry], outcome: str
) -> dict[str, str]:
    return {
        "round": round_,
        "model": model,
        "z": scores,
        "better": "" if better is None else number(better, 4),
        "held_out": errors_text(errors),
        "outcome": outcome,
    }


def errors_text(errors: dict[str, NumberEntry]) -> str:
    """'x 12.4 nm, y 3.1 nm'; without the name where there is one channel."""
    names = {c: "" if len(errors) == 1 else f"{c.removeprefix('reading.')} " for c in errors}
    return ", ".join(
        f"{names[c]}{number(e.value, 3) if e.value is not None else '-'} {e.unit}" for c, e in errors.items()
    )


def not_taken_rows(search: SearchResult) -> list[dict[str, str]]:
    """What scored better than what its round took, that which would gain most beside the answer first."""
    return [
        {
            "cause": " and ".join(map(cause_name, refusal.causes)) + dropped_beside(search, refusal),
            "numbers": _numbers(search, refusal),
            "better": number(refusal.gain, 4),
            "held_out": errors_text(held_out_error(search, refusal.candidate)),
            "reason": "; ".join(dict.fromkeys(refusal.reasons)),
        }
        for _, refusal in better_than_their_round(search)
    ]


def dropped_beside(search: SearchResult, refusal: Refusal) -> str:
    """' beside drift at sensor:axis', the causes that were there when others were refused, and that the answer does not have: without them
    those would leave another error."""
    beside = (c for c in refusal.candidate.causes if c not in (*refusal.causes, *search.chosen.causes))
    names = " and ".join(dict.fromkeys(map(cause_name, beside)))
    return f" beside {names}" if names else ""


def _numbers(search: SearchResult, refusal: Refusal) -> str:
    shown = not_taken_entry(search, refusal).numbers
    return ", ".join(f"{name.partition('.')[2]} = {quantity(e)}" for name, e in shown.items())


def quantity(e: NumberEntry) -> str:
    """'4.1 um'."""
    return f"- {e.unit}".removesuffix(" 1") if e.value is None else with_unit(e.value, e.unit)


def most_gained(search: SearchResult, candidate: CandidateModel) -> tuple[str, NumberEntry, NumberEntry] | None:
    """The channel in which a model leaves less of the held-out records than the answer does, most so beside the noise, with its error
    there and that of the answer; None where it leaves less of none, as it may where its numbers alone are likelier."""
    less = search.chosen.predicted.plain_mean - candidate.predicted.plain_mean
    channel = search.fitter.recording.channels[int(np.nan_to_num(less, nan=-np.inf).argmax())]
    would, now = (held_out_error(search, model)[channel] for model in (candidate, search.chosen))
    known = would.value is not None and now.value is not None
    return (channel, would, now) if known and would.value < now.value and quantity(would) != quantity(now) else None
