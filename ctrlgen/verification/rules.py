"""The generated C under static analysis: MISRA C:2012, clang-tidy, gcc's and clang's analyzers.

A tool that is missing, or stops without a word on the C, did not run: it is never counted as passed.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from ctrlgen.firmware.c.deviations import permits
from ctrlgen.firmware.c.misra import CPPCHECK, rule_class
from ctrlgen.firmware.c.real import Arithmetic
from ctrlgen.firmware.folder import CFolder
from ctrlgen.verification.check import LEFT_OUT, Check, ToolFinding, finished, not_run, run_tool, version_of

MISRA = "cppcheck --addon=misra"
AT_ONCE = 2  # tools running side by side
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wdouble-promotion")
TIDY = (
    *("-*", "bugprone-*", "cert-*", "clang-analyzer-*", "misc-*", "performance-*", "portability-*", "readability-*"),
    # what clang-tidy is not asked, and why: x, z, u, i are what the equations call them
    "-readability-identifier-length",
    # the numbers are the device's, printed from its description
    "-readability-magic-numbers",
    # 1.0f, as CMSIS and most C writes it; it hides no digit
    "-readability-uppercase-literal-suffix",
    # low and high, x and z: both are vectors of one type, called in one place
    "-bugprone-easily-swappable-parameters",
    # 2 * i of a loop over a table's rows is below a table's size
    "-bugprone-implicit-widening-of-multiplication-result",
    # a printed kernel is a straight list of assignments, as long as the physics
    "-readability-function-size",
    # it counts each maximum in such a list as a branch
    "-readability-function-cognitive-complexity",
)
GAVE_UP = "analyzer-too-complex"  # gcc then says nothing of what it has not looked at
REMARK = re.compile(
    r"^(?P<file>[^\n:]+):(?P<line>\d+):\d+: (?P<severity>warning|error): (?P<text>.*?)(?: \[(?P<rule>[^\]]+)\])?$", re.M
)


@dataclass(frozen=True)
class Analyzer:
    """A program called once a file: `words` before the file, `after` it; how it is installed."""

    tool: str
    program: str
    words: tuple[str, ...]
    after: tuple[str, ...]
    install: str


# -O0: an optimiser removes what it should find; the rest lets it come to the end of a controller
GCC = (
    *("-fanalyzer", "-fanalyzer-call-summaries", "--param=analyzer-bb-explosion-factor=100"),
    *("--param=analyzer-max-enodes-per-program-point=256", f"-W{GAVE_UP}", *STRICT, "-O0", "-c", "-o", "/dev/null"),
)
CLANG = ("--analyze", "--analyzer-output", "text", "-Xclang", "-analyzer-werror", *STRICT)
TIDILY = ("--quiet", f"--config={{Checks: '{','.join(TIDY)}'}}")
ANALYZERS = (
    Analyzer("clang-tidy", "clang-tidy", TIDILY, ("--", *STRICT), "apt-get install clang-tidy"),
    Analyzer("gcc -fanalyzer", "gcc", GCC, (), "apt-get install gcc"),
    Analyzer("clang --analyze", "clang", CLANG, (), "apt-get install clang"),
)


def check_rules(
    folder: CFolder, progress: Callable[[str], None] = lambda _: None, quick: bool = False
) -> tuple[Check, ...]:
    """One Check a tool over all C of `folder`: controllers, players and tests in every arithmetic; `quick`: not cppcheck."""
    progress(MISRA)
    checks = [not_run(MISRA, _subjects(folder), LEFT_OUT) if quick else _misra(folder)]
    for analyzer in ANALYZERS:
        progress(analyzer.tool)
        checks.append(run_analyzer(analyzer, folder))
    return tuple(checks)


def _files(folder: CFolder) -> list[tuple[Path, Arithmetic]]:
    """Every C file that is compiled, with its arithmetic."""
    return [(path, real) for real in folder.arithmetics for path in (*folder.sources(real), folder.runner(real))]


def _subjects(folder: CFolder) -> list[tuple[str, Arithmetic]]:
    return [(path.name, real) for path, real in _files(folder)]


def _misra(folder: CFolder) -> Check:
    """cppcheck over what may be one program: every arithmetic of the controllers, then each test with its controllers."""
    tool, subjects = MISRA, _subjects(folder)
    version = version_of("cppcheck")
    if version is None:
        return not_run(tool, subjects, "cppcheck is missing; apt-get install cppcheck")
    findings: list[ToolFinding] = []
    with tempfile.TemporaryDirectory(prefix="ctrlgen-") as scratch:  # what one run has analysed the next takes over
        words = [
            *(
                "cppcheck",
                f"-j{AT_ONCE}",
                f"--cppcheck-build-dir={scratch}",
                "--addon=misra",
                "--std=c99",
                "-U__cplusplus",
            ),
            *("--quiet", "--enable=warning,style,performance,portability", "--error-exitcode=0"),
            *("--template={file}\t{line}\t{severity}\t{id}\t{message}", "-I", str(folder.path)),
        ]
        programs = [[path for real in folder.arithmetics for path in folder.sources(real)]]
        programs += [[folder.runner(real), *folder.sources(real)] for real in folder.arithmetics]
        for files in programs:
            done = run_tool([*words, *map(str, files)])
            rows = [line.split("\t", 4) for line in done.stderr.splitlines() if line.count("\t") >= 4]
            broken = [row for row in rows if row[3] in ("internalError", "preprocessorErrorDirective")]
            if done.returncode != 0 or broken:
                words_of_it = (broken[0][4] if broken else done.stdout + done.stderr).strip()[:500]
                return not_run(
                    tool, subjects, f"cppcheck stopped: {words_of_it}; apt-get install --reinstall cppcheck", version
                )
            findings += [_of_cppcheck(*row) for row in rows]
    note = (
        ""
        if version.split()[-1] == CPPCHECK
        else f"DEVIATIONS.md was checked with cppcheck {CPPCHECK}; this version may check other rules"
    )
    return finished(tool, version, subjects, findings, note)


def _of_cppcheck(file: str, line: str, severity: str, rule: str, text: str) -> ToolFinding:
    name, permitted = Path(file).name, False
    if rule.startswith("misra-c2012-"):
        number = rule.removeprefix("misra-c2012-")
        severity, text, permitted = rule_class(number), f"MISRA C:2012 rule {number}", permits(number, name)
    return ToolFinding(file=name, line=int(line), rule=rule, severity=severity, text=text, permitted=permitted)


def run_analyzer(analyzer: Analyzer, folder: CFolder) -> Check:
    """One analyzer over all files, `AT_ONCE` at a time."""
    subjects, version = _subjects(folder), version_of(analyzer.program)
    if version is None:
        return not_run(analyzer.tool, subjects, f"{analyzer.program} is missing; {analyzer.install}")
    files = [path for path, _ in _files(folder)]

    def run(path: Path) -> tuple[list[ToolFinding], str]:
        include = ("-I", str(folder.path))
        words = [analyzer.program, *analyzer.words, *(() if analyzer.after else include), str(path)]
        done = run_tool([*words, *((*analyzer.after, *include) if analyzer.after else ())], cwd=folder.path)
        remarks = [
            ToolFinding(
                file=Path(m["file"]).name,
                line=int(m["line"]),
                rule=m["rule"] or m["severity"],
                severity=m["severity"],
                text=m["text"],
                permitted=False,
            )
            for m in REMARK.finditer(done.stdout + "\n" + done.stderr)
        ]
        return remarks, "" if done.returncode == 0 or remarks else (done.stderr or done.stdout).strip()[:500]

    with ThreadPoolExecutor(max_workers=AT_ONCE) as pool:
        results = list(pool.map(run, files))
    incomplete = sorted({f.file for remarks, _ in results for f in remarks if GAVE_UP in f.rule})
    if incomplete:
        return not_run(
            analyzer.tool,
            subjects,
            f"{analyzer.program} gave up before the end of {', '.join(incomplete)}; use a newer one",
            version,
        )
    silent = [words for _, words in results if words]
    if silent:
        return not_run(analyzer.tool, subjects, f"{analyzer.program} stopped: {silent[0]}; {analyzer.install}", version)
    return finished(analyzer.tool, version, subjects, [finding for remarks, _ in results for finding in remarks])
