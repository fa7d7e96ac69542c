"""The recording.toml that a proposal is, with comments where something is assumed."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from ctrlgen.core.escaping import toml
from ctrlgen.core.file_format import FORMAT
from ctrlgen.recordings.derived_drives import written
from ctrlgen.recordings.look.column_facts import NOISE_REST, TableFacts, rests, slow_clock
from ctrlgen.recordings.look.proposal import Proposal
from ctrlgen.recordings.settled_readings import settled

MOST_LEFT = 20
"""Columns that are not used and are listed."""


def recording_toml(proposal: Proposal, folder: Path, title: str) -> str:
    """The text of a recording.toml in `folder`, with comments where something is assumed."""
    lines = [
        "# Begun by ctrlgen look. Lines that end in a comment hold what the files do not say: correct what is wrong.",
        f"format = {FORMAT}",
        f"title  = {toml(title)}",
        f"device = {toml(proposal.model.device.name)}",
        f'kind   = "{proposal.kind}"'
        + ("" if proposal.timed or proposal.tables[0].falls else " # assumed: no column is a time"),
        *([f"layout = {{ {proposal.answers.layout_text} }}"] if proposal.answers.layout_text else []),
        "",
    ]
    several = len(proposal.tables) > 1
    for k, facts in enumerate(proposal.tables):
        last = several and k == len(proposal.tables) - 1
        lines += _record(proposal, facts, folder, "hold_out" if last else "fit")
    lines.append("[columns]")
    for match in proposal.matches:
        why = f" # {'; '.join(match.why)}" if match.why else ""
        lines.append(f'"{match.signal}" = {_column(match.column, match.unit, match.scale)}{why}')
    more = len(proposal.left) - MOST_LEFT
    unused = [*proposal.left[:MOST_LEFT], *([f"{more} more"] if more > 0 else [])]
    lines += [f"# not used: {', '.join(unused)}"] if unused else []
    if proposal.derived:
        lines += [
            "",
            "[derivatives]",
            "# assumed: no column is one of these; state a low_pass above if what they are of is noisy",
        ]
        lines += [f"{toml(name)} = {written(*of)}" for name, of in proposal.derived.items()]
    lines += [f"# to be answered: {question}" for question in proposal.missing]
    lines += [f"# odd: {remark}" for remark in proposal.remarks]
    # names of columns stand in comments, too, where nothing escapes what is not shown
    return "\n".join("".join(c if c.isprintable() else " " for c in line) for line in lines) + "\n"


def _column(name: str, unit: str, scale: float) -> str:
    """A column as recording.toml names it, with the scale of its numbers."""
    return f'{{ column = {toml(name)}, unit = "{unit}"' + (f", scale = {scale:.12g} }}" if scale != 1 else " }")


def _record(proposal: Proposal, facts: TableFacts, folder: Path, role: str) -> list[str]:
    """The [[record]] tables of one file: what moves, and the rests before or after, which give the noise."""
    path = Path(os.path.relpath(facts.table.path.resolve(), folder.resolve())).as_posix()
    head, answers = [f"file = {toml(path)}"], proposal.answers
    if proposal.ambient is not None:
        column = facts.column(proposal.ambient)
        warmth = _column(column.name, column.unit or "degC", column.scale)
        head.append(f"conditions = {{ ambient = {warmth} }} # assumed: the temperature of what surrounds the device")
    if answers.table is not None:
        head.append(f"table = {answers.table if isinstance(answers.table, int) else toml(answers.table)}")
    if proposal.kind == "poses":
        return ["[[record]]", *head, f'role = "{role}"', ""]
    if answers.rate is not None:
        head.append(f"sample_rate = {toml(answers.rate)}")
    elif facts.falls:
        column = facts.column(facts.falls)
        said = "; ".join([*([column.factor] if column.counted else []), "falls: reverse the rows of the file"])
        head.append(f"time = {_column(column.name, column.unit or 's', column.scale)} # {said}")
    elif facts.time is None:
        stated = facts.table.stated_rate
        says = f"{stated[1]:.9g} Hz" if stated is not None else "1 kHz"
        why = f"the file says {stated[0]!r}" if stated is not None else "no column is a time"
        head.append(f'sample_rate = "{says}" # assumed: {why}')
    else:
        column = facts.column(facts.time.column)
        said = f" # {column.factor}" if column.counted else ""
        head.append(f"time = {_column(column.name, facts.time.unit, column.scale)}{said}")
    known = proposal.drives_of(facts)
    if not known:
        return ["[[record]]", *head, f'role = "{role}"', ""]
    head.append(f"between_samples = {proposal.between_samples}")
    n = len(known[0])
    if (every := slow_clock(np.column_stack(known))) > 1:
        head.append(f'gap = "held" # assumed: one row in {every} states what drives; "linear" if it goes on evenly')
    readings = np.column_stack(proposal.readings_of(facts) or [np.zeros(n)])
    ends = [
        (settled(readings, a, b, NOISE_REST), a, b) for a, b in rests(np.column_stack(known)) if (a == 0) != (b == n)
    ]
    still = [(a, b, start) for start, a, b in ends if start is not None]
    begin, end = max((b for a, b, _ in still if a == 0), default=0), min((s for _, b, s in still if b == n), default=n)
    lines = [
        "[[record]]",
        *head,
        f'role = "{role}"',
        *([f"rows = [{begin}, {end}]"] if (begin, end) != (0, n) else []),
        "",
    ]
    for a, b, start in still:
        before = ", after it has settled" if start > a else ""
        lines += [
            f"[[record]] # nothing moves{before}: it gives the noise",
            *head,
            'role = "rest"',
            f"rows = [{start}, {b}]",
            "",
        ]
    return lines
