"""A CasADi SX function as C99, in double or in true single precision.

CasADi's own generator computes in double whatever `casadi_real` is (constants, `sqrt`); this
printer writes every constant and every call in the chosen type, stores all outputs last (so
that an output may be the same array as an input), and passes only the arguments that are read.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import casadi as ca
import numpy as np

from ctrlgen.errors import CtrlgenError


class Real(Enum):
    """The arithmetic of the generated C."""

    DOUBLE = "double"
    FLOAT = "float"

    @property
    def suffix(self) -> str:
        """Name suffix of files and functions."""
        return "f64" if self is Real.DOUBLE else "f32"

    @property
    def bytes(self) -> int:
        """Size of a number."""
        return 8 if self is Real.DOUBLE else 4

    def literal(self, value: float) -> str:
        """The shortest decimal that reads back as the same number of this type."""
        if not math.isfinite(value):
            raise CtrlgenError(f"the constant {value} cannot be written as C")
        if self is Real.DOUBLE:
            text = repr(float(value))
        else:
            with np.errstate(over="ignore", under="ignore"):
                single = np.float32(value)
            if not np.isfinite(single) or (value != 0 and abs(single) < np.finfo(np.float32).tiny):
                raise CtrlgenError(
                    f"the constant {value:g} does not fit a float; rescale the model or export double only"
                )
            text = str(single)
        if "." not in text and "e" not in text:
            text += ".0"
        return text + ("f" if self is Real.FLOAT else "")

    def call(self, function: str) -> str:
        """Name of a <math.h> function in this type."""
        return function + ("f" if self is Real.FLOAT else "")


_BINARY = {ca.OP_ADD: "+", ca.OP_SUB: "-", ca.OP_MUL: "*", ca.OP_DIV: "/"}
_COMPARE = {ca.OP_LT: "<", ca.OP_LE: "<=", ca.OP_EQ: "==", ca.OP_NE: "!="}
_CALLS = {
    ca.OP_SQRT: "sqrt", ca.OP_EXP: "exp", ca.OP_LOG: "log", ca.OP_SIN: "sin", ca.OP_COS: "cos", ca.OP_TAN: "tan",
    ca.OP_ASIN: "asin", ca.OP_ACOS: "acos", ca.OP_ATAN: "atan", ca.OP_TANH: "tanh", ca.OP_SINH: "sinh", ca.OP_COSH: "cosh",
    ca.OP_POW: "pow", ca.OP_CONSTPOW: "pow", ca.OP_ATAN2: "atan2", ca.OP_FLOOR: "floor", ca.OP_CEIL: "ceil",
}  # fmt: skip


@dataclass(frozen=True)
class Kernel:
    """A printed function: C `text`, the `arguments` it reads, its number of arithmetic `operations`."""

    name: str
    text: str
    arguments: tuple[str, ...]
    operations: int

    def call(self, result: str, **values: str) -> str:
        """A C call with each argument's expression by name."""
        return f"{self.name}({', '.join([*(values[a] for a in self.arguments), result])})"


def print_function(function: ca.Function, name: str, real: Real) -> Kernel:
    """`function` (SX, dense arguments, one result) as a static C function writing to its last parameter.

    Raises CtrlgenError for an operation C has no counterpart of.
    """
    results: list[tuple[int, str]] = []
    lines: list[str] = []
    value: dict[int, str] = {}  # by work slot, as CasADi reuses them
    constant: dict[int, float] = {}
    used: set[int] = set()
    operations = 0
    for k in range(function.n_instructions()):
        op, inputs, outputs = function.instruction_id(k), function.instruction_input(k), function.instruction_output(k)
        if op == ca.OP_INPUT:
            used.add(inputs[0])
            value[outputs[0]] = f"{function.name_in(inputs[0])}[{_dense(function.sparsity_in(inputs[0]), inputs[1])}]"
            continue
        if op == ca.OP_OUTPUT:
            results.append((_dense(function.sparsity_out(0), outputs[1]), value[inputs[0]]))
            continue
        if op == ca.OP_CONST:
            constant[outputs[0]] = function.instruction_constant(k)
            value[outputs[0]] = _signed(real.literal(constant[outputs[0]]))
            continue
        constant.pop(outputs[0] if outputs else -1, None)
        operations += 1
        if op == ca.OP_DIV and inputs[1] in constant:  # a multiplication is several times cheaper
            value[-1] = _signed(real.literal(1 / constant[inputs[1]]))
            op, inputs = ca.OP_MUL, [inputs[0], -1]
        lines.append(f"    const {real.value} t{k} = {_expression(op, [value[i] for i in inputs], real)};")
        value[outputs[0]] = f"t{k}"
    written = {i for i, _ in results}
    results += [(i, real.literal(0.0)) for i in range(function.size1_out(0)) if i not in written]
    lines += [f"    result[{i}] = {text};" for i, text in sorted(results)]
    arguments = tuple(function.name_in(i) for i in range(function.n_in()) if i in used)
    parameters = ", ".join(
        [
            *(f"const {real.value} {a}[{function.size1_in(a)}]" for a in arguments),
            f"{real.value} result[{function.size1_out(0)}]",
        ]
    )
    return Kernel(name, f"static void {name}({parameters})\n{{\n" + "\n".join(lines) + "\n}\n", arguments, operations)


def _dense(sparsity: ca.Sparsity, nonzero: int) -> int:
    """Row of a column vector's nonzero."""
    return int(sparsity.row()[nonzero])


def _signed(literal: str) -> str:
    return f"({literal})" if literal.startswith("-") else literal


def _expression(op: int, a: list[str], real: Real) -> str:
    """One operation on the operands `a`."""
    zero, one, two = real.literal(0.0), real.literal(1.0), real.literal(2.0)
    if op in _BINARY:
        return f"{a[0]} {_BINARY[op]} {a[1]}"
    if op in _COMPARE:
        return f"({a[0]} {_COMPARE[op]} {a[1]}) ? {one} : {zero}"
    if op in _CALLS:
        return f"{real.call(_CALLS[op])}({', '.join(a)})"
    forms = {
        ca.OP_ASSIGN: "{0}", ca.OP_NEG: "-{0}", ca.OP_SQ: "{0} * {0}", ca.OP_TWICE: f"{two} * {{0}}", ca.OP_INV: f"{one} / {{0}}",
        ca.OP_FMIN: "({0} < {1}) ? {0} : {1}", ca.OP_FMAX: "({0} > {1}) ? {0} : {1}", ca.OP_FABS: f"({{0}} < {zero}) ? -{{0}} : {{0}}",
        ca.OP_SIGN: f"({{0}} > {zero}) ? {one} : (({{0}} < {zero}) ? -{one} : {zero})",
        ca.OP_IF_ELSE_ZERO: f"({{0}} != {zero}) ? {{1}} : {zero}", ca.OP_NOT: f"({{0}} != {zero}) ? {zero} : {one}",
        ca.OP_AND: f"(({{0}} != {zero}) && ({{1}} != {zero})) ? {one} : {zero}",
        ca.OP_OR: f"(({{0}} != {zero}) || ({{1}} != {zero})) ? {one} : {zero}",
    }  # fmt: skip
    if op not in forms:
        raise CtrlgenError(f"CasADi operation {op} has no C99 form here; add it to ctrlgen/firmware/cprint.py")
    return forms[op].format(*a)
