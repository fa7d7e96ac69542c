"""Peers from CasADi: one sample's problem in a solver, written as C by CasADi's own generator.

Both take (y of the sample before, target) and give (y, u); y warm-starts the next call.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable
from pathlib import Path

import casadi as ca
import numpy as np

from benchmarks.samples import Samples
from benchmarks.timed_c import Program, build
from ctrlgen.firmware.c.real import Real

NEWTON, SQP = "CasADi Newton in C", "CasADi SQP (qrqp) in C"
TOLERANCE = 1e-7  # of scaled residuals: 0.0001 nm of pose, about 0.002 nm of balance


def newton(samples: Samples, tolerance: float = TOLERANCE) -> ca.Function:
    """`rootfinder`: pose and balance for (z, T), no bounds. `fast_newton` is the Newton that CasADi can write as C."""
    y, _, target = samples.symbols
    problem = {"x": y, "p": target, "g": ca.vertcat(samples.pose_error, samples.balance)}
    options = {"abstol": tolerance, "abstolStep": tolerance, "max_iter": 50}
    root = ca.rootfinder("root", "fast_newton", problem, options)
    return _peer("newton", samples, lambda before, wanted: root(before, wanted))


def sqp(samples: Samples, tolerance: float = TOLERANCE) -> ca.Function:
    """`sqpmethod`: the nearest pose within the bounds of z and T, under the balance; exact Hessian."""
    y, _, target = samples.symbols
    problem = {"x": y, "p": target, "f": 0.5 * ca.sumsqr(samples.pose_error), "g": samples.balance}
    quiet_qp = {"print_iter": False, "print_header": False, "print_info": False, "error_on_fail": False}
    options = {
        "qpsol": "qrqp",
        "qpsol_options": quiet_qp,
        "tol_pr": tolerance,
        "tol_du": 10 * tolerance,
        "max_iter": 50,
        "print_header": False,
        "print_iteration": False,
        "print_time": False,
        "print_status": False,
    }
    solver = ca.nlpsol("sqp_solver", "sqpmethod", problem, options)
    low, high = samples.bounds
    nearest = lambda before, wanted: solver(x0=before, p=wanted, lbx=low, ubx=high, lbg=0, ubg=0)["x"]  # noqa: E731
    return _peer("sqp", samples, nearest)


def _peer(name: str, samples: Samples, solve: Callable[[ca.MX, ca.MX], ca.MX]) -> ca.Function:
    """`solve` and the drives that follow, as one function."""
    before, wanted = ca.MX.sym("before", 2 * samples.axes), ca.MX.sym("wanted", samples.command.shape[1])
    y = solve(before, wanted)
    return ca.Function(name, [before, wanted], [y, samples.drive(y, before[samples.axes :])])


def contender(function: ca.Function, samples: Samples, folder: Path, real: Real = Real.DOUBLE) -> str:
    """CasADi's C of `function`, written to `folder`, and the C around it that `timed_c` and `target` call."""
    name, m = function.name(), samples.model
    generator = ca.CodeGenerator(name, {"with_header": True, "casadi_real": real.value})
    generator.add(function)
    with contextlib.redirect_stdout(io.StringIO()):
        generator.generate(f"{folder}/")
    start = np.full(2 * samples.axes, 1.0)
    return f"""#include "{name}.h"
#define N {samples.axes}
typedef {real.value} real;
static const real z_scale[N] = {_braces(m.z_scale)}, x_scale[N] = {_braces(m.x_scale)}, rest[N] = {_braces(m.rest)};
static real y[2][2 * N] = {{ {_braces(start)}, {_braces(start)} }}, u[N];
static int now = 0;
static const real *arg[{function.sz_arg()}];
static real *res[{function.sz_res()}];
static casadi_int iw[{function.sz_iw()} + 1];
static real w[{function.sz_w()} + 1];
static int mem;
#define Z(i) (y[now][i] * z_scale[i])
#define T(i) (y[now][N + i] * x_scale[i] + rest[i])
#define U(i) u[i]
LINKAGE int answer_to(const real *target)
{{
    arg[0] = y[now];
    arg[1] = target;
    res[0] = y[1 - now];
    res[1] = u;
    now = 1 - now;
    return {name}(arg, res, iw, w, mem);
}}
LINKAGE void start(const real *target)
{{
    mem = {name}_checkout();
    (void)answer_to(target);
    (void)answer_to(target);
}}
"""


def build_peer(title: str, function: ca.Function, samples: Samples, folder: Path) -> Program:
    """CasADi's C of `function`, built like ours. Raises RuntimeError or Disagreement where that is not possible."""
    text = contender(function, samples, folder).replace("LINKAGE", "static")
    return build(title, text, folder / f"{function.name()}.c", samples.axes)


def _braces(values: np.ndarray) -> str:
    return "{ " + ", ".join(repr(float(v)) for v in values) + " }"
