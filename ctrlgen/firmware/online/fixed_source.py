"""The contexts of the templates fixed*: the controller in integers of 32 bits, and the test of it that runs on the target."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ctrlgen.controller.feedforward import Controller
from ctrlgen.controller.fixed_maps import NoFixedPoint
from ctrlgen.controller.fixed_point import FixedPoint, fixed_point
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.units import base_unit
from ctrlgen.firmware.c.real import Integers, Real
from ctrlgen.firmware.online.fixed_vectors import edges, fixed_vectors
from ctrlgen.firmware.online.online import build_of, header_context
from ctrlgen.numerics.scaled_integers import IntegerRows
from ctrlgen.trajectory.scenario import Scenario

# calls of fixed_selftest.c.j2 that wait, those without a pointer, and those of a conversion without one
WAITED, MISSING, UNCONVERTED = 6, 5, 2
TERMS, INDENT = 2, "\n        "  # of a sum, on a line


def fixed_context(
    scenario: Scenario, controller: Controller, command: np.ndarray, names: Mapping[str, str]
) -> dict[str, Any]:
    """The context of the templates; `names` of the pieces online, selftest and vectors. Raises InputError with the reason where
    there is none in integers."""
    try:
        fixed = fixed_point(controller)
    except NoFixedPoint as why:
        what = f"is asked for, but {why}; leave fixed_point out: the C in float and double does not need it"
        raise InputError(scenario.path, [Fault("fixed_point", what)]) from None
    header = header_context(scenario, controller)
    polynomials = list(dict.fromkeys(polynomial for _, polynomial in fixed.state))
    n, n_s = header["n"], header["n_s"]
    return (
        header
        | build_of(scenario, controller, Integers.Q31.suffix)
        | _numbers(fixed, header)
        | _ranges(fixed)
        | _test(controller, fixed, command)
        | {
            "prefix": names["online"],
            "selftest": names["selftest"],
            "vectors": names["vectors"],
            "real": Real.FLOAT,  # of a rate that is no whole number, in the header alone
            "sample_time": controller.kernels.sample_time,
            "settling": fixed.settling,
            "unknown": fixed.unknown,
            "trials": fixed.trials,
            "shifts": _shifts(fixed),
            "displacement": fixed.displacement,
            "settle_drive": fixed.settle_drive,
            "step_drive": fixed.step_drive,
            "bound": fixed.bound,
            "bound_limit": fixed.bound_limit,
            "polynomials": polynomials,
            "state_rows": [(place, 1 + polynomials.index(polynomial)) for place, polynomial in fixed.state],
            "rows_sum": _rows_sum,
            "targets": [f"target[{i}]" for i in range(header["m"])],
            "displacements": [f"z[{i}]" for i in range(n)],
            "wanted_states": [f"s[{i}]" for i in range(n_s)],
            "both_states": [f"{name}[{i}]" for name in "xs" for i in range(n_s)],
            "off_stage": fixed.off.stage.max(),
            "off_drive": fixed.off.drive.max(),
            "off_target": fixed.off.target.max(),
        }
    )


def _test(controller: Controller, fixed: FixedPoint, command: np.ndarray) -> dict[str, Any]:
    """Reference vectors, what else the self test tries, and how many calls that are."""
    given = fixed_vectors(controller, fixed, command)
    n, n_s, n_u = (len(b) for b in (fixed.bits.displacement, fixed.bits.state, fixed.bits.drive))
    rest = fixed.state_of(np.zeros(n, dtype=int))
    given["edges"] = edges(fixed.bits.target.tolist())
    converted = sum(map(len, given["edges"])) + UNCONVERTED
    counts = {"waited": WAITED, "spoilt": 2 * (n_s + n) + 1, "missing": MISSING, "converted": converted}
    calls = len(given["rows"]) + sum(counts.values())
    return given | counts | {"calls": calls, "safe": [0] * (n_u + n) + [int(v) for v in rest]}


def _numbers(fixed: FixedPoint, header: Mapping[str, Any]) -> dict[str, Any]:
    """Name, channels with their units, and bits of every array of the interface."""
    arrays = (
        ("target", header["follow"], fixed.bits.target),
        ("drive", header["drive"], fixed.bits.drive),
        ("state", header["state"], fixed.bits.state),
    )
    numbers = [
        (name, [(c, base_unit(u)) for c, u in zip(s.channels, s.units, strict=True)], b) for name, s, b in arrays
    ]
    numbers.insert(2, ("displacement", [(axis, "m") for axis in header["axes"]], fixed.bits.displacement))
    follow = ", ".join(dict.fromkeys(base_unit(u) for u in header["follow"].units))
    return {"numbers": numbers, "target_bits": [int(b) for b in fixed.bits.target], "follow_units": follow}


def _ranges(fixed: FixedPoint) -> dict[str, Any]:
    """The tables of lowest and highest integers, slacks and rest."""
    z, x, u = fixed.displacement_ends, fixed.state_ends, fixed.drive_ends
    tables = {
        "z_low": z[0],
        "z_high": z[1],
        "z_slack": fixed.displacement_slack,
        "x_low": x[0],
        "x_high": x[1],
        "x_rest": fixed.state_of(np.zeros(z.shape[1], dtype=int)),
        "u_low": u[0],
        "u_high": u[1],
        "u_slack": fixed.drive_slack,
        "known": fixed.known,
    }
    return {name: [int(v) for v in values] for name, values in tables.items()}


def _shifts(fixed: FixedPoint) -> list[int]:
    rows = [fixed.displacement, fixed.settle_drive, fixed.step_drive, *([fixed.bound] if fixed.bound else [])]
    steps = [shift for _, polynomial in fixed.state for shift in polynomial.shifts]
    return sorted({fixed.trials, *(r.shift for r in rows), *steps})


def _rows_sum(rows: IntegerRows, k: int, names: Sequence[str]) -> str:
    """Row k of an affine map as an expression of C."""
    terms = [f"product({c}, {name})" for c, name in zip(rows.coefficients[k], names, strict=True) if c]
    terms += [f"({rows.offset[k]}LL)"] if rows.offset[k] or not terms else []
    lines = [" + ".join(terms[i : i + TERMS]) for i in range(0, len(terms), TERMS)]
    return f"rounded_{rows.shift}({(' +' + INDENT).join(lines)})"
