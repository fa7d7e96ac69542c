"""A C program around one contender: answers all targets once, then times passes over them."""

from __future__ import annotations

import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.samples import Answers, Disagreement

COMPILER = ("gcc", "-std=c99", "-O2")

# A contender defines: N; type `real`; `int answer_to(const real target[N])`; pointers-to-answer macros
# Z(i), T(i), U(i) in SI; `void start(const real target[N])`, which leaves it settled at target.
# The contender itself is another translation unit, so that the loop can neither inline nor drop it.
MAIN = r"""
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

int main(int argc, char **argv)
{
    const long n = (argc == 3) ? atol(argv[1]) : 0, passes = (argc == 3) ? atol(argv[2]) : 0;
    double *given = malloc((size_t)n * N * sizeof *given);
    real *target = malloc((size_t)n * N * sizeof *target);
    volatile double sink = 0.0;
    double sum = 0.0;
    long k, pass;
    int i;
    if (n < 1 || given == NULL || target == NULL || fread(given, N * sizeof *given, (size_t)n, stdin) != (size_t)n) {
        return 2;
    }
    for (k = 0; k < n * N; k++) {
        target[k] = (real)given[k];
    }
    start(target + (n - 1) * N);
    for (k = 0; k < n; k++) {
        double record[1 + 3 * N];
        record[0] = answer_to(target + k * N);
        for (i = 0; i < N; i++) {
            record[1 + i] = Z(i);
            record[1 + N + i] = T(i);
            record[1 + 2 * N + i] = U(i);
        }
        fwrite(record, sizeof record, 1, stdout);
    }
    for (pass = 0; pass < passes; pass++) {
        struct timespec a, b;
        double seconds;
        clock_gettime(CLOCK_MONOTONIC, &a);
        for (k = 0; k < n; k++) {
            sum += answer_to(target + k * N) + (double)U(0);
        }
        clock_gettime(CLOCK_MONOTONIC, &b);
        seconds = ((double)(b.tv_sec - a.tv_sec) + 1e-9 * (double)(b.tv_nsec - a.tv_nsec)) / (double)n;
        fwrite(&seconds, sizeof seconds, 1, stdout);
    }
    sink = sum;
    (void)sink;
    return 0;
}
"""


@dataclass(frozen=True)
class Program:
    """A built timing program of a contender with `axes` components in each signal."""

    name: str
    path: Path
    axes: int

    def run(self, targets: np.ndarray, passes: int) -> tuple[Answers, float]:
        """The answers of its first pass, and the median over `passes` of the seconds per call."""
        command = [str(self.path), str(len(targets)), str(passes)]
        done = subprocess.run(command, input=np.ascontiguousarray(targets).tobytes(), capture_output=True, check=False)
        numbers = np.frombuffer(done.stdout, dtype=float)
        width = 1 + 3 * self.axes
        if done.returncode != 0 or numbers.size != len(targets) * width + passes:
            raise Disagreement(f"{self.name}: its program ended with {done.returncode} after {numbers.size} numbers")
        table = numbers[: len(targets) * width].reshape(len(targets), width)
        z, T, u = np.split(table[:, 1:], 3, axis=1)
        seconds = float(np.median(numbers[len(targets) * width :])) if passes else 0.0
        return Answers(z, T, u, table[:, 0].astype(int)), seconds


def build(name: str, contender: str, source: Path, axes: int) -> Program:
    """Compiles `contender` (C text for MAIN, which follows it) with `source`, beside which everything is put."""
    stem = source.with_suffix("")
    main, program = stem.with_name(f"{stem.name}_timed.c"), stem.with_name(f"{stem.name}_timed")
    main.write_text("#define _POSIX_C_SOURCE 199309L\n" + contender + MAIN, encoding="utf-8")
    command = [*COMPILER, "-I", str(source.parent), str(main), str(source), "-lm", "-o", str(program)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise Disagreement(f"{name}: {COMPILER[0]} refuses it:\n{done.stderr[:2000]}")
    return Program(name, program, axes)


def generated(prefix: str, real: str) -> str:
    """The contender text of a controller that ctrlgen generated; it has been held at the target until it knows that the device is there."""
    return f"""#include "{prefix}.h"
#define N ((int)(sizeof ((({prefix}_output *)0)->drive) / sizeof ({real})))
typedef {real} real;
static {prefix}_state state;
static {prefix}_output out;
#define Z(i) out.displacement[i]
#define T(i) out.state[i]
#define U(i) out.drive[i]
static int answer_to(const real *target)
{{
    return {prefix}_step(&state, target, &out);
}}
static void start(const real *target)
{{
    {prefix}_init(&state);
    while ({prefix}_settle(&state, target, &out) & {prefix.upper()}_UNSURE) {{
    }}
}}
"""
