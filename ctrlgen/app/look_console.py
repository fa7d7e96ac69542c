"""What `ctrlgen look` says of measurement files, and the recording.toml that it writes."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.markup import escape

from ctrlgen.app.console import out, show_table, table_of
from ctrlgen.app.editor_schemas import schema_line
from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.files import write_text
from ctrlgen.devices import load_device
from ctrlgen.model.assembly import build_model
from ctrlgen.recordings.formats import READERS, read_table
from ctrlgen.recordings.formats.layout_question import AmbiguousFile
from ctrlgen.recordings.look.answers import NOTHING, Answers, layout_option
from ctrlgen.recordings.look.column_facts import ColumnFacts, TableFacts, rests, table_facts
from ctrlgen.recordings.look.oddities import table_oddities
from ctrlgen.recordings.look.proposal import Proposal, propose
from ctrlgen.recordings.look.proposed_file import MOST_LEFT, recording_toml
from ctrlgen.reporting.numbers import number

MOST_GAPS = 3  # that are listed
MOST_COLUMNS = 40  # of a table that are listed


def look(
    files: Sequence[Path], device: Path | None, to: Path | None, figure: Path | None, answers: Answers = NOTHING
) -> None:
    """Prints what the files hold; with a `device` also which column is which signal, written as recording.toml to `to` or printed.
    `answers` say what the files leave open.

    Raises InputError where a file cannot be read, and where `to` exists.
    """
    if to is not None and to.exists():
        raise InputError("--to", [Fault(str(to), "exists; name another file, or move it away")])
    tables = [_read(file, answers) for file in files]
    for facts in tables:
        print_table(facts)
    if figure is not None:
        from ctrlgen.recordings.look.columns_drawn import draw_columns  # matplotlib takes a moment to import

        draw_columns(tables, figure)
        out.print(str(figure), soft_wrap=True, markup=False)
    if device is None:
        return
    proposal = propose(tables, build_model(load_device(device)), answers)
    folder = files[0].parent if to is None else to.parent
    text = recording_toml(proposal, folder, files[0].stem)
    if to is None:
        out.print("recording.toml to begin with:\n", markup=False)
        out.print(text, markup=False, soft_wrap=True)
    else:
        write_text(to, schema_line("recording", to) + text)
        print_proposal(proposal)
        out.print(str(to), soft_wrap=True, markup=False)
        out.print(
            f"next:  {shlex.join(['ctrlgen', 'check', str(to), '--device', str(device)])}", soft_wrap=True, markup=False
        )


def described(paths: Sequence[Path], device: Path) -> list[Path]:
    """`paths`, with measurement files among them replaced by a recording.toml that is written beside the first of them, and told.

    Raises InputError with the questions that the files leave open; nothing is written then.
    """
    files = [path for path in paths if path.is_file() and path.suffix.lower() in READERS]
    if not files:
        return list(paths)
    written = files[0].with_name(f"{files[0].stem}.recording.toml")
    look_at = shlex.join(["ctrlgen", "look", *map(str, files), "--device", str(device), "--to", str(written)])
    tables = [_read(file, NOTHING, look_at) for file in files]
    proposal = propose(tables, build_model(load_device(device)))
    if not proposal.certain:
        what = f"the file does not say everything; {look_at} writes a recording.toml with what it says, to complete"
        raise InputError(
            files[0], [*(Fault("to be answered", question) for question in proposal.asked), Fault("then", what)]
        )
    if written.exists():
        what = f"describes this file already: name it instead of {files[0].name}, or move it away"
        raise InputError(files[0], [Fault(str(written), what)])
    write_text(written, recording_toml(proposal, written.parent, files[0].stem))
    for match in proposal.matches:
        out.print(f"read: {match.signal} is column {match.column!r} [{match.unit}]", markup=False, soft_wrap=True)
    print_proposal(proposal)
    out.print(f"read as {written} says: correct it where it is wrong", markup=False, soft_wrap=True)
    return [written, *(path for path in paths if path not in files)]


def _read(file: Path, answers: Answers, look_at: str = "") -> TableFacts:
    """What a file holds, with questions about how it is written as the options of look that answer them; where the command is another
    one, followed by `look_at`."""
    try:
        return table_facts(read_table(file, answers.table, answers.layout), answers)
    except AmbiguousFile as error:
        faults = [Fault(file.name, error.question.asked(layout_option))]
        if look_at and error.question.answers:
            faults.append(Fault("then", f"{look_at} and that option write a recording.toml of it"))
        raise InputError(file, faults) from None


def print_proposal(proposal: Proposal) -> None:
    """What is asked, assumed, not used, and what is odd, one line each."""
    for question in proposal.asked:
        out.print(f"to be answered: {question}", markup=False, soft_wrap=True)
    for name, (of, order) in proposal.derived.items():
        what = "its integral" if order < 0 else f"its derivative {order}" if order > 1 else "its slope"
        out.print(f"assumed: {name} is not recorded and taken from {of}: {what}", markup=False, soft_wrap=True)
    if proposal.ambient is not None:
        out.print(
            f"assumed: {proposal.ambient} is the temperature of what surrounds the device", markup=False, soft_wrap=True
        )
    if proposal.left:
        more = len(proposal.left) - MOST_LEFT
        unused = [*proposal.left[:MOST_LEFT], *([f"{more} more"] if more > 0 else [])]
        out.print(f"not used: {', '.join(unused)}", markup=False, soft_wrap=True)
    for remark in proposal.remarks:
        out.print(f"odd: {remark}", markup=False, soft_wrap=True)


def print_table(facts: TableFacts) -> None:
    """One table: its rows and rate, its columns, what was interpreted, what is odd."""
    out.print(f"[bold]{escape(str(facts.table.path))}[/bold]: {escape(_length(facts))}", soft_wrap=True)
    shown = table_of(("column", "left"), ("unit", "left"), ("smallest", "right"), ("largest", "right"), ("", "left"))
    for column in facts.columns[:MOST_COLUMNS]:
        shown.add_row(escape(column.name), escape(column.unit or "not stated"), *_numbers(facts, column))
    show_table(shown)
    if more := facts.columns[MOST_COLUMNS:]:
        told = f"  and {number_of(len(more), 'more column')}, {more[0].name} to {more[-1].name}"
        out.print(told, markup=False, soft_wrap=True)
    of_time, time = ((), "") if facts.time is None else (facts.time.notes, facts.time.column)
    of_columns = (note for c in facts.columns if c.name != time for note in c.notes)
    for note in dict.fromkeys((*facts.table.notes, *of_time, *of_columns)):
        out.print(f"  read: {note}", markup=False, soft_wrap=True)
    for question in (c.question for c in facts.columns if c.question is not None):
        out.print(f"  to be answered: {question.asked(layout_option)}", markup=False, soft_wrap=True)
    for odd in table_oddities(facts):
        out.print(f"  odd: {odd}", markup=False, soft_wrap=True)


def _length(facts: TableFacts) -> str:
    if facts.time is None and (step := facts.clock_step):
        return f"{number_of(facts.rows, 'row')}, {number(1 / step)} Hz, {number(facts.rows * step)} s, as the file states of its channels"
    if facts.time is None:
        why = f"the time {facts.falls!r} falls: newest row first" if facts.falls else "no column is a time"
        return f"{number_of(facts.rows, 'row')}, {why}"
    step, gaps = facts.time.step, facts.time.gaps
    lasts = (facts.rows + sum(missing for _, missing in gaps)) * step
    said = f"{number_of(facts.rows, 'row')}, {number(1 / step)} Hz, {number(lasts)} s"
    if gaps:
        listed = ", ".join(f"{missing} after row {row}" for row, missing in gaps[:MOST_GAPS])
        more = f" and {number_of(len(gaps) - MOST_GAPS, 'more gap')}" if len(gaps) > MOST_GAPS else ""
        said += f"; rows are missing: {listed}{more}"
    return said


def _numbers(facts: TableFacts, column: ColumnFacts) -> tuple[str, str, str]:
    if facts.time is not None and column.name == facts.time.column:
        return "", "", "time" + (" (dates)" if facts.time.stamps else "")
    if column.values is None:
        return "", "", "text" if column.question is None else "to be answered"
    if not len(column.finite):
        return "", "", "no number"
    said = [f"{column.missing} missing"] if column.missing else []
    still = sum(b - a for a, b in rests(np.nan_to_num(column.values)[:, None]))
    said += (
        ["constant"]
        if not column.moves
        else [f"rests in {100 * still / facts.rows:.0f} % of the rows"]
        if still
        else []
    )
    return number(float(column.finite.min())), number(float(column.finite.max())), ", ".join(said)
