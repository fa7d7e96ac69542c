"""The limits of a controller as C: tables of numbers, or members of the state where they follow from the constants of the start."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from ctrlgen.controller.feedforward import Controller
from ctrlgen.controller.lost_state import UNLIMITED
from ctrlgen.firmware.c.cprint import Printer
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.online.start_constants import Tables
from ctrlgen.model.model import Model

FLOAT_SLACK = 4e-6  # as SLACK of the controller, in float: four roundings of a temperature, 0.4 mK


def limit_context(controller: Controller, printer: Printer) -> dict[str, Any]:
    """The part of the context of online.c.j2 that holds the limits, their slacks, and what tests of them compare with."""
    kernels, m, real = controller.kernels, controller.kernels.nominal, printer.real
    share = FLOAT_SLACK if real is Real.FLOAT else controller.slack
    z_slack, s_slack, u_slack = kernels.slacks(share)
    n_s = m.n_states
    return {
        "relative_slack": share,
        "z_low": m.z_bounds[0],
        "z_high": m.z_bounds[1],
        "z_slack": z_slack,
        "s_low": np.maximum(m.x_bounds[0][:n_s], -UNLIMITED),
        "s_high": np.minimum(m.x_bounds[1][:n_s], UNLIMITED),
        "s_slack": s_slack,
        "u_low": m.u_bounds[0],
        "u_high": m.u_bounds[1],
        "u_slack": u_slack,
        "u_safe": kernels.safe_drive,
        "input_limits": kernels.input_limits,
        "unlimited": UNLIMITED,
        "lost_tests": _lost_tests(controller, real),
        "usable_tests": [magnitude_test(f"target[{i}]", most, real) for i, most in enumerate(kernels.input_limits)],
        **rates_in_c(controller),
        **_limits_in_c(controller, printer, real, u_slack),
    }


def _lost_tests(controller: Controller, real: Real) -> list[str]:
    """Tests of each number of a state, which hold where it can be one that the controller left."""
    kernels, m = controller.kernels, controller.kernels.nominal
    tests = [magnitude_test(_member(i, m), most, real) for i, most in enumerate(controller.plausible)]
    if kernels.times is None:
        return tests
    began = controller.plausible[: m.x.numel() + len(m.axes)]
    tests += [magnitude_test(_member(i, m, "_begun"), most, real) for i, most in enumerate(began)]
    return [*tests, within_test("state->h", *kernels.times, real)]


def rates_in_c(controller: Controller) -> dict[str, Any]:
    """What the C needs to keep limits on the rates of drives: changes in a sample, or where its time varies in a second."""
    if (rate := controller.rate) is None:
        return {"rated": False, "passing": False}
    over = 1.0 if controller.kernels.times is None else 1 / (controller.kernels.sample_time or 1.0)
    ends = {"fall": rate.fall * over, "rise": rate.rise * over}
    return {"rated": True, "passing": controller.kernels.limits_can_be_passed, **ends}


def _member(i: int, model: Model, of: str = "") -> str:
    """Number `i` of x, then z, then the last drive in the C's state; or `of` another x and z there."""
    for name, count in (("x", model.x.numel()), ("z", len(model.axes))):
        if i < count:
            return f"state->{name}{of}[{i}]"
        i -= count
    return f"state->u[{i}]"


def magnitude_test(number: str, most: float, real: Real) -> str:
    """C that holds where the magnitude of a `number` is at most `most`; not for NaN."""
    return (
        f"((bits_of(&{number}) & {real.magnitude}) <= {real.bits_literal(real.bits(most))}) /* {real.literal(most)} */"
    )


def within_test(number: str, low: float, high: float, real: Real) -> str:
    """C that holds where a `number` in memory is within low ... high; not for NaN. It compares bits, which no option of a compiler makes
    a NaN pass; numbers of one sign are ordered as their bits are, others by `ordered`."""
    if low == -high:
        return magnitude_test(number, high, real)
    bits = f"bits_of(&{number})"
    first, last = real.bits(low + 0.0), real.bits(high + 0.0)  # of a negative zero, zero
    if low < 0.0:
        bits, first, last = f"ordered({bits})", real.ordered(first), real.ordered(last)
    if first == 0:
        return f"({bits} <= {real.bits_literal(last)}) /* {real.literal(high)} */"
    between = f"{real.literal(low)} ... {real.literal(high)}"
    return f"(({bits} - {real.bits_literal(first)}) <= {real.bits_literal(last - first)}) /* {between} */"


def _middle_formulas(low: ca.SX, high: ca.SX, real: Real) -> tuple[ca.SX, ca.SX]:
    """Middle and squared half width of ranges that are formulas; the width is four roundings smaller, so that a test with it is on the
    safe side."""
    centre, half = (low + high) / 2, (high - low) / 2
    return centre, ca.fmax(half - 4 * real.epsilon * (ca.fabs(centre) + half), 0.0) ** 2


def _u_bounds(m: Model) -> tuple[ca.SX, ca.SX]:
    return m.bounds_formula(m.u)


def _s_bounds(m: Model) -> tuple[ca.SX, ca.SX]:
    """Low and high of the actuators' states, `UNLIMITED` where there is no bound."""
    low, high = m.bounds_formula(m.x[: m.n_states, :])
    return ca.fmax(low, -UNLIMITED), ca.fmin(high, UNLIMITED)


def _limits_in_c(controller: Controller, printer: Printer, real: Real, u_slack: np.ndarray) -> dict[str, Any]:
    """Tests of a `value` against ranges as C, by "z_tests", ..., and where each table of limits is found, by its name in "arrays"."""
    model, tables, limited = (
        controller.kernels.nominal,
        Tables(controller.kernels, printer),
        any(controller.drive_can_be_limited),
    )
    (u_low, u_high), n_s = model.u_bounds, model.n_states
    s_low, s_high = np.maximum(model.x_bounds[0][:n_s], -UNLIMITED), np.minimum(model.x_bounds[1][:n_s], UNLIMITED)
    arrays = {
        "U_LOW": tables.array("U_LOW", lambda m: _u_bounds(m)[0], u_low),
        "U_HIGH": tables.array("U_HIGH", lambda m: _u_bounds(m)[1], u_high),
        "U_LEAST": "U_LEAST",
        "U_MOST": "U_MOST",
    }
    if limited:
        arrays |= {
            "U_LEAST": tables.array("U_LEAST", lambda m: _u_bounds(m)[0] - ca.DM(u_slack), u_low - u_slack),
            "U_MOST": tables.array("U_MOST", lambda m: _u_bounds(m)[1] + ca.DM(u_slack), u_high + u_slack),
        }
    tests = {
        "z_tests": [
            within_test(f"value[{i}]", low, high, real)
            for i, (low, high) in enumerate(zip(*model.z_bounds, strict=True))
        ],
        "u_tests": _range_tests(tables, _u_bounds, u_low, u_high, real),
        "s_tests": [],
    }
    if controller.state_can_be_limited:
        arrays |= {
            "S_LOW": tables.array("S_LOW", lambda m: _s_bounds(m)[0], s_low),
            "S_HIGH": tables.array("S_HIGH", lambda m: _s_bounds(m)[1], s_high),
        }
        tests["s_tests"] = _range_tests(tables, _s_bounds, s_low, s_high, real)
    rest = tables.each("X_REST", lambda m: m.rest_formula, model.rest)
    return {"arrays": arrays, "rest_given": rest, **tests}


def _range_tests(
    tables: Tables, bounds: Callable[[Model], tuple[ca.SX, ca.SX]], low: np.ndarray, high: np.ndarray, real: Real
) -> list[str]:
    """For each number of `value` C that holds where it is within its range. Where a range follows from the constants of the start: the
    distance from its middle squared is at most its half width squared, of what is a number."""
    members = [f"value[{i}]" for i in range(len(low))]
    if tables.rows(lambda m: ca.vertcat(*bounds(m)), low) is None:
        return [within_test(*each, real) for each in zip(members, low, high, strict=True)]
    middles = tables.texts(lambda m: _middle_formulas(*bounds(m), real)[0], (low + high) / 2)
    squares = tables.texts(lambda m: _middle_formulas(*bounds(m), real)[1], (high - low) ** 2 / 4)
    tests = []
    for number, middle, square in zip(members, middles, squares, strict=True):
        apart = f"({number} - {middle})" if middle else number
        tests.append(f"((is_nan(&{number}) == 0) && (({apart} * {apart}) <= {square or real.literal(0.0)}))")
    return tests
