"""No option of gcc or clang for floating-point arithmetic makes the generated C pass a number that is none: a source refuses to be
compiled with it, or its own test passes."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.folder import CFolder

# What gcc 12 (`--help=optimizers`, `--help=common`, `--help=target`) and clang 14 (`--help`) list that concerns floating-point numbers,
# and clang's own names for what its driver makes of them.
BOTH = (
    "-ffast-math",
    "-Ofast",
    "-ffinite-math-only",
    "-funsafe-math-optimizations",
    "-fassociative-math -fno-signed-zeros -fno-trapping-math",
    "-freciprocal-math",
    "-fno-signed-zeros",
    "-fno-trapping-math",
    "-fno-math-errno",
    "-frounding-math",
    "-ffp-contract=fast",
    "-ffp-contract=off",
    "-mrecip",
    "-flto",
    "-flto -funsafe-math-optimizations",
    "-O3 -march=native",
    "-mfma -ffp-contract=fast",
)
OPTIONS = {
    "gcc": (
        *BOTH,
        "-fsignaling-nans",
        "-fsingle-precision-constant",  # which takes double's constants for float's
        "-fexcess-precision=fast",
        "-fexcess-precision=standard",
        "-ffloat-store",
        "-fno-fp-int-builtin-inexact",
        "-fcx-limited-range",
        "-fno-protect-parens",
        "-mfpmath=387",
        "-mfpmath=sse",
        "-mfpmath=both",
    ),
    "clang": (
        *BOTH,
        "-cl-single-precision-constant",
        "-fno-honor-nans",
        "-fno-honor-infinities",
        "-fno-honor-nans -fno-honor-infinities",
        "-fapprox-func",
        "-ffp-contract=on",
        "-ffp-model=fast",
        "-ffp-model=strict",
        "-ffp-model=precise",
        "-ffp-exception-behavior=ignore",
        "-ffp-exception-behavior=maytrap",
        "-ffp-eval-method=double",
        "-ffp-eval-method=extended",
        "-fdenormal-fp-math=preserve-sign",
        "-fdenormal-fp-math=positive-zero",
        "-Xclang -menable-no-nans",
        "-Xclang -menable-no-infs",
        *(
            f"-fno-honor-nans {more}"
            for more in ("-O0", "-O1", "-Os", "-O3 -march=native", "-flto", "-mfma -ffp-contract=fast")
        ),
        "-fno-honor-nans -funsafe-math-optimizations -fapprox-func",
    ),
}
UNKNOWN = re.compile(
    r"unknown (argument|option)|unrecognized (command|argument)|not supported|No such file|cannot find"
)


def escapes(folder: CFolder, real: Real, compiler: str, option: str, scratch: Path) -> str:
    """What the folder's own test finds wrong where it is compiled with this option; empty for nothing, also where a source refuses
    it or the compiler does not know it."""
    program = scratch / "test"
    sources = [*folder.sources(real), folder.runner(real)]
    words = [compiler, "-std=c99", "-O2", *option.split(), f"-I{folder.path}", *map(str, sources), "-o", str(program)]
    built = subprocess.run(words, capture_output=True, text=True)
    if built.returncode != 0:
        refused = re.search("they remove the checks for NaN|constants_in_double", built.stderr) or UNKNOWN.search(
            built.stderr
        )
        return "" if refused else built.stderr
    ran = subprocess.run([str(program)], capture_output=True, text=True)
    return "" if ran.returncode == 0 else ran.stdout or f"status {ran.returncode}"


def test_a_compiler_that_is_told_that_no_number_is_nan_lets_none_pass(circle_c, tmp_path):
    if not shutil.which("clang"):
        pytest.skip("clang is missing: the option was not tried")
    assert escapes(circle_c, Real.FLOAT, "clang", "-fno-honor-nans", tmp_path) == ""


@pytest.mark.long
@pytest.mark.parametrize("real", [Real.FLOAT, pytest.param(Real.DOUBLE, marks=pytest.mark.exhaustive)])
@pytest.mark.parametrize("compiler", list(OPTIONS))
def test_no_option_for_floating_point_numbers_lets_a_nan_pass(circle_c, compiler, real, tmp_path):
    if not shutil.which(compiler):
        pytest.skip(f"{compiler} is missing: its options were not tried")
    found = {option: escapes(circle_c, real, compiler, option, tmp_path) for option in OPTIONS[compiler]}
    assert {option: words for option, words in found.items() if words} == {}


@pytest.mark.parametrize(
    "compiler, option", [("gcc", "-fsingle-precision-constant"), ("clang", "-cl-single-precision-constant")]
)
def test_no_source_in_double_is_compiled_with_constants_in_float(circle_c, compiler, option, tmp_path):
    """Each one by itself: a player alone has no self test that would tell."""
    if not shutil.which(compiler):
        pytest.skip(f"{compiler} is missing: its option was not tried")
    for source in circle_c.sources(Real.DOUBLE):
        words = [compiler, "-std=c99", option, "-fsyntax-only", source]
        told = subprocess.run(words, capture_output=True, text=True)
        assert told.returncode != 0 and f"{source.stem}_constants_in_double" in told.stderr, source.name
    for source in circle_c.sources(Real.FLOAT):
        subprocess.run([compiler, "-std=c99", option, "-fsyntax-only", source], check=True)
