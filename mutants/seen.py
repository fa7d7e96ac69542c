"""Which tests execute which line, by coverage.py's contexts, one test file at a time; kept until the code or that file changes.

A line that runs at import (a constant, a parameter of a law) belongs to no test: it is seen by the tests that execute a line which
names what it defines (`.name` of what a class defines, in any file), and where there is none, by those that execute anything else
of its file. What a class assigns is seen by both, and by the tests whose parameters name its file; a setting by those that
execute what reads it of its group.
"""

from __future__ import annotations

import ast
import contextlib
import hashlib
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from coverage import CoverageData

CODE = ("ctrlgen/**/*.py", "codegen/templates/**/*", "tests/*.py")
LONGEST = 1800.0  # s that one file of tests may take


@dataclass
class Seen:
    """`by_line` file -> line -> tests; `seconds` of each test that passes; `breadth` how many lines it executes."""

    root: Path
    by_line: dict[str, dict[int, set[str]]] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    breadth: dict[str, int] = field(default_factory=dict)

    def add(self, found: dict) -> None:
        """Adds what one file of tests has shown."""
        for test, seconds in found["seconds"].items():
            self.seconds[test] = seconds
        names = found["tests"]
        for file, lines in found["lines"].items():
            own = self.by_line.setdefault(file, {})
            for line, tests in lines.items():
                here = {names[k] for k in tests} & found["seconds"].keys()
                own.setdefault(int(line), set()).update(here)
                for test in here:
                    self.breadth[test] = self.breadth.get(test, 0) + 1

    def tests(self, file: str, line: int) -> list[str]:
        """The tests that can see the line, most specific and fastest first."""
        first, last = self._statement(file, line)
        lines = self.by_line.get(file, {})
        tests: set[str] = set().union(*(lines.get(k, set()) for k in range(first, last + 1)))
        if tests:
            return self._ranked(tests)
        named = self._ranked(self._through_names(file, first, last))
        if named and not self._assigned(file, first) & self._attributes(file):
            return named
        by_name = self._ranked(self._parametrised(file)) if self._assigned(file, first) & self._attributes(file) else []
        # The tests of a law come first
        return list(dict.fromkeys([*by_name, *self._ranked(set().union(*lines.values())), *named]))

    def _parametrised(self, file: str) -> set[str]:
        """The tests whose parameters name the file: they may read its class without executing a line of it."""
        word = re.compile(rf"\[(?:.*-)?{re.escape(Path(file).stem)}(?:-.*)?\]$")
        return {test for test in self.seconds if word.search(test)}

    def _ranked(self, tests: set[str]) -> list[str]:
        return sorted(tests, key=lambda t: ((self.seconds[t] + 0.01) * self.breadth.get(t, 0), t))

    def _statement(self, file: str, line: int) -> tuple[int, int]:
        """First and last line of the innermost statement; of a compound one, its head."""
        best = (line, line)
        for node in ast.walk(ast.parse((self.root / file).read_text())):
            if isinstance(node, ast.stmt) and node.lineno <= line <= node.end_lineno:
                body = getattr(node, "body", None)
                end = body[0].lineno - 1 if body else node.end_lineno
                if node.lineno <= line <= max(end, node.lineno):
                    best = (node.lineno, max(end, node.lineno))
        return best

    def _assigned(self, file: str, line: int) -> set[str]:
        """The names that the statement assigns."""
        names = set()
        for node in ast.walk(ast.parse((self.root / file).read_text())):
            if isinstance(node, ast.Assign | ast.AnnAssign) and node.lineno <= line <= node.end_lineno:
                targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                names |= {t.id for target in targets for t in ast.walk(target) if isinstance(t, ast.Name)}
        return names

    def _through_names(self, file: str, first: int, last: int) -> set[str]:
        names, inside = self._assigned(file, first), self._attributes(file)
        found: set[str] = set()
        for name in names:
            word = re.compile(rf"\b{re.escape(name)}\b")
            attribute = re.compile(rf"\.{re.escape(name)}\b") if name in inside else None
            setting = self._field(file, first, name)
            own = any(word.search(text) for k, text in enumerate(self._texts[file], 1) if not first <= k <= last)
            for other in [file] if own and name.startswith("_") else self._texts:
                sought = setting or (word if other == file or self._imports(other, file) else attribute)
                for k, text in enumerate(self._texts[other] if sought else (), 1):
                    if sought.search(text) and not (other == file and first <= k <= last):
                        found |= self.by_line.get(other, {}).get(k, set())
        return found

    def _attributes(self, file: str) -> set[str]:
        """Names that a class of the file assigns, which others read without importing it."""
        classes = (n for n in ast.walk(ast.parse((self.root / file).read_text())) if isinstance(n, ast.ClassDef))
        rows = (row for c in classes for row in c.body if isinstance(row, ast.Assign))
        return {t.id for row in rows for t in row.targets if isinstance(t, ast.Name)}

    def _field(self, file: str, line: int, name: str) -> re.Pattern[str] | None:
        """What reads a field of a group of settings, such as NOISE.line_ratio where some module has NOISE = NoiseSettings()."""
        classes = (n for n in ast.walk(ast.parse((self.root / file).read_text())) if isinstance(n, ast.ClassDef))
        group = next((c.name for c in classes if c.lineno <= line <= c.end_lineno), None)
        instance = re.compile(rf"^(\w+) = {group}\(\)")
        owners = {m[1] for texts in self._texts.values() for text in texts if (m := instance.match(text))}
        return re.compile(rf"\b(?:{'|'.join(sorted(owners))})\.{re.escape(name)}\b") if owners else None

    def _imports(self, other: str, file: str) -> bool:
        module = file.removesuffix(".py").replace("/", ".")
        return any(module in text for text in self._texts[other])

    @cached_property
    def _texts(self) -> dict[str, list[str]]:
        return {file: (self.root / file).read_text().splitlines() for file in self.by_line}


def code_hash(root: Path, tests: Path | None = None) -> str:
    """Hash of everything that decides which of the `tests` executes what: the code, what they share, and their own file."""
    digest = hashlib.sha256()
    for path in sorted({p for pattern in CODE for p in root.glob(pattern) if p.is_file()}):
        if not path.name.startswith("test_") or path == tests:
            digest.update(str(path.relative_to(root)).encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def seen(root: Path, tests: Iterable[Path], cache: Path, jobs: int, done: Callable[[], None]) -> Seen:
    """What each file of `tests` executes, from the `cache` where the code is the same; `done` is called after each file."""
    cache.mkdir(parents=True, exist_ok=True)

    def one(path: Path) -> dict:
        kept = cache / f"{path.stem}-{code_hash(root, path)}.json"
        if not kept.exists():
            for old in cache.glob(f"{path.stem}-*.json"):
                old.unlink()
            kept.write_text(json.dumps(_measured(root, path, cache)))
        done()
        return json.loads(kept.read_text())

    whole = Seen(root)
    with ThreadPoolExecutor(jobs) as pool:
        for found in pool.map(one, tests):
            whole.add(found)
    return whole


def _measured(root: Path, path: Path, folder: Path) -> dict:
    """What one file of tests executes, under coverage.

    Tests that fail or are skipped say nothing, nor the long ones where together they take too long.
    """
    data, times = folder / f"{path.stem}.coverage", folder / f"{path.stem}.times"
    environment = os.environ | {"COVERAGE_FILE": str(data), "MUTANTS_TIMES": str(times), "PYTHONPATH": str(root)}
    rows: dict[str, dict] = {}
    data.unlink(missing_ok=True)  # of a run that was stopped
    for marked in ("not long", "long and not exhaustive"):
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-q",
            "-m",
            marked,
            "-p",
            "mutants.timing",
            "-p",
            "no:cacheprovider",
            "-p",
            "no:xdist",
            "--cov=ctrlgen",
            "--cov-append",
            "--cov-context=test",
            "--cov-report=",
            str(path),
        ]
        with contextlib.suppress(subprocess.TimeoutExpired):
            subprocess.run(command, cwd=root, env=environment, capture_output=True, timeout=LONGEST)
        if times.exists():
            rows |= json.loads(times.read_text())
            times.unlink()
    if not (data.exists() and rows):
        return {"seconds": {}, "tests": [], "lines": {}}
    covered = CoverageData(str(data))
    covered.read()
    tests: dict[str, int] = {}
    lines: dict[str, dict[int, list[int]]] = {}
    for file in covered.measured_files():
        own = lines[str(Path(file).relative_to(root))] = {}
        for line, contexts in covered.contexts_by_lineno(file).items():
            names = {c.rpartition("|")[0] for c in contexts if c}
            own[line] = sorted(tests.setdefault(name, len(tests)) for name in names)
    data.unlink()
    return {"seconds": {k: v["seconds"] for k, v in rows.items() if v["passed"]}, "tests": list(tests), "lines": lines}
