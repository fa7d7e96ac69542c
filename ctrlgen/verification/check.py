"""The result of a tool's check of the generated C, or the reason why it did not run."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from pydantic import Field

from ctrlgen.firmware.c.real import Arithmetic
from ctrlgen.reporting.result_file import Keys

PATIENCE = 900.0  # s; a tool that takes longer is stopped
LEFT_OUT = "left out by --quick; call without it"


class CheckState(StrEnum):
    """The outcome of a check."""

    PASSED = "passed"
    FAILED = "failed"
    NOT_RUN = "not run"


class ToolFinding(Keys):
    """One finding of an analyser."""

    file: str = Field(description="The generated file.")
    line: int = Field(description="Its line.")
    rule: str = Field(description="The analyser's name of the rule.")
    severity: str = Field(description="The analyser's word for how grave it is.")
    text: str = Field(description="The analyser's message.")
    permitted: bool = Field(description="Whether DEVIATIONS.md permits it.")

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.severity}: {self.text} [{self.rule}]"


def error_in(file: str, line: int, rule: str, text: str) -> ToolFinding:
    """A finding that fails its check."""
    return ToolFinding(file=file, line=line, rule=rule, severity="error", text=text, permitted=False)


@dataclass(frozen=True)
class Check:
    """One tool over the files (name, arithmetic) in `subjects`; `note` has figures, or, when not run, reason and remedy."""

    tool: str
    version: str
    subjects: tuple[tuple[str, Arithmetic], ...]
    state: CheckState
    findings: tuple[ToolFinding, ...] = ()
    note: str = ""

    @property
    def passed(self) -> bool:
        """Whether the tool ran and every finding is permitted."""
        return self.state is CheckState.PASSED

    @property
    def refused(self) -> tuple[ToolFinding, ...]:
        """The findings that fail it."""
        return tuple(f for f in self.findings if not f.permitted)


def finished(
    tool: str, version: str, subjects: Sequence[tuple[str, Arithmetic]], findings: Sequence[ToolFinding], note: str = ""
) -> Check:
    """The check of a tool that ran; it failed where a finding is not permitted."""
    ordered = tuple(sorted(set(findings), key=lambda f: (f.file, f.line, f.rule, f.text)))
    state = CheckState.PASSED if all(f.permitted for f in ordered) else CheckState.FAILED
    return Check(tool, version, tuple(subjects), state, ordered, note)


def not_run(tool: str, subjects: Sequence[tuple[str, Arithmetic]], reason: str, version: str = "") -> Check:
    """A check that did not run; `reason` also says what to do about it."""
    return Check(tool, version, tuple(subjects), CheckState.NOT_RUN, (), reason)


def run_tool(words: Sequence[str], **options: Any) -> subprocess.CompletedProcess[str]:
    """Runs a program and captures its output. Raises KeyboardInterrupt when interrupted, OSError when the program is missing."""
    told: dict[str, Any] = {"capture_output": True, "text": True, "errors": "replace", "timeout": PATIENCE}
    try:
        return subprocess.run(list(words), check=False, start_new_session=True, **told, **options)
    except subprocess.TimeoutExpired:
        return subprocess.CompletedProcess(list(words), 124, "", f"{words[0]} did not end within {PATIENCE:g} s")


def version_of(program: str) -> str | None:
    """The line of `program --version` that names its version; None where the program is missing or broken."""
    if not shutil.which(program):
        return None
    done = run_tool([program, "--version"])
    lines = [line.strip() for line in done.stdout.splitlines() if any(c.isdigit() for c in line)]
    return lines[0] if done.returncode == 0 and lines else None
