"""The answer of a result in one sentence, read from its file: by each kind of result, in the words of that file.

A file may be of another version, damaged or not ours: what cannot be read so gives the text ''.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from ctrlgen.core.counts import number_of
from ctrlgen.reporting.numbers import number

Record = dict[str, Any]
Mood = Literal["ok", "bad", "so"]  # a verdict that is good, bad, or neither

BATCH = "batch.json"  # of `ctrlgen batch`: what it has done so far
GENERATED = "generated C"


@dataclass(frozen=True)
class ResultKind:
    """A kind of result: the `file` by which it is known, its `page`, and how its answer is read: verdict, mood, sentence."""

    name: str
    file: str
    page: str
    answer: Callable[[Record], tuple[str, Mood, str]]


def answer_of(kind: ResultKind, record: Record) -> tuple[str, Mood, str]:
    """Verdict, mood and sentence of a result file; empty where the file does not hold them."""
    try:
        verdict, mood, sentence = kind.answer(record)
    except (KeyError, IndexError, StopIteration, TypeError, ValueError, AttributeError, OverflowError):
        return "", "so", ""
    return str(verdict), mood, str(sentence)


def _run(record: Record) -> tuple[str, Mood, str]:
    held = record["passed"] is True
    tight = next((m for m in record["margins"] if m["limit"] == record["tightest"]), None)
    told = [number_of(record["samples"], "sample")]
    if tight is not None and tight["share_left"] is not None:
        told.append(f"of the tightest limit, {tight['label']}, {100 * tight['share_left']:.3g} % are left")
    rows = record["comparison"]
    if rows:
        told.append(
            f"the C agrees with the model in {sum(r['passed'] is True for r in rows)} of {number_of(len(rows), 'comparison')}"
        )
    wrong = [e["value"] for e in record["expected"] if e["passed"] is not True]
    if wrong:
        told.append(f"not as expected: {', '.join(map(str, wrong))}")
    return ("within tolerance" if held else "out of tolerance"), ("ok" if held else "bad"), f"{'; '.join(told)}."


def _build(record: Record) -> tuple[str, Mood, str]:
    verdict, mood, sentence = _run(record)
    left = len(record["not_run"])
    return verdict, mood, sentence if not left else f"{sentence} Checks that did not run: {left}."


def _diagnosis(record: Record) -> tuple[str, Mood, str]:
    moods: dict[str, Mood] = {"consistent": "ok", "explained": "ok", "unexplained": "bad"}
    return record["verdict"], moods.get(record["verdict"], "so"), record["sentence"]


def _budget(record: Record) -> tuple[str, Mood, str]:
    bands = ", ".join(f"± {g['band95']:.4g} {g['unit']} ({g['name']})" for g in record["groups"])
    most = f", most by {record['contributors'][0]['name']}" if record["contributors"] else ""
    kept = all(limit["kept"] is True for limit in record["limits"])
    verdict = "limits kept" if kept else "limits at risk"
    return verdict, "ok" if kept else "so", f"What is not known exactly moves the pose within {bands} (95 %){most}."


def _fastest(record: Record) -> tuple[str, Mood, str]:
    fastest, stated = record["times"]["fastest"], record["times"]["stated"]
    beside = "" if stated is None else f" instead of {number(1e3 * stated)} ms"
    return "fastest", "ok", f"The path takes {number(1e3 * fastest)} ms{beside}."


def _learning(record: Record) -> tuple[str, Mood, str]:
    errors = next(run for run in record["runs"] if run["best"])["errors"]
    units = {group["name"]: group["unit"] for group in record["groups"]}
    left = ", ".join(f"{number(e['repeating'])} {units[e['group']]} ({e['group']})" for e in errors)
    stop = record["stop"]
    return (
        ("learnt" if stop else "goes on"),
        "ok" if stop else "so",
        stop or f"What repeats of the error in the best run: {left}.",
    )


def _constants(record: Record) -> tuple[str, Mood, str]:
    return (
        "calibrated",
        "ok",
        f"{number_of(len(record['constants']), 'constant')} of {record['device']} from {record['recording']}.",
    )


def _workspace(record: Record) -> tuple[str, Mood, str]:
    spans = [f"{channel} {number(low)} … {number(high)}" for channel, (low, high) in record["anywhere"].items()]
    return "mapped", "ok", f"Reach of {record['device']}: {', '.join(spans)}."


def _batch(record: Record) -> tuple[str, Mood, str]:
    done, total, failed = record["done"], record["total"], record["failed"]
    verdicts = ", ".join(f"{count} {verdict}" for verdict, count in record["verdicts"].items())
    sentence = f"{done} of {number_of(total, 'diagnosis', 'diagnoses')} done{': ' if verdicts else ''}{verdicts}; {failed} failed."
    return ("done" if done == total else "unfinished"), "bad" if failed else "ok" if done == total else "so", sentence


def _generated(record: Record) -> tuple[str, Mood, str]:
    return "generated", "ok", f"{number_of(len(record['files']), 'file')} of {record['name']}."


KINDS = (  # the first that a folder has is what the folder is
    ResultKind("verification", "build.json", "build.html", _build),
    ResultKind("run", "summary.json", "report.html", _run),
    ResultKind("diagnosis", "diagnosis.json", "report.html", _diagnosis),
    ResultKind("budget", "budget.json", "budget.html", _budget),
    ResultKind("fastest motion", "fastest.json", "fastest.html", _fastest),
    ResultKind("learning", "learning.json", "learning.html", _learning),
    ResultKind("calibration", "constants.json", "calibration.html", _constants),
    ResultKind("workspace", "workspace.json", "workspace.html", _workspace),
    ResultKind("batch", BATCH, "batch.html", _batch),
    ResultKind(GENERATED, "manifest.json", "README.md", _generated),
)
