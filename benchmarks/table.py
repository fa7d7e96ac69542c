"""What practitioners write by hand: a table of each actuator's state over its displacement, linear between its places, and drives clamped.

z = M t, T_i from 128 intervals of the range of z_i, u = what leads to T in a sample, clipped; nothing else is limited: not the
displacement, not the stress. Table and matrices are computed from the model here; the C is what a careful hand would write.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.samples import Answers, Disagreement, Samples
from benchmarks.timed_c import Program, build
from ctrlgen.controller.controller_step import answer
from ctrlgen.controller.fixed_maps import real_maps
from ctrlgen.firmware.c.real import Real
from ctrlgen.model.simulation import simulate
from ctrlgen.trajectory.inverse.clock import in_time

NAME = "table, 128 intervals, linear"
KEEPS = "it keeps the drive's limits alone"
CELLS = 128
TOLD = 0.005  # of a bound: less is the error of its interpolation
SOURCE = """#include "{name}.h"
#define CELLS {cells}
static const real M[N][N] = {M};
static const real LEVEL[N][CELLS + 1] = {levels};
static const real LOW[N] = {z_low}, PER[N] = {per};
static const real FROM[N] = {was}, TO[N] = {to}, AT[N] = {at};
static const real U_LOW[N] = {u_low}, U_HIGH[N] = {u_high};
static const real KEPT[N] = {kept}, PUSHED[N] = {pushed}, PULLED[N] = {pulled};
void {name}_step({name}_state *state, const real *target, {name}_output *out)
{{
    int i;
    for (i = 0; i < N; i++) {{
        const real *m = M[i];
        const real z = m[0] * target[0] + m[1] * target[1] + m[2] * target[2] + m[3] * target[3] + m[4] * target[4] + m[5] * target[5];
        real place = (z - LOW[i]) * PER[i];
        int k;
        real T, u;
        place = (place > ZERO) ? place : ZERO;
        k = (place < (real)(CELLS - 1)) ? (int)place : CELLS - 1;
        T = LEVEL[i][k] + (place - (real)k) * (LEVEL[i][k + 1] - LEVEL[i][k]);
        u = FROM[i] * state->T[i] + TO[i] * T + AT[i];
        if (u < U_LOW[i] || u > U_HIGH[i]) {{
            u = (u < U_LOW[i]) ? U_LOW[i] : U_HIGH[i];
            T = KEPT[i] * state->T[i] + PUSHED[i] * u + PULLED[i];
        }}
        state->T[i] = T;
        out->z[i] = z;
        out->T[i] = T;
        out->u[i] = u;
    }}
}}
/* The state of a device that stands at target. */
void {name}_start({name}_state *state, const real *target)
{{
    {name}_output out;
    int k;
    for (k = 0; k < 400; k++) {{
        {name}_step(state, target, &out);
    }}
}}
"""
HEADER = """#define N {axes}
typedef {real} real;
#define ZERO ((real)0.0)
typedef struct {{ real T[N]; }} {name}_state;
typedef struct {{ real z[N]; real T[N]; real u[N]; }} {name}_output;
void {name}_step({name}_state *state, const real *target, {name}_output *out);
void {name}_start({name}_state *state, const real *target);
"""
CONTENDER = """#include "{name}.h"
static {name}_state state;
static {name}_output out;
#define Z(i) out.z[i]
#define T(i) out.T[i]
#define U(i) out.u[i]
static int answer_to(const real *target)
{{
    {name}_step(&state, target, &out);
    return 0;
}}
static void start(const real *target)
{{
    int i;
    for (i = 0; i < N; i++) {{
        state.T[i] = {rest};
    }}
    {name}_start(&state, target);
}}
"""


def write(samples: Samples, real: Real, folder: Path) -> Path:
    """The C with its header; returns the source. Raises Disagreement where a displacement moves more than one actuator's state."""
    m, kernels, name = samples.model, samples.controller.kernels, f"table_{real.suffix}"
    maps, n, (low, high) = real_maps(kernels), samples.axes, m.z_bounds
    (by_both, at), places = maps.step, [i for i, _ in maps.state]
    single = [by_both[:, :n], by_both[:, n:], maps.by_state, maps.by_drive]
    if n != 6 or places != list(range(n)) or any(np.any(part != np.diag(np.diag(part))) for part in single):
        raise Disagreement("a state of an actuator follows from more than its own displacement and drive")
    nodes = low + (high - low) * np.linspace(0, 1, CELLS + 1)[:, None]
    levels = np.array([answer(kernels.static.state, m.rest, z, z) for z in nodes]).T
    home = answer(kernels.moving.advance, m.rest * 0, low * 0, np.zeros(n))
    was, to, kept, pushed = (np.diag(part) for part in single)
    rows = {"z_low": low, "per": CELLS / (high - low), "was": was, "to": to, "at": at, "kept": kept, "pushed": pushed}
    rows |= {"pulled": home, "u_low": m.u_bounds[0], "u_high": m.u_bounds[1]}
    numbers = {key: _braces(values, real) for key, values in rows.items()}
    tables = {key: "{\n" + ",\n".join(_braces(row, real) for row in rows) + "\n}" for key, rows in
              (("M", maps.M), ("levels", levels))}  # fmt: skip
    folder.mkdir(exist_ok=True)
    (folder / f"{name}.h").write_text(HEADER.format(name=name, real=real.value, axes=n))
    source = folder / f"{name}.c"
    source.write_text(SOURCE.format(name=name, cells=CELLS, **numbers, **tables))
    return source


def build_table(samples: Samples, real: Real, folder: Path) -> Program:
    """The table as a timed program."""
    source = write(samples, real, folder)
    rest = real.literal(float(samples.model.rest[0]))
    return build(f"{NAME}, {real.value}", CONTENDER.format(name=source.stem, rest=rest), source, samples.axes)


def off(samples: Samples, answers: Answers, targets: np.ndarray) -> float:
    """By how much [m] the equilibrium of its temperatures is off the displacement that the target means, at most."""
    M, kernels, m = samples.controller.kernels.target_directions, samples.controller.kernels, samples.model
    found = [answer(kernels.static.settle, T, z, u) for T, z, u in zip(answers.T, answers.z, answers.u, strict=True)]
    assert M is not None and m.n_states == samples.axes
    return float(np.abs(np.array(found) - targets @ M.T).max())


def passed(samples: Samples, answers: Answers) -> str:
    """Which limits the model driven by these answers passes, and by how much at most."""
    m, u = samples.model, answers.u[1:]
    reached = simulate(m, u, in_time(samples.scenario.clock).sample_time, answers.T[0])
    told = []
    for limit, v in zip(m.limits, m.limited_values(reached.x[1:], reached.z[1:], u), strict=True):
        over = 0.0 if limit.upper is None else float(v.max() / limit.upper) - 1
        under = 0.0 if limit.lower is None else (limit.lower - float(v.min())) / float(np.abs(v).max())
        if max(over, under) > TOLD:
            told.append(f"{limit.label} by {100 * max(over, under):.0f} %")
    return "; ".join(told) or "none"


def _braces(values: np.ndarray, real: Real) -> str:
    return "{ " + ", ".join(real.literal(float(v)) for v in values) + " }"
