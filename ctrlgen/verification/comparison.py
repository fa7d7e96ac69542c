"""Compares the generated C with the model: builds it strictly, runs it, reports where it first differs.

Every compiler present builds every arithmetic. Three references: the controller evaluated by CasADi
(`ctrlgen.controller.feedforward`), IPOPT's solution of the scenario, and the model simulated forward with the
drives that the C computed.
"""

from __future__ import annotations

import tempfile
from collections import defaultdict
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from ctrlgen.core.tabular import Column, Tabular
from ctrlgen.firmware.c.real import Arithmetic, Integers
from ctrlgen.firmware.c.toolchains import COMPILERS, find_compilers
from ctrlgen.firmware.folder import CFolder, write_harness
from ctrlgen.trajectory.solution import Solution
from ctrlgen.verification.compared_program import ComparedProgram
from ctrlgen.verification.comparison_entry import ComparisonEntry
from ctrlgen.verification.host import TEST_LEVEL, HostBuild, build_host
from ctrlgen.verification.integer_comparison import IntegerAnswers, integer_rows
from ctrlgen.verification.online_comparison import online_rows
from ctrlgen.verification.player_comparison import player_rows
from ctrlgen.verification.reference import ReferenceAnswers


@dataclass(frozen=True, repr=False)
class Comparison(Tabular):
    """All rows; `compilers`: name -> version line; `missing`: compilers that were not found."""

    rows: tuple[ComparisonEntry, ...]
    compilers: dict[str, str]
    missing: tuple[str, ...]

    def facts(self) -> dict[str, object]:
        """What it is, in a few words."""
        return {
            "passed": self.passed,
            "rows": len(self.rows),
            "compilers": ", ".join(self.compilers) or "none",
            "missing": ", ".join(self.missing) or "none",
        }

    def columns(self) -> tuple[Column, ...]:
        """A row a comparison; deviations in the `unit` of the row."""
        names = ("what", "signal", "worst", "rms", "limit", "unit", "samples", "passed")
        builds = Column("build", "", [str(row.build) for row in self.rows])
        return (builds, *(Column(name, "", [_plain(getattr(row, name)) for row in self.rows]) for name in names))

    @property
    def passed(self) -> bool:
        """Whether something ran and everything that ran is within its limit."""
        return bool(self.rows) and all(row.passed for row in self.rows)

    @property
    def worst(self) -> tuple[ComparisonEntry, ...]:
        """Of each arithmetic, comparison and signal the worst build: a table short enough to read."""
        groups: dict[tuple[Arithmetic, str, str, str], list[ComparisonEntry]] = defaultdict(list)
        for row in self.rows:
            groups[(row.build.real, row.what, row.signal, row.unit)].append(row)
        return tuple(max(rows, key=lambda row: (not row.passed, row.worst)) for rows in groups.values())


def _plain(value: object) -> object:
    return str(value) if isinstance(value, str) else value


def compare(
    folder: CFolder,
    solution: Solution,
    progress: Callable[[str], None] = lambda _: None,
    reference: ReferenceAnswers | None = None,
    test_level: str = TEST_LEVEL,
) -> Comparison:
    """Builds and runs `folder` with every compiler found; `reference`: where it was computed before; `test_level` as of `build_host`.

    Raises ToolError when a build or a run fails.
    """
    compilers = find_compilers()
    builds = [HostBuild(compiler, real) for compiler in compilers for real in folder.arithmetics]
    with tempfile.TemporaryDirectory(prefix="ctrlgen-") as scratch, ThreadPoolExecutor(max_workers=2) as pool:
        for real in folder.arithmetics:
            write_harness(folder, solution.scenario, solution.model, real, Path(scratch) / f"harness_{real.suffix}.c")
        programs = [pool.submit(build_host, build, folder, Path(scratch), test_level) for build in builds]
        reference = reference or ReferenceAnswers(solution)  # while the compilers work
        integers = IntegerAnswers(reference)
        rows: list[ComparisonEntry] = []
        for build, path in zip(builds, programs, strict=True):
            program = ComparedProgram(build, path.result(), reference)
            if isinstance(build.real, Integers):
                rows += integer_rows(program, integers)
            else:
                rows += online_rows(program)
                if (compression := folder.compression.get(build.real)) is not None:
                    rows += player_rows(program, compression)
            progress(str(build))
    return Comparison(tuple(rows), compilers, tuple(c for c in COMPILERS if c not in compilers))
