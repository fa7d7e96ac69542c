"""The generated C under hostile calls: sanitizers with random inputs, and a coverage-guided fuzzer.

One harness (`hostile.c`) decodes bytes into calls: numbers that are none, infinite, denormal, out of range; missing
pointers; a step before any init; states of garbage; several instances; extreme indices and times. After each call it
checks what the headers promise. The bytes come from a fixed seed, or from libFuzzer.
"""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ctrlgen.controller.controller_step import ControllerStatus
from ctrlgen.controller.correction import Corrections
from ctrlgen.controller.fixed_point import fixed_point
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.firmware.c.real import Arithmetic, Integers, Real
from ctrlgen.firmware.c.templates import write
from ctrlgen.firmware.folder import CFolder
from ctrlgen.firmware.online.corrected import corrections_of
from ctrlgen.firmware.online.limit_tables import rates_in_c
from ctrlgen.firmware.online.stated_pivot import FARTHEST, StatedPivot
from ctrlgen.model.model import Model
from ctrlgen.trajectory.inverse.clock import Sampled
from ctrlgen.trajectory.scenario import Scenario
from ctrlgen.verification.check import LEFT_OUT, Check, ToolFinding, error_in, finished, not_run, run_tool, version_of

RANDOM, FUZZER = "sanitizers, random calls", "libFuzzer"
RUNS = 200_000
FUZZ_SECONDS = 20  # at most, for each arithmetic
SEED = 1
STOPPING = ("-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all")
# IEEE 754 defines the division by zero: it is reported, but no failure.
REPORTED = ("-fsanitize=float-divide-by-zero", "-fsanitize-recover=all")
FUZZING = ("-fsanitize=fuzzer,address,undefined,float-cast-overflow", "-fno-sanitize-recover=all", "-DHOSTILE_FUZZ")
COVERING = ("-fsanitize=fuzzer", "-DHOSTILE_FUZZ", "-O0")
BUILD = ("-std=c99", "-O1", "-g", "-w")
EMPTY = "int main(void) { return 0; }\n"
EMPTY_FUZZ = """int LLVMFuzzerTestOneInput(const unsigned char *data, unsigned long size);
int LLVMFuzzerTestOneInput(const unsigned char *data, unsigned long size) { (void)data; (void)size; return 0; }
"""
INSTALL = "apt-get install gcc libasan8 libubsan1, or clang libclang-rt-14-dev"
RUNTIME_ERROR = re.compile(r"^(?P<file>[^\n:]+):(?P<line>\d+):\d+: runtime error: (?P<text>.*)$", re.M)
ADDRESS = re.compile(r"ERROR: (?P<rule>AddressSanitizer|LeakSanitizer|libFuzzer): (?P<text>[^\n]*)")
PLACE = re.compile(r"#\d+ 0x\w+ in \w+ (?P<file>[^\s:]+\.c):(?P<line>\d+)")
EDGES = re.compile(
    r"^(?P<entered>COVERED|UNCOVERED)_FUNC: hits: \d+ edges: (?P<reached>\d+)/(?P<existing>\d+) (?P<function>\w+) (?P<file>[^\n:]+):",
    re.M,
)
PROMISE = re.compile(r"^broken promise: (?P<text>.*)$", re.M)


def check_hostile(
    folder: CFolder,
    scenario: Scenario,
    model: Model,
    progress: Callable[[str], None] = lambda _: None,
    runs: int = RUNS,
    quick: bool = False,
) -> tuple[Check, ...]:
    """The sanitizers over `runs` random calls, and libFuzzer over as many sequences or `FUZZ_SECONDS`, in every arithmetic.

    `quick`: not libFuzzer.
    """
    with tempfile.TemporaryDirectory(prefix="ctrlgen-") as name:
        scratch = Path(name)
        for real in folder.arithmetics:
            if isinstance(real, Integers):
                template, context = "fixed_hostile.c", _in_integers(folder, scenario, model, real)
            else:
                template, context = "hostile.c", _context(folder, scenario, model, real)
            write(template, context, scratch / f"hostile_{real.suffix}.c")
        progress(RANDOM)
        random = _random(folder, scratch, runs)
        progress(FUZZER)
        fuzzed = not_run(FUZZER, _subjects(folder), LEFT_OUT) if quick else _fuzzed(folder, scratch, runs)
    return random, fuzzed


def _context(folder: CFolder, scenario: Scenario, model: Model, real: Real) -> dict[str, Any]:
    controller = controller_of(
        model, scenario.file.follow, scenario.sample_time, scenario.file.leads_modes, scenario.sample_times
    )
    kernels, nominal = controller.kernels, controller.kernels.nominal
    bits = ControllerStatus.DISPLACEMENT | ControllerStatus.DRIVE | ControllerStatus.INPUT | ControllerStatus.LOST
    bits |= (ControllerStatus.STATE if nominal.n_states else bits) | (
        ControllerStatus.COMPOSITE if kernels.guarded_limits else bits
    )
    bits |= ControllerStatus.RATE if controller.rate else bits
    bits |= ControllerStatus.UNSURE | ControllerStatus.CLOCK if kernels.tells_of_itself else bits
    corrections = corrections_of(scenario, kernels)
    bits |= ControllerStatus.CLOCK if kernels.times else bits
    samples, clock = len(scenario.bind(model).samples), scenario.clock
    return {
        "real": real,
        "online": folder.online[real],
        "player": folder.player.get(real) if folder.player else None,
        "n": len(nominal.axes),
        "nu": nominal.u.numel(),
        "nx": nominal.x.numel(),
        "n_s": nominal.n_states,
        "m": len(kernels.input_limits),
        "rate": isinstance(clock, Sampled),
        "bits": int(bits),
        "estimated": kernels.contraction is not None,
        "ringing": kernels.ringing is not None,
        "observed": kernels.can_be_observed,
        "times": kernels.times,
        "input_limits": kernels.input_limits,
        "u_low": nominal.u_bounds[0],
        "u_high": nominal.u_bounds[1],
        # limits that follow from constants of the start are computed by the C, to a few of its roundings
        "drive_room": 4 * real.epsilon if kernels.given else 0.0,
        "u_safe": kernels.safe_drive,
        "z_typical": nominal.z_scale,
        "x_typical": np.maximum(np.abs(nominal.rest), nominal.x_scale),
        "samples": samples,
        "closed": scenario.closed,
        "pivot_limits": StatedPivot(kernels).limits if StatedPivot(kernels).acts else None,
        "farthest": FARTHEST,
        "duration": samples * clock.sample_time if isinstance(clock, Sampled) else None,
        **rates_in_c(controller),
        # the calls that it is told by are of the sample rate
        **({} if controller.rate is None else {"fall": controller.rate.fall, "rise": controller.rate.rise}),
        **(_corrected(folder.corrected[real], corrections) if corrections else {"corrected": None}),
    }


def _corrected(name: str, corrections: Corrections) -> dict[str, Any]:
    """Of corrections: what may be added to each number of a target, less than nothing where there is no bound (of derivatives), and what
    each number of a table may be."""
    most = np.zeros(corrections.channels * (corrections.order + 1))
    for c in corrections.each:
        most[c.of] = c.bound
        most[c.of + corrections.channels :: corrections.channels] = -1.0
    return {
        "corrected": name,
        "most_added": most,
        "most_of_number": np.concatenate([np.full(c.basis.count, c.bound) for c in corrections.each]),
        "measured": corrections.channels,
    }


def _in_integers(folder: CFolder, scenario: Scenario, model: Model, real: Integers) -> dict[str, Any]:
    controller = controller_of(
        model, scenario.file.follow, scenario.sample_time, scenario.file.leads_modes, scenario.sample_times
    )
    fixed = fixed_point(controller)
    S = ControllerStatus
    bits = S.DISPLACEMENT | S.DRIVE | S.INPUT | S.LOST | S.UNSURE | (S.COMPOSITE if fixed.bound else S.UNSURE)
    return {
        "prefix": folder.online[real],
        "n": fixed.displacement_ends.shape[1],
        "nu": fixed.drive_ends.shape[1],
        "n_s": fixed.state_ends.shape[1],
        "m": len(fixed.bits.target),
        "u_low": fixed.drive_ends[0],
        "u_high": fixed.drive_ends[1],
        "bits": int(bits),
    }


def _subjects(folder: CFolder) -> list[tuple[str, Arithmetic]]:
    return [(path.name, real) for real in folder.arithmetics for path in folder.sources(real)]


def _build(compiler: str, flags: Sequence[str], sources: Sequence[Path], include: Path, program: Path) -> str:
    """The end of the compiler's messages where it failed; empty where `program` was built."""
    done = run_tool([compiler, *BUILD, *flags, "-I", str(include), *map(str, sources), "-o", str(program)])
    return "" if done.returncode == 0 else (done.stderr or done.stdout).strip()[-500:] or f"status {done.returncode}"


def _works(compiler: str, flags: Sequence[str], text: str, scratch: Path, *words: str) -> str:
    """Whether an empty program can be built and run with these sanitizers: what stands against it, or nothing."""
    if not shutil.which(compiler):
        return f"{compiler} is missing"
    (scratch / "empty.c").write_text(text)
    problem = _build(compiler, flags, [scratch / "empty.c"], scratch, scratch / "empty")
    if problem:
        return f"{compiler} cannot build with {flags[0]}: {problem.splitlines()[0]}"
    done = run_tool([str(scratch / "empty"), *words], cwd=scratch)
    if done.returncode != 0:
        return f"a program built with {flags[0]} does not run here: {done.stderr.strip()[:200]}"
    return ""


def _random(folder: CFolder, scratch: Path, runs: int) -> Check:
    """AddressSanitizer and UndefinedBehaviorSanitizer over calls from a fixed seed."""
    tool, subjects = RANDOM, _subjects(folder)
    against = {compiler: _works(compiler, STOPPING, EMPTY, scratch) for compiler in ("clang", "gcc")}
    compiler = next((name for name, problem in against.items() if not problem), None)
    if compiler is None:
        return not_run(tool, subjects, "; ".join([*against.values(), INSTALL]))
    findings: list[ToolFinding] = []
    notes = []
    for real in folder.arithmetics:
        sources = [scratch / f"hostile_{real.suffix}.c", *folder.sources(real)]
        for flags in (STOPPING, REPORTED):
            program = scratch / f"hostile_{real.suffix}"
            problem = _build(compiler, flags, sources, folder.path, program)
            if problem and flags is STOPPING:
                failed = [error_in(sources[0].name, 0, "build", problem)]
                return finished(tool, version_of(compiler) or "", subjects, failed)
            if problem:
                notes.append(f"{real.value}: divisions by zero not looked for ({compiler} has no {flags[0]})")
                continue
            done = run_tool([str(program), str(SEED), str(runs)], cwd=scratch)
            findings += _findings_in(done.stderr, sources[0].name, done.returncode, judge=flags is STOPPING)
            if flags is STOPPING:
                notes.append(f"{real.value}: {done.stdout.strip() or 'stopped early'}, seed {SEED}")
    return finished(tool, version_of(compiler) or "", subjects, findings, "; ".join(notes))


def _fuzzed(folder: CFolder, scratch: Path, runs: int) -> Check:
    """libFuzzer with both sanitizers, from a small fixed corpus."""
    tool, subjects, version = FUZZER, _subjects(folder), version_of("clang")
    problem = _works("clang", FUZZING, EMPTY_FUZZ, scratch, "-runs=1")
    if problem:
        major = re.search(r"version (\d+)", version or "")
        install = "apt-get install clang" + (f" libclang-rt-{major[1]}-dev" if major else " libclang-rt-14-dev")
        return not_run(tool, subjects, f"{problem}; {install}", version or "")
    findings: list[ToolFinding] = []
    notes = []
    for real in folder.arithmetics:
        program, corpus = scratch / f"fuzz_{real.suffix}", scratch / f"corpus_{real.suffix}"
        corpus.mkdir()
        rng = np.random.default_rng(SEED)
        for k in range(16):
            (corpus / str(k)).write_bytes(rng.integers(0, 256, 64 * (1 + k % 6), dtype=np.uint8).tobytes())
        sources = [scratch / f"hostile_{real.suffix}.c", *folder.sources(real)]
        problem = _build("clang", FUZZING, sources, folder.path, program)
        if problem:
            return finished(tool, version or "", subjects, [error_in(sources[0].name, 0, "build", problem)])
        words = [
            f"-runs={runs}",
            f"-max_total_time={FUZZ_SECONDS}",
            f"-seed={SEED}",
            "-max_len=400",
            "-print_final_stats=1",
            # Linux counts the peak memory of the process that started this one as its own, and the C allocates nothing.
            "-rss_limit_mb=0",
        ]
        done = run_tool([str(program), *words, f"-artifact_prefix={scratch}/", str(corpus)], cwd=scratch)
        remarks = _findings_in(done.stderr, sources[0].name, done.returncode, judge=True)
        findings += remarks
        ran = re.findall(r"stat::number_of_executed_units:\s*(\d+)", done.stderr)
        # what writes beyond its arrays may hang where no sanitizer stops it
        reached = "coverage not counted" if remarks else _coverage(sources, folder.path, corpus)
        notes.append(f"{real.value}: {ran[-1] if ran else 'unknown'} runs, {reached}")
    return finished(tool, version or "", subjects, findings, "; ".join(notes))


def _coverage(sources: Sequence[Path], include: Path, corpus: Path) -> str:
    """The edges of the generated C that the corpus the fuzzer kept reaches, counted without the sanitizers' own branches."""
    program = corpus.with_suffix(".coverage")
    if _build("clang", COVERING, sources, include, program):
        return "coverage not counted"
    output = run_tool([str(program), "-runs=0", "-print_coverage=1", str(corpus)], cwd=corpus.parent).stderr
    inside = [m for m in EDGES.finditer(output) if any(m["file"].endswith(path.name) for path in sources[1:])]
    reached, existing = (sum(int(m[k]) for m in inside) for k in ("reached", "existing"))
    never = sorted(m["function"] for m in inside if m["entered"] == "UNCOVERED")
    return f"{reached} of {existing} edges of the generated C" + (
        f"; never entered: {', '.join(never)}" if never else ""
    )


def _findings_in(words: str, harness: str, status: int, *, judge: bool) -> list[ToolFinding]:
    """The findings in the output of a sanitized program; one that fails without a message is a finding too."""
    remarks = [
        ToolFinding(
            file=Path(m["file"]).name,
            line=int(m["line"]),
            rule="undefined",
            severity="error" if judge else "information",
            text=m["text"],
            permitted=not judge,
        )
        for m in RUNTIME_ERROR.finditer(words)
    ]
    remarks += [error_in(harness, 0, "promise", m["text"]) for m in PROMISE.finditer(words)]
    if not remarks and (error := ADDRESS.search(words)):
        place = PLACE.search(words, error.end())
        file, line = (Path(place["file"]).name, int(place["line"])) if place else (harness, 0)
        remarks.append(error_in(file, line, error["rule"], error["text"][:200]))
    if not remarks and status != 0:
        remarks.append(error_in(harness, 0, "stopped", f"status {status}: {words.strip()[-200:]}"))
    return remarks
