"""In single precision no number of the C is too small or too large: none that is written, and none on the way to a polynomial's value."""

from __future__ import annotations

import operator
import re

import casadi as ca
import numpy as np
import pytest
from conftest import ROOT, SCENARIOS

from ctrlgen import build_model, load_scenario
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.templates import render
from ctrlgen.firmware.online.online import online_context
from ctrlgen.numerics.proven_polynomial import proven_inverse, proven_polynomial

V = ca.SX.sym("v")
FLOAT = np.finfo(np.float32)
LITERAL = re.compile(r"(?<![\w.])(?:\d+\.\d*(?:e[+-]?\d+)?|\d+e[+-]?\d+)(?=f\b)")
# One scenario of each device whose target a controller follows
SCENARIOS_OF_DEVICES = (
    "circle20",
    "dynamic_circle",
    "flexure_axis_line",
    "lever_circle",
    "meso_circle",
    "mirror_spiral",
    "parallelogram_line",
    "rrr_circle",
    "tilt_platform",
    "tripod_tilt",
    "xy_stage_force",
)


def are_floats(text: str) -> None:
    numbers = np.array([float(number) for number in LITERAL.findall(text)])
    sizes = numbers[numbers != 0]
    assert len(sizes) > 5 and sizes.min() >= float(FLOAT.tiny) * (1 - 1e-7) and sizes.max() <= FLOAT.max


@pytest.mark.parametrize("device", ["mems_hexapod", "flexure_axis", "three_stacks"])
def test_every_number_of_the_committed_c_is_a_float(device):
    are_floats((ROOT / f"codegen/golden/{device}/{device}_online_f32.c").read_text())


@pytest.mark.long
@pytest.mark.parametrize("name", SCENARIOS_OF_DEVICES)
def test_every_number_of_generated_c_is_a_float(name):
    scenario = load_scenario(SCENARIOS / name)
    controller = controller_of(build_model(scenario.device), scenario.file.follow, scenario.sample_time)
    context = online_context(scenario, controller, Real.FLOAT, "own_online_f32")
    are_floats(render("online.c", context) + render("online.h", context))


def in_float(f: ca.Function, v: np.ndarray) -> np.ndarray:
    """What f computes in single precision; FloatingPointError where a number on the way overflows or is no normal one."""
    own = {ca.OP_ADD: operator.add, ca.OP_SUB: operator.sub, ca.OP_MUL: operator.mul}
    at, found = {}, v
    with np.errstate(over="raise", under="raise"):
        for k in range(f.n_instructions()):
            op, inputs, outputs = f.instruction_id(k), f.instruction_input(k), f.instruction_output(k)
            if op == ca.OP_OUTPUT:
                found = at[inputs[0]]
            elif op == ca.OP_INPUT:
                at[outputs[0]] = v
            elif op == ca.OP_CONST:
                at[outputs[0]] = np.full(len(v), f.instruction_constant(k)).astype(np.float32)
            else:
                at[outputs[0]] = own[op](*(at[i] for i in inputs))
    return found


@pytest.mark.parametrize("unit", [1e-9, 4e-4, 1e3])
def test_no_unit_makes_a_polynomial_or_its_inverse_leave_the_numbers_of_a_float(unit):
    """A stroke in any unit, and what it costs, in any: about the range, and a rounding beside its middle."""
    f = ca.Function("f", [V], [(V / unit + (V / unit) ** 3 / 3) / unit])
    for made, end in ((proven_polynomial, unit), (proven_inverse, float(f(unit)))):
        polynomial = made(f, 0.0, unit, 1e-6)
        assert polynomial is not None
        own = ca.Function("p", [V], [polynomial.of(V)])
        middle = np.float32(polynomial.centre)
        v = np.append(np.linspace(0, end, 99).astype(np.float32), np.nextafter(middle, [2 * middle, 0 * middle]))
        exact = own.map(len(v))(v).full().ravel()
        assert np.abs(in_float(own, v) - exact).max() < 1e-6 * np.abs(exact).max()
