"""Console output of recordings and of their diagnoses, one or many."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.markup import escape

from ctrlgen.app.console import Column, out, show_table, table_of

if TYPE_CHECKING:
    from rich.table import Table

    from ctrlgen.app.batch_row import BatchRow
    from ctrlgen.diagnosis.evidence.bootstrap import Bootstrap
    from ctrlgen.diagnosis.evidence.diagnosis_result import Diagnosis
    from ctrlgen.diagnosis.selection.findings import Finding
    from ctrlgen.recordings.recording import Recording


def print_recording(recording: Recording) -> None:
    """The validated records, with the number of samples marked not valid, and the notes."""
    out.print(f"{recording.title}: {', '.join(recording.channels)}", markup=False, soft_wrap=True)
    table = table_of(("record", "left"), ("role", "left"), ("samples", "right"), ("marked", "right"))
    for record in recording.records:
        marked = int((~record.valid).sum())
        table.add_row(escape(record.name), record.role, str(len(record.time)), f"{marked} of {record.valid.size}")
    show_table(table)
    for note in recording.notes:
        out.print(f"note: {note}", markup=False, soft_wrap=True)


def print_diagnosis(diagnosis: Diagnosis) -> None:
    """The verdict, the findings and the held-out errors of a diagnosis."""
    from ctrlgen.diagnosis.report.answer import answer, notes_of
    from ctrlgen.diagnosis.report.narrative import gathered, next_steps
    from ctrlgen.diagnosis.report.shares_sentences import shares_sentences
    from ctrlgen.reporting.numbers import number

    for line in answer(diagnosis):
        out.print(f"[bold]{escape(line)}[/bold]", soft_wrap=True)
    for line in shares_sentences(diagnosis):
        out.print(line, markup=False, soft_wrap=True)
    if diagnosis.findings:
        show_table(findings_table(diagnosis.findings))
    table = table_of(
        ("held out", "left"), ("before", "right"), ("after", "right"), ("noise", "right"), ("parameters", "right")
    )
    for channel, e in diagnosis.held_out.items():
        values = (e.rms_before, e.rms_after, e.noise_floor, e.uncertainty)
        table.add_row(channel, *("not known" if v is None else f"{number(v)} {e.unit}" for v in values))
    show_table(table)
    for note in gathered(notes_of(diagnosis)):
        out.print(f"note: {note}", markup=False, soft_wrap=True)
    for step in next_steps(diagnosis):
        out.print(f"next: {step}", markup=False, soft_wrap=True)


def findings_table(findings: Sequence[Finding]) -> Table:
    """A row a parameter of each finding, its estimate and interval on one line."""
    from ctrlgen.diagnosis.report.luck_sentences import chance_text
    from ctrlgen.diagnosis.report.narrative import interval, share_text
    from ctrlgen.diagnosis.selection.cause_entry import cause_name

    estimate = "estimate, 95 % interval"
    table = table_of(
        ("found", "left"),
        ("at", "left"),
        ("share", "left"),
        ("by luck", "right"),
        ("parameter", "left"),
        (estimate, "left"),
    )
    table.columns[5].no_wrap = True
    for finding in findings:
        rows = [(name, interval(e, name)) for name, e in finding.numbers]
        alike = ", ".join(map(cause_name, finding.alternatives))
        told = (finding.effect, finding.location, share_text(finding), chance_text(finding))
        for k, (name, text) in enumerate(rows):
            first = told if k == 0 else ("",) * len(told)
            table.add_row(*first, name, text, escape(f"or {alike}") if alike and k == 0 else "")
    return table


def print_explanation(diagnosis: Diagnosis, law: str) -> None:
    """Where one law was tried, what it reached and why it was not taken."""
    from ctrlgen.diagnosis.report.explain import explain

    for line in explain(diagnosis, law):
        out.print(line, markup=False, soft_wrap=True)


def print_bootstrap(bootstrap: Bootstrap) -> None:
    """The percentile interval of each number, and how often a finding vanished."""
    from ctrlgen.diagnosis.report.narrative import interval

    out.print(f"bootstrap: {bootstrap.replicates} replicates; {bootstrap.note}", markup=False, soft_wrap=True)
    table = table_of(("number", "left"), ("95 % of the replicates", "left"))
    for path, estimate in bootstrap.values.items():
        table.add_row(escape(path), interval(estimate))
    show_table(table)
    for line in bootstrap.sentences():
        out.print(line, markup=False, soft_wrap=True)


def print_batch(rows: Sequence[BatchRow]) -> None:
    """One line per diagnosis, then the failures with their reasons."""
    from ctrlgen.reporting.numbers import number

    errors: tuple[Column, ...] = (("before", "right"), ("after", "right"), ("noise", "right"))
    table = table_of(("result", "left"), ("verdict", "left"), ("found", "left"), *errors)
    for row in rows:
        if row.state == "failed":
            table.add_row(escape(row.name), "[red]failed[/red]")
            continue
        known = ["not known" if v is None else f"{number(v)} {row.unit}" for v in (row.before, row.after, row.noise)]
        table.add_row(escape(row.name), row.verdict, escape(row.findings) or "-", *known)
    show_table(table)
    for row in rows:
        if row.error:
            out.print(f"{row.name}: {row.error}", style="red", markup=False, soft_wrap=True)
        if row.warning:
            out.print(f"{row.name}: {row.warning}", style="yellow", markup=False, soft_wrap=True)
    made, kept, failed = (sum(row.state == state for row in rows) for state in ("done", "done before", "failed"))
    out.print(f"{made} diagnosed, {kept} there already, {failed} failed")
