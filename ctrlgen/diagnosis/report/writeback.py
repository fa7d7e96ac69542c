"""device.next.toml: the device file as its author wrote it, with the findings written in.

Parameters change in place and keep their comments; each states the source of its new value and its old value. Effects are
appended under a comment with the recording, the verdict and the held-out errors, those that run on the clock of the records as
[[recording_effect]]. The file gives the model that the chosen fit predicts with, and beside it the empirical terms, whose own errors the
comment tells.
"""

from __future__ import annotations

import os
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.items import AoT

from ctrlgen.core.edited_toml import (
    DIGITS,
    inline_table,
    replace_quantity,
    sd_text,
    toml_text,
    value_text,
    with_moved_files,
)
from ctrlgen.core.files import read_text, write_text
from ctrlgen.core.units import from_si, to_si
from ctrlgen.devices.python_file import as_toml
from ctrlgen.diagnosis.evidence.diagnosis_result import Diagnosis
from ctrlgen.diagnosis.report.answer import sentence
from ctrlgen.diagnosis.report.narrative import (
    BETTER,
    HARD_SPACE,
    WORSE,
    channel_sentence,
    contradicted,
    empirical_sentences,
    hard,
    predicts_better,
)
from ctrlgen.diagnosis.report.on_the_clock import used_for_another_run
from ctrlgen.diagnosis.selection.verdict import Verdict, contradicts_datasheet
from ctrlgen.estimation.free_parameters import FreeParameter
from ctrlgen.estimation.hypothesis import PARAMETER, numbers
from ctrlgen.version import program

WIDTH = 110
RECORDING_EFFECT = "recording_effect"
# relative change below which a parameter is left as it is
MOVED = 1e-12


def write_next(diagnosis: Diagnosis, original: Path, target: Path) -> None:
    """Writes `target`, as a whole or not at all, from the device file `original`. Raises InputError where that cannot be read.

    Of a device made by a Python file the target names that file and states all its numbers.
    """
    python = original.suffix == ".py"
    text = as_toml(diagnosis.device, os.path.relpath(original, target.parent)) if python else read_text(original)
    text = text if python else with_moved_files(text, diagnosis.device.names_files, original, target)
    write_text(target, next_text(diagnosis, text))


def next_text(diagnosis: Diagnosis, original: str) -> str:
    """The text of the device file `original` with the findings in it."""
    fit = diagnosis.search.chosen.fit
    estimates = list(zip(fit.structure.free_parameters, fit.theta, diagnosis.search.deviations(), strict=True))
    document = tomlkit.parse(original)
    changed = _change_numbers(document, diagnosis, estimates)
    of_device, of_recording = _effects(diagnosis, estimates)
    tables = _appended(document, "effect", of_device) + _appended(document, RECORDING_EFFECT, of_recording)
    text = document.as_string().rstrip("\n") + "\n"
    if changed or tables or diagnosis.findings or diagnosis.empirical_terms:
        text += "\n" + _header(diagnosis, changed)
    return text + tables


def _appended(document: Any, key: str, tables: Sequence[dict[str, Any]]) -> str:
    """The text to append to the document for its list `key` to go on with the `tables`; empty where they were put into its own list."""
    if key not in document or isinstance(document[key], AoT):
        return "".join(_table(key, fields) for fields in tables)
    # effect = [{ ... }] in one line cannot be continued by [[effect]]
    for fields in tables:
        document[key].append(inline_table(fields))
    return ""


def _change_numbers(
    document: Any, diagnosis: Diagnosis, estimates: Sequence[tuple[FreeParameter, float, float]]
) -> list[str]:
    """Writes the changed parameters of the device into the document; returns their paths."""
    known = {path: number for path, _, number in numbers(diagnosis.device)}
    causes, changed = diagnosis.search.chosen.fit.structure.causes, []
    for unknown, value, sd in estimates:
        cause = None if unknown.cause is None else causes[unknown.cause]
        of_device = cause is None or cause.effect == PARAMETER
        if not of_device or abs(value - unknown.nominal) <= MOVED * abs(unknown.nominal):
            continue
        word = "refitted to" if cause is None else "diagnosed from"
        old = known[unknown.path]
        was = f"was {old.text}" + (f", {old.source}" if old.source else "")
        fields = {"value": value_text(value, unknown.unit), "sd": sd_text(sd, unknown.unit)}
        fields["source"] = f"{word} {diagnosis.recording.title}; {was}"
        replace_quantity(document, unknown.path, {k: v for k, v in fields.items() if v})
        changed.append(unknown.path)
    return changed


def _effects(
    diagnosis: Diagnosis, estimates: Sequence[tuple[FreeParameter, float, float]]
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """One table for each effect found, parameters as {value, sd} where the recording determines them: those of the device, and those that
    run on the clock of the records."""
    fitted = {unknown.path: (unknown, value, sd) for unknown, value, sd in estimates}
    of_device, of_recording = [], []
    for k, effect in enumerate(diagnosis.corrected.effect):
        if k < len(diagnosis.device.effect):
            continue
        table: dict[str, Any] = dict(effect.placed())
        for name, number in effect.values.items():
            table[name] = number.text
            if (path := f"effect[{k}].{name}") in fitted:
                unknown, value, sd = fitted[path]
                shown, spread = _within(value, unknown), sd_text(sd, unknown.unit)
                table[name] = {"value": shown, "sd": spread} if spread else shown
        if effect.runs_on_the_clock():
            of_recording.append({"recording": diagnosis.recording.title, **table})
        else:
            of_device.append(table)
    return of_device, of_recording


def _table(name: str, fields: dict[str, Any]) -> str:
    """[[effect]], or another `name`, with one line for each key."""
    width = max(map(len, fields))
    return f"\n[[{name}]]\n" + "".join(f"{key:{width}} = {toml_text(value)}\n" for key, value in fields.items())


def _within(si: float, unknown: FreeParameter) -> str:
    """A parameter of an effect as text, with enough digits that rounding does not move it beyond its bounds."""
    for digits in (DIGITS, 17):
        shown = f"{from_si(si, unknown.unit):.{digits}g}"
        if unknown.low <= to_si(float(shown), unknown.unit) <= unknown.high:
            break
    return f"{shown} {'' if unknown.unit == '1' else unknown.unit}".strip()


def _header(diagnosis: Diagnosis, changed: list[str]) -> str:
    """Comment with recording, verdict, findings and held-out errors before and after."""
    lines = [f"Diagnosed from {diagnosis.recording.title!r} by {program()}, verdict {diagnosis.verdict}."]
    lines.append(sentence(diagnosis))
    lines += [channel_sentence(channel, error) for channel, error in diagnosis.held_out.items()]
    lines += empirical_sentences(diagnosis)
    if changed:
        lines.append(f"Parameters changed above: {', '.join(changed)}.")
    if diagnosis.findings:
        far, better = contradicts_datasheet(diagnosis.search.chosen.fit), predicts_better(diagnosis)
        use = used_for_another_run(diagnosis.findings, BETTER) if better else WORSE
        lines.append(contradicted(far) if far else use)
    if diagnosis.verdict == Verdict.UNEXPLAINED:
        lines.append("This does NOT explain the recording: the values are the best fit, not physical parameters.")
    kept = (hard(" ".join(line.split())) for line in lines)
    wrapped = (part for line in kept for part in textwrap.wrap(line, WIDTH, break_long_words=False))
    return "".join(f"# {part}\n" for part in wrapped).replace(HARD_SPACE, " ")
